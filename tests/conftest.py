"""What tests of tasks and faces share."""

import pytest


@pytest.fixture
def no_screen(monkeypatch):
    """Keep windows off the screen of whoever runs the tests."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")

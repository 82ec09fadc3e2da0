import time

import numpy as np
import pytest

from pbd_gym.rendering import Window

SIZE = (128, 96)
FRAME = np.zeros((96, 128, 3), dtype=np.uint8)
FRAME[:, 64:] = (200, 100, 50)


@pytest.fixture
def pygame(monkeypatch):
    # Only so that no window pops up on the screen of whoever runs the tests.
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pygame = pytest.importorskip("pygame")
    yield pygame
    pygame.display.quit()


def test_a_window_shows_the_frame(pygame):
    with Window(SIZE, 0) as window:
        window.show(FRAME)
        screen = pygame.display.get_surface()
        assert screen.get_size() == (128, 96)
        assert screen.get_at((10, 10))[:3] == (0, 0, 0)
        assert screen.get_at((100, 50))[:3] == (200, 100, 50)
    assert window.closed
    assert not pygame.display.get_init()


def test_a_resized_window_keeps_the_picture_in_proportion(pygame):
    with Window(SIZE, 0) as window:
        window.show(FRAME)
        pygame.display.set_mode((512, 192), pygame.RESIZABLE)
        window.show(FRAME)
        screen = pygame.display.get_surface()
        assert screen.get_size() == (512, 192)
        # 192 rows make the picture 256 wide: it stands between columns 128 and 384.
        assert min(screen.get_at((60, 90))[:3]) > 200
        assert screen.get_at((140, 90))[:3] == (0, 0, 0)
        assert screen.get_at((370, 90))[:3] == (200, 100, 50)
        assert min(screen.get_at((450, 90))[:3]) > 200


def test_a_window_that_is_resized_between_two_frames_draws_again_at_once(pygame, monkeypatch):
    size, pauses = (512, 192), []

    def resize(seconds):
        if not pauses:
            pygame.display.set_mode(size, pygame.RESIZABLE)
            pygame.event.post(pygame.event.Event(pygame.VIDEORESIZE, size=size, w=512, h=192))
        pauses.append(seconds)
        sleep(seconds)

    sleep = time.sleep
    with Window(SIZE, 10) as window:
        monkeypatch.setattr(time, "sleep", resize)
        window.show(FRAME)
        assert pauses
        screen = pygame.display.get_surface()
        assert screen.get_size() == size
        assert screen.get_at((370, 90))[:3] == (200, 100, 50)


@pytest.mark.parametrize("leave", ["close button", "escape", "pygame.quit"])
def test_a_window_that_the_user_closes_stays_closed_and_raises_nothing(pygame, leave):
    window = Window(SIZE, 0)
    window.show(FRAME)
    assert not window.closed
    if leave == "close button":
        pygame.event.post(pygame.event.Event(pygame.QUIT))
    elif leave == "escape":
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_ESCAPE))
    else:
        pygame.quit()
    for _ in range(3):
        window.show(FRAME)
        assert window.closed
        assert not pygame.display.get_init()
    window.close()
    again = Window(SIZE, 0)
    again.show(FRAME)
    window.close()  # the one that was closed before leaves the new one alone
    again.show(FRAME)
    assert not again.closed
    again.close()


def test_a_window_that_never_showed_anything_opens_nothing(pygame):
    Window(SIZE, 30).close()
    assert not pygame.display.get_init()


def test_a_window_keeps_real_time(pygame):
    with Window(SIZE, 50) as window:
        window.show(FRAME)
        start = time.perf_counter()
        for _ in range(10):
            window.show(FRAME)
        seconds = time.perf_counter() - start
    assert seconds > 0.17  # 10 frames of 20 ms, less the clock's grain of 1 ms each and a margin


def test_windows_refuse_what_they_cannot_show(pygame):
    for fps in (-1, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="fps is"):
            Window(SIZE, fps)
    with pytest.raises(ValueError, match="size is"):
        Window((0, 96), 30)
    with pytest.raises(ValueError, match="expected uint8"), Window(SIZE, 0) as window:
        window.show(FRAME.astype(float))

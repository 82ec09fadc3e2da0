"""Every environment in every look: what `make gallery` draws can be looked at."""

import re
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import pbd_gym  # noqa: F401
from drawn import changed

ROOT = Path(__file__).parents[1]
IDS = [id for id in gymnasium.registry if id.startswith("PBD")]
KINDS = ["PBDRope-v0", "PBDCloth-v0", "PBDTriplePendulum-v0"]
LOOKS = [(color, theme) for color in ("material", "strain") for theme in ("light", "dark")]


def filmed(id, **look):
    """Return an environment on its way, drawing."""
    env = gymnasium.make(f"pbd_gym:{id}", render_mode="rgb_array", **look)
    env.reset(seed=3)
    env.action_space.seed(3)
    for _ in range(5):
        env.step(env.action_space.sample())
    return env


@pytest.mark.parametrize(
    ("id", "size"),
    # pendulums of all lengths and goals apart look alike, so that one of each kind is drawn large
    [(id, 256) for id in IDS] + [(id, size) for id in KINDS for size in (512, 1024)],
)
def test_frames_are_full_right_sized_repeatable_and_follow_the_state(id, size):
    envs = [filmed(id, render_size=(size, size), color=c, theme=t) for c, t in LOOKS]
    frames = [env.render() for env in envs]
    for env, frame in zip(envs, frames, strict=True):
        assert frame.shape == (size, size, 3)
        assert len(np.unique(frame.reshape(-1, 3), axis=0)) > 20
        np.testing.assert_array_equal(env.render(), frame)
        for _ in range(5):
            env.step(env.action_space.sample())
        assert changed(env.render(), frame) > 50 * (size / 256) ** 2
    for k, frame in enumerate(frames):
        assert all(changed(frame, other) > 100 for other in frames[:k])


@pytest.mark.parametrize("id", KINDS)
def test_nothing_flickers_while_a_body_moves_by_a_hair(id):
    env = filmed(id, render_size=(256, 256))
    pictures = env.unwrapped._pictures
    frame = env.render()
    batch = env.unwrapped._batch
    batch.world.x += np.float32(1e-5)  # a few thousandths of a pixel
    moved = pictures.draw(batch, 0)
    difference = np.abs(moved.astype(int) - frame)
    # a sample that changes sides is a ninth of a pixel or less in space; in the plane all is smooth
    assert difference.max() <= (64 if id == "PBDCloth-v0" else 2)
    assert difference.mean() < 0.01


def test_the_camera_stands_still_during_an_episode():
    env = filmed("PBDCloth-v0", render_size=(256, 256))
    first = env.render()
    for _ in range(20):
        env.step(env.action_space.sample())
    last = env.render()
    rim = np.ones((256, 256), dtype=bool)
    rim[20:-20, 20:-20] = False  # where neither cloth nor goal nor shadow is
    np.testing.assert_array_equal(first[rim], last[rim])


def test_the_readme_shows_animations_that_load_fast():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    shown = re.findall(r"\]\((docs/images/[^)]+)\)", readme)
    films = [name for name in shown if name.endswith(".gif")]
    for name in ("rope", "cloth", "pendulum", "strain", "chaos"):
        assert f"docs/images/{name}.gif" in films
    assert "docs/images/thousand.png" in shown
    for film in films:
        assert (ROOT / film).stat().st_size < 1_000_000

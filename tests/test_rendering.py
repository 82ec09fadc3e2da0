import copy
import pickle
import subprocess
import sys

import numpy as np
import pytest

from drawn import PLANE, changed, every_scene, no_goal, rope
from pbd_gym.rendering import Renderer


@every_scene
@pytest.mark.parametrize("size", [(32, 32), (128, 96), (514, 512)])
def test_a_frame_is_a_fresh_array_of_bytes(model, view, size):
    renderer = Renderer(model, view, size=size)
    frame, again = renderer.draw(model.positions), renderer.draw(model.positions)
    assert frame.dtype == np.uint8
    assert frame.shape == (size[1], size[0], 3)
    assert frame.flags.c_contiguous
    assert frame.flags.writeable
    assert not np.shares_memory(frame, again)
    frame[:] = 0
    np.testing.assert_array_equal(renderer.draw(model.positions), again)


@every_scene
def test_the_same_state_gives_the_same_bytes_whatever_was_drawn_before(model, view):
    goal = model.positions + 0.1
    used = Renderer(model, view, size=(160, 120))
    for shift in (0.3, -0.2, 5.0):
        used.draw(model.positions + shift, model.positions - shift, 0.1)
    frame = Renderer(model, view, size=(160, 120)).draw(model.positions, goal, 0.1)
    np.testing.assert_array_equal(used.draw(model.positions, goal, 0.1), frame)
    for twin in (pickle.loads(pickle.dumps(used)), copy.deepcopy(used)):
        np.testing.assert_array_equal(twin.draw(model.positions, goal, 0.1), frame)
    single = model.positions.astype(np.float32).astype(np.float64)
    np.testing.assert_array_equal(used.draw(model.positions.astype(np.float32)), used.draw(single))


@every_scene
def test_what_is_there_is_seen_and_moves(model, view):
    renderer = Renderer(model, view, size=(128, 128))
    empty = renderer.draw(no_goal(model))
    frame = renderer.draw(model.positions)
    assert changed(frame, empty) > 50
    assert changed(renderer.draw(model.positions + 0.1), frame) > 50
    assert len(np.unique(frame.reshape(-1, 3), axis=0)) > 8  # lines are smoothed, not stepped


@every_scene
def test_particles_that_are_not_finite_are_left_out(model, view):
    renderer = Renderer(model, view, size=(128, 128))
    whole = renderer.draw(model.positions)
    for value in (np.nan, np.inf, -np.inf, 1e300, 1e12):
        x = model.positions.copy()
        x[len(x) // 2] = value
        broken = renderer.draw(x, x, 0.1)
        assert broken.shape == whole.shape
        x[:] = value
        np.testing.assert_array_equal(renderer.draw(x, x), renderer.draw(no_goal(model)))


@every_scene
def test_a_picture_drawn_on_a_surface_is_the_picture(model, view):
    pygame = pytest.importorskip("pygame")
    renderer = Renderer(model, view, size=(160, 128))
    surface = pygame.Surface((160, 128))
    for shift in (0.3, 0.0):  # what moved leaves no trace
        renderer.draw_on(surface, model.positions + shift)
    shown = pygame.surfarray.array3d(surface).transpose(1, 0, 2)
    assert (shown == renderer.draw(model.positions)).all()
    with pytest.raises(ValueError, match="surface has size"):
        renderer.draw_on(pygame.Surface((64, 64)), model.positions)


@pytest.mark.parametrize(
    "size", [(511, 512), (512, 0), (-2, 64), (30, 64), (64.0, 64), 512, (64, 64, 3), "ab", None]
)
def test_bad_sizes_are_refused(size):
    with pytest.raises(ValueError, match="size is"):
        Renderer(rope(), PLANE, size=size)


@pytest.mark.parametrize(
    "view",
    [([0, 0], [0, 1]), ([0, 0], [np.inf, 1]), ([0, 0, 0], [1, 1, 1]), ([1, 1], [0, 0]), ([0, 0],)],
)
def test_bad_views_are_refused(view):
    with pytest.raises(ValueError, match="view is"):
        Renderer(rope(), view)


def test_bad_rails_are_refused():
    with pytest.raises(ValueError, match="rail is"):
        Renderer(rope(), PLANE, rails=[((0, 0), (np.nan, 0))])


def test_states_of_another_model_are_refused():
    model = rope()
    renderer = Renderer(model, PLANE)
    with pytest.raises(ValueError, match="x has shape"):
        renderer.draw(model.positions[1:])
    with pytest.raises(ValueError, match="goal has shape"):
        renderer.draw(model.positions, model.positions[None])
    for radius in (-0.1, np.nan, np.inf):
        with pytest.raises(ValueError, match="goal_radius is"):
            renderer.draw(model.positions, model.positions, radius)


HEADLESS = """
import os, sys
for name in [n for n in os.environ if n.startswith(("SDL", "PYGAME", "DISPLAY", "WAYLAND"))]:
    del os.environ[name]
from pbd_gym.physics import ModelBuilder, shapes
from pbd_gym.rendering import Renderer, Window, grid
before = dict(os.environ)
assert not {"pygame", "imageio_ffmpeg"} & set(sys.modules)
builder = ModelBuilder(2)
shapes.rope(builder, (0, 0), (0, -1), 5, mass=1.0)
model = builder.build()
renderer = Renderer(model, ([-1, -1], [1, 1]), size=(64, 64))
assert "pygame" not in sys.modules
frame = renderer.draw(model.positions)
assert frame.std() > 0
import pygame
assert not pygame.display.get_init() and not pygame.get_init()
assert dict(os.environ) == before
pygame.quit()
assert (renderer.draw(model.positions) == frame).all()
"""


def test_drawing_needs_no_display_and_leaves_the_environment_alone():
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", HEADLESS], capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout == ""  # nor does pygame greet anybody

import copy
import pickle
import subprocess
import sys

import numpy as np
import pytest

from pbd_gym.physics import Balls, Linkage, ModelBuilder, Net, shapes
from pbd_gym.rendering import Renderer
from pbd_gym.rendering.camera import OrthographicCamera, PerspectiveCamera
from pbd_gym.rendering.curves import smooth_line, smooth_sheet
from pbd_gym.rendering.scene import bob_radius, round_length

PLANE = ([-1.2, -1.2], [1.2, 1.2])
SPACE = ([-0.6, -0.6, 0.0], [0.6, 0.6, 0.8])
ROPE, CLOTH = 12, 6  # particles of the rope, particles along a side of the cloth


def rope(*, walls=False):
    builder = ModelBuilder(2)
    particles = shapes.rope(builder, (0, 0.5), (0, -0.5), ROPE, mass=0.2)
    builder.pin(particles[0])
    if walls:
        builder.set_room((-1.0, -1.0), (np.inf, np.inf))
    return builder.build()


def pendulum(masses):
    builder = ModelBuilder(2)
    shapes.pendulum(builder, (0, 0), [0.5] * len(masses), masses)
    return builder.build()


def cloth(*, loose_at=None, held=True):
    builder = ModelBuilder(3)
    grid = shapes.cloth(
        builder, (-0.3, 0.3, 0.4), (0, -0.6, 0), (0.6, 0, 0), (CLOTH,) * 2, mass=0.2
    )
    if held:
        builder.pin([grid[0, 0], grid[0, -1]])
    if loose_at is not None:
        builder.add_particles(loose_at, 0.1)
    builder.set_ground(0.0)
    return builder.build()


def mixed():
    builder = ModelBuilder(3)
    shapes.rope(builder, (-0.4, 0, 0.5), (0.4, 0, 0.3), ROPE, mass=0.2)
    shapes.pendulum(builder, (0.2, 0.3, 0.8), [0.25, 0.25], [1.0, 0.2])
    builder.add_particles((0, -0.3, 0.1), 0.1)
    builder.set_room((-0.6, -0.6, 0), (0.6, 0.6, 1))
    return builder.build()


def bodies_2d():
    builder = ModelBuilder(2)
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    outline = 0.3 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    shapes.soft_body_2d(builder, outline + np.array([-0.5, 0.2]), mass=0.2)
    shapes.rigid_box(builder, (0.5, 0.2), (0.5, 0.4), mass=0.2)
    return builder.build()


def bodies_3d():
    builder = ModelBuilder(3)
    shapes.soft_ball(builder, (-0.3, 0, 0.3), 0.2, mass=0.1)
    shapes.rigid_box(builder, (0.3, 0, 0.3), (0.2, 0.3, 0.2), mass=0.2)
    return builder.build()


def nets_and_balls(dim):
    builder = ModelBuilder(dim)
    side = np.linspace(-0.4, 0.0, 4)
    places = [(x, *[0.0] * (dim - 2), y + 0.5) for x in side for y in side]
    grid = builder.add_particles(places, 0.1).reshape(4, 4)
    builder.add_body(Net(tuple(map(tuple, [*grid.tolist(), *grid.T.tolist()])), 0.005))
    balls = builder.add_particles([(x, *[0.0] * (dim - 2), 0.3) for x in (0.2, 0.4)], 0.1)
    builder.add_body(Balls(tuple(balls.tolist()), 0.08))
    builder.set_ground(0.0)
    return builder.build()


def shapes_2d():
    builder = ModelBuilder(2)
    shapes.rope(builder, (-0.4, 0.9), (0.9, 0.9), ROPE, mass=0.2)
    pin = builder.add_particles((0.7, -0.6), 1.0, pinned=True)[0]
    builder.add_plane((0.0, -0.9), (0.3, 1.0))
    builder.add_sphere((-0.4, 0.0), 0.2)
    builder.add_box((0.5, 0.0), (0.3, 0.1), axes=[[0.8, 0.6], [-0.6, 0.8]])
    builder.add_capsule((0.7, -0.6), (0.2, -0.4), 0.05, pins=(pin, None))
    return builder.build()


def shapes_3d():
    builder = ModelBuilder(3)
    shapes.cloth(builder, (-0.3, 0.3, 0.6), (0, -0.6, 0), (0.6, 0, 0), (CLOTH,) * 2, mass=0.2)
    pin = builder.add_particles((-0.3, -0.3, 0.3), 1.0, pinned=True)[0]
    builder.add_plane((0.0, 0.5, 0.0), (0.0, -1.0, 1.0))
    builder.add_sphere((0.0, 0.0, 0.2), 0.2)
    builder.add_box((0.4, -0.3, 0.1), (0.1, 0.15, 0.1))
    builder.add_capsule((-0.3, -0.3, 0.3), (-0.5, 0.3, 0.5), 0.05, pins=(pin, None))
    builder.set_ground(0.0)
    return builder.build()


SCENES = {
    "rope": (rope(), PLANE),
    "walled rope": (rope(walls=True), PLANE),
    "pendulum": (pendulum([1.0, 0.3, 0.3]), PLANE),
    "cloth": (cloth(), SPACE),
    "rope and pendulum in space": (mixed(), SPACE),
    "bodies": (bodies_2d(), PLANE),
    "bodies in space": (bodies_3d(), SPACE),
    "nets and balls": (nets_and_balls(2), PLANE),
    "nets and balls in space": (nets_and_balls(3), SPACE),
    "shapes": (shapes_2d(), PLANE),
    "shapes in space": (shapes_3d(), SPACE),
}
every_scene = pytest.mark.parametrize(("model", "view"), SCENES.values(), ids=SCENES.keys())


def no_goal(model):
    return np.full(model.positions.shape, np.nan)


def changed(a, b):
    """How many pixels differ."""
    return int((a != b).any(axis=2).sum())


def as_ints(frame):
    return frame.astype(np.int64)


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


def test_the_goal_of_a_particle_is_a_disc_of_its_tolerance():
    model = rope()
    renderer = Renderer(model, PLANE, size=(256, 256))
    goal = no_goal(model)
    goal[-1] = (0.5, 0.5)
    x = no_goal(model)
    without, with_goal = renderer.draw(x), renderer.draw(x, goal, 0.2)
    rows, columns = np.nonzero((without != with_goal).any(axis=2))
    # 5 % margins leave 230.4 pixels for 2.4 m, so 96 pixels per metre; up is towards row 0.
    centre, radius = (127.5 + 0.5 * 96, 127.5 - 0.5 * 96), 0.2 * 96
    reach = np.hypot(columns - centre[0], rows - centre[1]).max()
    assert abs(reach - radius) < 1.5  # the pixels on the rim are half covered
    assert abs(columns.mean() - centre[0]) < 0.5
    assert abs(rows.mean() - centre[1]) < 0.5


def test_a_goal_of_a_whole_body_is_drawn_as_the_body():
    model = rope()
    renderer = Renderer(model, PLANE, size=(256, 256))
    x = no_goal(model)
    empty, ghost = renderer.draw(x), renderer.draw(x, model.positions, 0.2)
    solid = renderer.draw(model.positions)
    cover = changed(ghost, empty) / changed(solid, empty)
    assert 0.5 < cover < 1.1  # the solid rope has a gripper as well
    darkest = as_ints(ghost).sum(axis=2).min()
    assert darkest > as_ints(solid).sum(axis=2).min() + 100  # the ghost is translucent


def test_the_goal_of_a_cloth_shows_through_the_cloth():
    model = cloth()
    renderer = Renderer(model, SPACE, size=(256, 256))
    goal = model.positions.copy()
    goal[:, 2] = 0.0
    covering = goal * 1.3  # larger than the goal and right upon it
    assert changed(renderer.draw(covering, goal), renderer.draw(covering)) > 100
    assert changed(renderer.draw(model.positions, goal), renderer.draw(model.positions)) > 1000


def test_the_two_sides_of_a_cloth_differ():
    model = cloth()
    renderer = Renderer(model, SPACE, size=(128, 128))
    turned = model.positions.reshape(CLOTH, CLOTH, 3)[:, ::-1].reshape(-1, 3)
    difference = as_ints(renderer.draw(model.positions)) - as_ints(renderer.draw(turned))
    assert np.abs(difference).max() > 60


def test_the_inside_of_a_body_is_filled_paler_than_its_outline():
    model = bodies_2d()
    renderer = Renderer(model, PLANE, size=(256, 256))
    empty, frame = as_ints(renderer.draw(no_goal(model))), as_ints(renderer.draw(model.positions))
    # 96 pixels per metre: 0.3 m around (-0.5, 0.2), and (0.5, 0.2) within 0.25 m and 0.2 m
    rows, columns = np.mgrid[:256, :256]
    x, y = (columns - 127.5) / 96, (127.5 - rows) / 96
    for inside in ((x + 0.5) ** 2 + (y - 0.2) ** 2 < 0.26**2, np.hypot(x - 0.5, y - 0.2) < 0.17):
        colours = np.unique(frame[inside], axis=0)
        assert len(colours) == 1  # no squared paper shines through
        assert (frame != empty).any(axis=2)[inside].all()
        assert colours.sum() > frame.sum(axis=2).min() + 100
    outside = ((x + 0.5) ** 2 + (y - 0.2) ** 2 > 0.34**2) & (x < 0.2)
    np.testing.assert_array_equal(frame[outside], empty[outside])


def test_a_ball_is_lit_from_above_and_casts_a_shadow():
    model = bodies_3d()
    renderer = Renderer(model, SPACE, size=(256, 256))
    empty = as_ints(renderer.draw(no_goal(model)))
    x = model.positions.copy()
    x[162:] = np.nan  # the ball alone
    frame = as_ints(renderer.draw(x))
    blue = frame[..., 2] - frame[..., 0] > 60
    rows, _ = np.nonzero(blue)
    upper, lower = rows.min() + 8, rows.max() - 8
    brightness = [frame[row][blue[row]].sum(axis=1).mean() for row in (upper, lower)]
    assert brightness[0] > brightness[1] + 50
    drop = (empty - frame).min(axis=2)
    assert drop[~blue].max() > 10  # what is darker and not of the ball's colour


def test_what_is_near_hides_what_is_far():
    hidden, shown = (0.0, 0.1, 0.2), (0.0, -0.25, 0.65)  # under the cloth, and before it
    for place, pixels in ((hidden, 0), (shown, 20)):
        model = cloth(loose_at=place)
        renderer = Renderer(model, SPACE, size=(256, 256))
        without = model.positions.copy()
        without[-1] = np.nan
        seen = changed(renderer.draw(model.positions), renderer.draw(without))
        assert (seen > pixels) if pixels else (seen == 0)


def test_a_cloth_casts_a_shadow_that_fades_with_height():
    model = cloth(held=False)
    renderer = Renderer(model, SPACE, size=(256, 256))
    empty = as_ints(renderer.draw(no_goal(model)))
    darkness = []
    for height in (0.05, 0.6):
        x = model.positions.copy()
        x[:, 2] = height
        frame = as_ints(renderer.draw(x))
        # The cloth is blue; a shadow darkens every colour alike.
        drop = (empty - frame).min(axis=2)
        red_minus_blue = np.abs((empty - frame)[..., 0] - (empty - frame)[..., 2])
        darkness.append(drop[red_minus_blue < 12].max())
    assert darkness[0] > darkness[1] > 10


def test_a_heavier_bob_is_larger_and_bobs_do_not_touch():
    model = pendulum([1.0, 0.125])
    linkage = model.bodies[0]
    assert isinstance(linkage, Linkage)
    pivot, heavy, light = bob_radius(model, linkage)
    assert pivot == 0.0
    assert heavy == pytest.approx(2.0 * light)  # the cube root of 8
    monstrous = pendulum([1e6, 1e6])
    assert bob_radius(monstrous, linkage).sum() < 0.5 + 0.5


def test_walls_and_rails_are_drawn():
    x = no_goal(rope())
    open_air = Renderer(rope(), PLANE, size=(128, 128)).draw(x)
    walled = Renderer(rope(walls=True), PLANE, size=(128, 128)).draw(x)
    assert changed(walled[:, :8], open_air[:, :8]) > 500  # the wall at x = -1 m
    assert changed(walled[-8:], open_air[-8:]) > 500  # the floor at y = -1 m
    assert changed(walled[12:90, 40:], open_air[12:90, 40:]) == 0
    railed = Renderer(rope(), PLANE, size=(128, 128), rails=[((-1, 0), (1, 0))]).draw(x)
    assert changed(railed[60:68], open_air[60:68]) > 100


def seen(renderer, x, empty):
    """Rows and columns of the pixels that differ from an empty picture."""
    return np.nonzero((renderer.draw(x) != empty).any(axis=2))


def test_a_shape_is_drawn_where_it_is_and_as_large_as_it_is():
    builder = ModelBuilder(2)
    builder.add_particles((0.0, 0.0), 1.0)
    empty = Renderer(builder.build(), PLANE, size=(256, 256)).draw([(np.nan, np.nan)])
    # 5 % margins leave 230.4 pixels for 2.4 m, so 96 pixels per metre; up is towards row 0.
    builder.add_capsule((-0.5, 0.25), (0.5, 0.25), 0.25)
    rows, columns = seen(Renderer(builder.build(), PLANE, size=(256, 256)), [(9.0, 9.0)], empty)
    low, high = 127.5 - 0.75 * 96, 127.5 + 0.75 * 96
    for edge, expected in ((columns.min(), low), (columns.max(), high), (rows.max(), 127.5)):
        assert abs(edge - expected) < 2.0  # an edge of 2 units is drawn around it
    area = (0.5 * 1.0 + np.pi * 0.25**2) * 96**2
    rim = 2.0 * (1.0 + np.pi * 0.25) * 96  # and half a pixel more that it covers in part
    assert len(rows) == pytest.approx(area + rim, rel=0.02)


def test_a_ball_in_space_is_round_and_lit_from_above():
    builder = ModelBuilder(3)
    builder.add_particles((0.0, 0.0, 0.4), 1.0)
    nothing = np.full((1, 3), np.nan)
    empty = Renderer(builder.build(), SPACE, size=(256, 256)).draw(nothing)
    builder.add_sphere((0.0, 0.0, 0.4), 0.3)
    renderer = Renderer(builder.build(), SPACE, size=(256, 256))
    rows, columns = seen(renderer, nothing, empty)
    assert len(rows) == pytest.approx(np.pi / 4.0 * np.ptp(rows) * np.ptp(columns), rel=0.03)
    assert np.ptp(rows) == pytest.approx(np.ptp(columns), rel=0.05)
    frame = as_ints(renderer.draw(nothing)).sum(axis=2)
    middle = int(columns.mean())
    assert frame[rows.min() + 15, middle] > frame[rows.max() - 15, middle] + 100


def test_a_shape_moves_with_the_pin_that_carries_it():
    for model, view in ((shapes_2d(), PLANE), (shapes_3d(), SPACE)):
        renderer = Renderer(model, view, size=(128, 128))
        x = no_goal(model)
        without = renderer.draw(x)
        pin = model.pins[0]
        x[pin] = model.positions[pin]
        there = renderer.draw(x)
        x[pin] += 0.1
        assert changed(there, without) > 20
        assert changed(renderer.draw(x), there) > 20


def test_the_plane_is_seen_upright():
    camera = OrthographicCamera.framing(
        np.array([-1.0, 0.0]), np.array([1.0, 1.0]), (400, 400), 0.0
    )
    pixels, depth = camera.project(np.array([[0.0, 0.5], [1.0, 0.5], [0.0, 1.0]]))
    np.testing.assert_allclose(pixels, [[200, 200], [400, 200], [200, 100]])
    np.testing.assert_array_equal(depth, 0.0)
    np.testing.assert_allclose(camera.unproject(pixels), [[0.0, 0.5], [1.0, 0.5], [0.0, 1.0]])


def test_space_is_framed_upright_and_in_perspective():
    lower, upper = (np.array(corner) for corner in SPACE)
    camera = PerspectiveCamera.framing(lower, upper, (600, 400), 0.1, -1.0, 0.5)
    corners = np.array(np.meshgrid(*zip(lower, upper, strict=True))).reshape(3, -1).T
    pixels, _ = camera.project(corners)
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    np.testing.assert_allclose((low + high) / 2.0, [300, 200])
    assert (low >= [59.999, 39.999]).all()
    assert (high <= [540.001, 360.001]).all()
    # One direction fills the frame: the picture is as large as it can be.
    assert np.isclose(low, [60, 40]).any()
    up, depth = camera.project(np.array([[0, 0, 0.0], [0, 0, 0.5]]))
    assert up[1, 1] < up[0, 1]
    near, far = depth.min(), depth.max()
    assert camera.scale(near) > camera.scale(far)
    behind, _ = camera.project(camera.eye[None] - camera.axes[2])
    assert np.isnan(behind).all()


def test_smooth_curves_pass_through_every_particle():
    points = np.random.default_rng(0).normal(size=(7, 3))
    curve = smooth_line(points, 4)
    # Weights of the spline are exact at the knots up to rounding.
    np.testing.assert_allclose(curve[::4], points, atol=1e-14)
    straight = np.linspace([0.0, 0.0, 1.0], [6.0, 3.0, 1.0], 7)
    np.testing.assert_allclose(np.diff(smooth_line(straight, 4), n=2, axis=0), 0.0, atol=1e-14)
    sheet = np.random.default_rng(1).normal(size=(4, 5, 3))
    np.testing.assert_allclose(smooth_sheet(sheet, 3)[::3, ::3], sheet, atol=1e-14)


@pytest.mark.parametrize(
    ("length", "expected"), [(0.9, 0.5), (1.0, 1.0), (0.21, 0.2), (0.19, 0.1), (73.0, 50.0)]
)
def test_scales_have_round_lengths(length, expected):
    assert round_length(length) == pytest.approx(expected)


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


@every_scene
def test_what_is_seen_at_a_pixel_and_its_depth_is_the_point_that_was_projected(model, view):
    renderer = Renderer(model, view, size=(160, 128))
    pixels, depths = renderer.project(model.positions)
    inside = (pixels > 0).all(axis=1) & (pixels < (160, 128)).all(axis=1)
    assert inside.any()
    points = renderer.unproject(pixels, depths)
    np.testing.assert_allclose(points, model.positions, atol=1e-12)  # rounding alone

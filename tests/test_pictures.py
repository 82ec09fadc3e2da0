import numpy as np
import pytest

from drawn import (
    CLOTH,
    PLANE,
    SPACE,
    as_ints,
    bodies_2d,
    bodies_3d,
    changed,
    cloth,
    no_goal,
    pendulum,
    rope,
    shapes_2d,
    shapes_3d,
)
from pbd_gym.physics import Linkage, ModelBuilder
from pbd_gym.rendering import Renderer
from pbd_gym.rendering.scene import bob_radius


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

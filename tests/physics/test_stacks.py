"""What lies on something that moves: it stays where its friction can hold it."""

import numpy as np
import pytest

from pbd_gym.physics import ModelBuilder, shapes
from scenes import GRAVITY, world

DT, SUBSTEPS = 1 / 60, 10
# Contacts are left alone when a sweep moves nothing by more than g h^2/1000. What is lacking of
# them in every substep is a speed: that is how fast a stack may creep, 0.016 mm/s.
CREEP = GRAVITY * DT / SUBSTEPS / 1000.0
SETTLING, STAYING = 8, 10  # [s]


def box_outline(side, width=0.3, height=0.2):
    """Corners of a box around its centre, `side` along each edge."""
    share = np.linspace(-0.5, 0.5, side, endpoint=False)
    half = np.full(side, 0.5)
    corners = [(share, -half), (half, share), (-share, half), (-half, -share)]
    return np.concatenate([np.stack(pair, axis=1) for pair in corners]) * [width, height]


def depth(state):
    """By how much bodies overlap at most [m]."""
    table, x = state.model.encounters, state.x[0]
    c, (a, b) = x[table.particles], (x[ends] for ends in table.links.T)
    length = np.sum((b - a) ** 2, axis=1)
    along = np.sum((c - a) * (b - a), axis=1) / np.where(length > 0.0, length, 1.0)
    nearest = a + np.clip(along, 0.0, 1.0)[:, None] * (b - a)
    return float((table.distance - np.linalg.norm(c - nearest, axis=1)).max())


def run(state, seconds):
    for _ in range(round(seconds / DT)):
        state.step(DT, SUBSTEPS)


def check_that_they_stay(state, bodies, radius):
    """Let them settle; then nothing but creep moves them, and the one stays above the other."""
    run(state, SETTLING)
    start = [state.x[0, body].mean(axis=0) for body in bodies]
    for _ in range(STAYING):
        run(state, 1)
        for body, before in zip(bodies, start, strict=True):
            centre = state.x[0, body].mean(axis=0)
            assert np.abs(centre - before).max() < STAYING * CREEP
        assert np.linalg.norm(state.v[0], axis=1).max() < 1e-3
        assert depth(state) < 0.1 * radius
    lower, upper = (state.x[0, body] for body in bodies)
    # the lower face of the upper body is above the centre of the lower one, and over its middle
    assert upper[:, -1].min() > lower[:, -1].mean()
    assert np.abs(upper.mean(axis=0) - lower.mean(axis=0))[:-1].max() < 0.05


@pytest.mark.parametrize("stiffness", [3000.0, np.inf])
def test_a_soft_body_lies_on_another_for_ten_seconds(stiffness):
    radius, height = 0.02, 0.2
    builder = ModelBuilder(2)
    bodies = [
        shapes.soft_body_2d(
            builder,
            box_outline(6, height=height) + np.array([across, up]),
            mass=0.3,
            stretch_stiffness=30.0,
            shape_stiffness=stiffness,
            collision_radius=radius,
            collision_friction=0.5,
        )
        for across, up in ((0.0, height / 2 + radius), (0.02, 1.5 * height + 3.0 * radius))
    ]
    builder.set_ground(0.0, friction=0.5, radius=radius)
    check_that_they_stay(world(builder.build(damping=1.0)), bodies, radius)


def lattice_links(grid):
    """Links between the neighbours of a grid of particles."""
    rows = [np.moveaxis(grid, axis, 0) for axis in range(grid.ndim)]
    return np.concatenate([np.stack([m[:-1].ravel(), m[1:].ravel()], axis=1) for m in rows])


def test_a_soft_box_lies_on_another_in_space_for_ten_seconds():
    radius, size, counts = 0.03, np.array([0.3, 0.3, 0.2]), (4, 4, 3)
    axes = [np.linspace(-0.5, 0.5, count) * edge for count, edge in zip(counts, size, strict=True)]
    lattice = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    builder, bodies = ModelBuilder(3), []
    for place in ((0.0, 0.0, 0.1 + radius), (0.02, 0.01, 0.3 + 3.0 * radius)):
        body = builder.add_particles(lattice + place, 1.0 / len(lattice))
        builder.add_shape_match(body, compliance=1e-4)
        links = lattice_links(body.reshape(counts))
        builder.add_collision(body, radius, links=links, friction=0.5)
        bodies.append(body)
    builder.set_ground(0.0, friction=0.5, radius=radius)
    check_that_they_stay(world(builder.build(damping=2.0)), bodies, radius)


def leaning_balls(number, friction, sine=0.15, radius=0.05):
    """Balls on each other, each aside of the one below by sine times their distance, in turns."""
    builder = ModelBuilder(2)
    rows = np.arange(number)
    across, up = rows % 2 * sine * 2.0 * radius, rows * np.sqrt(1.0 - sine**2) * 2.0 * radius
    balls = builder.add_particles(np.stack([across, up + radius], axis=1), 0.2)
    builder.add_collision(balls, radius, within=True, friction=friction)
    builder.set_ground(0.0, friction=1.0, radius=radius)
    return world(builder.build())


@pytest.mark.parametrize("number", [2, 3])
def test_balls_that_do_not_turn_stay_on_each_other_where_friction_holds_them(number):
    state = leaning_balls(number, friction=0.5)
    run(state, STAYING)
    # the middle one of three carries twice as much
    limit = (number - 1) * STAYING * CREEP
    np.testing.assert_allclose(state.x[0], state.model.positions, atol=limit)


def test_a_ball_on_a_ball_slides_down_where_the_slope_is_more_than_the_friction():
    slope = 0.15 / np.sqrt(1.0 - 0.15**2)
    for share, holds in ((1.02, True), (0.98, False)):
        state = leaning_balls(2, friction=share * slope)
        run(state, 4)
        assert (state.x[0, 1, 1] > 0.14) == holds


def test_links_that_cross_in_space_and_meshes_wide_enough_are_closed():
    builder = ModelBuilder(3)
    across = builder.add_particles([(-0.1, 0.0, 0.0), (0.1, 0.0, 0.0)], 1.0, pinned=True)
    along = builder.add_particles([(0.0, -0.1, 0.3), (0.0, 0.1, 0.3)], 0.1)
    builder.add_shape_match(along)
    for rod in (across, along):
        builder.add_collision(rod, 0.06, links=[rod])  # together more than half a rod
    corners = np.array([(0.0, 0.0), (0.2, 0.0), (0.2, 0.2), (0.0, 0.2)])
    balls = []
    for place, radius in ((1.0, 0.06), (2.0, 0.02)):
        net = [builder.add_particles((place + x, y, 0.0), 1.0, pinned=True)[0] for x, y in corners]
        builder.add_collision(net, 0.06, links=np.stack([net, np.roll(net, -1)], axis=1))
        balls.append(builder.add_particles((place + 0.1, 0.1, 0.3), 0.1)[0])
        builder.add_collision(balls[-1:], radius)
    state = world(builder.build(damping=1.0))
    run(state, 3)
    # where the ends of one rod are 0.12 from the other
    assert state.x[0, along, 2].min() > np.sqrt(0.12**2 - 0.1**2) - 0.01
    # a ball in the middle of a mesh is 0.1 from its edges: the one keeps 0.12, the other 0.08
    assert state.x[0, balls[0], 2] == pytest.approx(np.sqrt(0.12**2 - 0.1**2), abs=0.01)
    assert state.x[0, balls[1], 2] < -1.0


@pytest.mark.parametrize("radius", [0.03, 0.05])
def test_bodies_whose_links_could_cross_in_space_are_refused(radius):
    builder = ModelBuilder(3)
    for height in (0.0, 1.0):
        rod = builder.add_particles([(0.0, 0.0, height), (0.2, 0.0, height)], 1.0)
        builder.add_collision(rod, radius, links=[rod])
    with pytest.raises(ValueError, match="collisions 0 and 1 keep") as refusal:
        builder.build()
    assert "links of 0.2 m, which could cross" in str(refusal.value)


def test_all_that_meets_is_seen_however_much_it_is():
    # 160 balls in one place: 80 encounters for each, and those of the last two come last
    random = np.random.default_rng(1)
    builder = ModelBuilder(2)
    crowd = builder.add_particles(random.normal(scale=0.01, size=(160, 2)), 1.0)
    pair = builder.add_particles([(9.9, 0.0), (10.02, 0.0)], 1.0)
    builder.add_collision(np.concatenate([crowd, pair]), 0.05, within=True)
    state = world(builder.build(gravity=(0.0, 0.0)))
    state.v[0, pair, 0] = (3.0, -3.0)
    state.step(DT, SUBSTEPS)  # unseen, they would approach by 0.1 m
    assert np.diff(state.x[0, pair, 0])[0] > 0.1 - 1e-12

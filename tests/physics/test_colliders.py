import numpy as np
import pytest

from pbd_gym.physics import ModelBuilder
from scenes import GRAVITY, world

H = 1e-3  # substep [s]
PARTING = 1.0  # speed at which particles are let out of shapes [m/s]


def frame(degrees):
    """Unit vectors along a slope and out of it."""
    angle = np.radians(degrees)
    return np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])


def on_plane(position, normal, *, mass=1.0, gravity=None, **surface):
    builder = ModelBuilder(2)
    builder.add_particles(position, mass)
    builder.add_plane((0.0, 0.0), normal, **surface)
    return world(builder.build(gravity=gravity))


def peaks(heights):
    inner = heights[1:-1]
    return inner[(inner > heights[:-2]) & (inner >= heights[2:])]


@pytest.mark.parametrize("degrees", [0.0, 30.0])
@pytest.mark.parametrize(("substeps", "worst"), [(10, 0.035), (100, 0.004)])
def test_bounce_heights_shrink_by_the_square_of_restitution(degrees, substeps, worst):
    _, normal = frame(degrees)
    restitution = 0.8
    state = on_plane(normal, normal, gravity=-GRAVITY * normal, restitution=restitution)
    heights = []
    for _ in range(200 * substeps):
        state.step(1 / 60 / substeps, 1)
        heights.append(state.x[0, 0] @ normal)
    measured = peaks(np.array(heights))[:4]
    # an impact is found up to a substep late and loses up to v h of way: first order in h
    np.testing.assert_allclose(measured, restitution ** (2 * np.arange(1, 5)), rtol=worst)


def test_a_particle_sticks_on_a_slope_up_to_the_angle_of_friction():
    friction = 0.5
    limit = np.degrees(np.arctan(friction))
    for degrees in (limit - 0.1, limit + 0.1):
        along, normal = frame(degrees)
        state = on_plane((0.0, 0.0), normal, friction=friction)
        for _ in range(1000):
            state.step(H, 1)
        down = -state.x[0, 0] @ along
        angle = np.radians(degrees)
        pull = GRAVITY * (np.sin(angle) - friction * np.cos(angle))
        # x = a/2 t (t + h); its rounding: 1e-16 m in each of 1000 substeps, added up twice
        expected = max(pull, 0.0) / 2.0 * (1.0 + H)
        assert down == pytest.approx(expected, rel=1e-6, abs=1e-9)
        assert state.x[0, 0] @ normal == pytest.approx(0.0, abs=1e-12)


def test_what_slides_is_held_by_kinetic_friction():
    static, kinetic, degrees = 0.8, 0.3, 35.0  # tan 35 = 0.7
    along, normal = frame(degrees)
    way = []
    for start in (0.0, 0.1):
        state = on_plane((0.0, 0.0), normal, friction=static, kinetic_friction=kinetic)
        state.v[0, 0] = -start * along
        for _ in range(1000):
            state.step(H, 1)
        way.append(-state.x[0, 0] @ along)
    angle = np.radians(degrees)
    pull = GRAVITY * (np.sin(angle) - kinetic * np.cos(angle))
    assert way[0] == pytest.approx(0.0, abs=1e-9)
    assert way[1] == pytest.approx(0.1 + pull / 2.0 * (1.0 + H), rel=1e-6)


@pytest.mark.parametrize("mass", [0.01, 1.0, 100.0])
def test_a_sliding_particle_stops_after_v2_over_2_mu_g_whatever_its_mass(mass):
    speed, friction = 2.0, 0.4
    state = on_plane((0.0, 0.0), (0.0, 1.0), mass=mass, friction=friction)
    state.v[0, 0, 0] = speed
    for _ in range(1500):
        state.step(H, 1)
    # the kick of friction acts over the whole substep: the discrete sum is short by exactly v h/2,
    # up to the last, partial substep of mu g h^2
    expected = speed**2 / (2.0 * friction * GRAVITY) - speed * H / 2.0
    assert state.x[0, 0, 0] == pytest.approx(expected, abs=friction * GRAVITY * H**2)
    assert state.x[0, 0, 0] == pytest.approx(speed**2 / (2.0 * friction * GRAVITY), rel=0.01)
    assert state.v[0, 0, 0] == 0.0


def test_a_moving_plane_drags_particles_along_by_the_relative_motion():
    speed, friction = 1.5, 0.4
    builder = ModelBuilder(2)
    builder.add_particles((0.0, 0.0), 1.0)
    pin = builder.add_particles((5.0, 5.0), 1.0, pinned=True)[0]
    builder.add_plane((0.0, 0.0), (0.0, 1.0), pin=pin, friction=friction)
    state = world(builder.build())
    for step in range(1, 101):
        state.step(0.01, 10, targets=np.array([[[5.0 + speed * 0.01 * step, 5.0]]]))
    # as seen from the belt it slides backwards and stops after v^2/2 mu g
    slide = speed * 1.0 - state.x[0, 0, 0]
    expected = speed**2 / (2.0 * friction * GRAVITY) - speed * H / 2.0
    assert slide == pytest.approx(expected, abs=friction * GRAVITY * H**2)
    assert state.v[0, 0, 0] == pytest.approx(speed, abs=1e-9)  # rounding of 5 m / h


def solids(dim, **surface):
    """One of each shape around the origin, and how far points are outside of any, in numpy."""
    builder = ModelBuilder(dim)
    up = np.eye(dim)[-1]
    turned = np.eye(dim)
    turned[np.ix_([0, -1], [0, -1])] = [[0.8, 0.6], [-0.6, 0.8]]
    box = (-0.5 * np.eye(dim)[0], np.full(dim, 0.2))
    ball = (0.5 * np.eye(dim)[0] + 0.1 * up, 0.25)
    rod = (np.full(dim, -0.3) + up, np.full(dim, 0.3) + up, 0.1)
    builder.add_plane(-0.6 * up, 3.0 * up + np.eye(dim)[0], **surface)
    builder.add_box(*box, axes=turned, **surface)
    builder.add_sphere(*ball, **surface)
    builder.add_capsule(*rod, **surface)

    def gaps(x):
        slope = (3.0 * up + np.eye(dim)[0]) / np.sqrt(10.0)
        excess = np.abs((x - box[0]) @ turned.T) - box[1]
        outside = np.linalg.norm(np.maximum(excess, 0.0), axis=-1)
        # far more points on the rod's axis than are needed to find the nearest to 1e-7 m
        line = rod[0] + np.linspace(0.0, 1.0, 2001)[:, None] * (rod[1] - rod[0])
        near = np.linalg.norm(x[..., None, :] - line, axis=-1).min(axis=-1)
        return np.stack(
            [
                (x + 0.6 * up) @ slope,
                outside + np.minimum(excess.max(axis=-1), 0.0),
                np.linalg.norm(x - ball[0], axis=-1) - ball[1],
                near - rod[2],
            ]
        )

    return builder, gaps


@pytest.mark.parametrize("margin", [0.0, 0.03])
def test_no_particle_enters_a_shape(margin):
    builder, gaps = solids(2, margin=margin, friction=0.3, restitution=0.7)
    random = np.random.default_rng(6)
    starts = random.uniform([-1.0, -0.5], [1.0, 1.8], (300, 2))
    starts = starts[gaps(starts).min(axis=0) > margin]
    builder.add_particles(starts, 1.0)
    state = world(builder.build())
    state.v[0] = random.normal(scale=3.0, size=starts.shape)
    for _ in range(120):
        state.step(1 / 60, 10)
        # set exactly on the surface, but where two shapes meet the second has the last word, and
        # the first is entered by what the second pushed: at most v h = 1e-2 m of the fastest
        depth = margin - gaps(state.x[0])
        assert np.quantile(depth.max(axis=0), 0.98) < 1e-7
        assert depth.max() < 0.012


def test_elastic_bounces_off_shapes_keep_the_speed():
    builder, gaps = solids(2, restitution=1.0)
    random = np.random.default_rng(7)
    starts = random.uniform([-1.0, -0.5], [1.0, 1.8], (100, 2))
    builder.add_particles(starts[gaps(starts).min(axis=0) > 0.0], 1.0)
    builder.set_room((-2.0, -2.0), (2.0, 2.0), restitution=1.0)
    state = world(builder.build(gravity=(0.0, 0.0)))
    state.v[0] = random.normal(scale=2.0, size=state.v[0].shape)
    before = np.linalg.norm(state.v[0], axis=1)
    for _ in range(60):
        state.step(1 / 60, 10)
    # a reflection at the normal found keeps the speed up to rounding of x/h, except where a
    # particle touches two shapes, or a shape and a wall, within one substep
    kept = np.isclose(np.linalg.norm(state.v[0], axis=1), before, rtol=1e-9)
    assert np.mean(kept) > 0.95


@pytest.mark.parametrize("place", [(0.5, 0.1), (-0.5, 0.0), (0.1, 1.1), (0.0, 1.0), (0.3, -0.9)])
def test_a_particle_inside_a_shape_is_let_out_at_a_bounded_speed(place):
    builder, gaps = solids(2)
    builder.add_particles(place, 1.0)
    state = world(builder.build(gravity=(0.0, 0.0)))
    before = gaps(state.x[0])
    assert before.min() < -0.01
    for _ in range(1000):
        start = state.x[0, 0].copy()
        state.step(H, 1)
        assert np.linalg.norm(state.x[0, 0] - start) < PARTING * H * (1.0 + 1e-9)
        assert np.linalg.norm(state.v[0, 0]) < 1e-9  # it keeps none of this
    assert gaps(state.x[0]).min() == pytest.approx(0.0, abs=1e-7)


def carried_ball(position, velocity=(0.0, 0.0), **surface):
    builder = ModelBuilder(2)
    builder.add_particles(position, 1.0)
    pin = builder.add_particles((-1.0, 0.0), 1.0, pinned=True)[0]
    builder.add_sphere((-1.0, 0.0), 0.1, pin=pin, **surface)
    state = world(builder.build(gravity=(0.0, 0.0)))
    state.v[0, 0] = velocity
    return state


def test_a_carried_ball_hits_as_hard_as_it_moves():
    for restitution in (0.0, 0.5, 1.0):
        state = carried_ball((0.0, 0.0), velocity=(-0.5, 0.0), restitution=restitution)
        for step in range(1, 81):
            state.step(1 / 60, 10, targets=np.array([[[-1.0 + 2.0 * step / 60, 0.0]]]))
        # v' = u + e (u - v) for a heavy ball of speed u; rounding of 1 m/h
        expected = 2.0 + restitution * (2.0 + 0.5)
        assert state.v[0, 0, 0] == pytest.approx(expected, abs=1e-9)
        assert state.x[0, 0, 0] - state.x[0, 1, 0] > 0.1 - 1e-12


@pytest.mark.parametrize("substeps", [2, 10, 40])
def test_what_a_ball_pushes_does_not_get_faster_with_more_substeps(substeps):
    state = carried_ball((-0.895, 0.004))
    fastest = 0.0
    for step in range(1, 31):
        state.step(1 / 30, substeps, targets=np.array([[[-1.0 + 1.5 * step / 30, 0.0]]]))
        fastest = max(fastest, np.linalg.norm(state.v[0, 0]))
    assert fastest < 1.5 * (1.0 + 1e-9)


def test_a_rod_between_two_pins_turns_with_them():
    builder = ModelBuilder(2)
    builder.add_particles((0.5, 0.2), 1.0)
    pins = builder.add_particles([(0.0, 0.0), (1.0, 0.0)], 1.0, pinned=True)
    builder.add_capsule((0.0, 0.0), (1.0, 0.0), 0.05, pins=(pins[0], pins[1]))
    state = world(builder.build(gravity=(0.0, 0.0)))
    for step in range(1, 61):
        lift = 0.6 * step / 60
        state.step(1 / 60, 10, targets=np.array([[[0.0, 0.0], [1.0, lift]]]))
        axis = np.array([1.0, lift]) / np.hypot(1.0, lift)
        across = axis[0] * state.x[0, 0, 1] - axis[1] * state.x[0, 0, 0]
        assert across > 0.05 - 1e-12
    # the middle of the rod moves at half the speed of its end, 0.6 m/s; the touch slides outwards
    assert state.v[0, 0, 1] == pytest.approx(0.3, rel=0.1)


@pytest.mark.parametrize("speed", [0.5, 1.0, 2.0])
def test_a_thin_rod_stops_what_is_slower_than_its_radius_per_substep(speed):
    radius, h = 0.005, 1 / 480
    assert speed * h < radius
    builder = ModelBuilder(2)
    # each meets the rod in another phase of its substep
    heights = 0.02 + np.linspace(0.0, speed * h, 23)
    builder.add_particles(np.stack([np.linspace(-0.1, 0.1, 23), heights], axis=1), 1.0)
    builder.add_capsule((-0.2, 0.0), (0.2, 0.0), radius)
    state = world(builder.build(gravity=(0.0, 0.0)))
    state.v[0, :, 1] = -speed
    for _ in range(30):
        state.step(1 / 60, 8)
    np.testing.assert_allclose(state.x[0, :, 1], radius, atol=1e-12)

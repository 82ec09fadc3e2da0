import numpy as np
import pytest

from scenes import GRAVITY, particles_2d, rope_2d, world

ABOVE = ([-np.inf, 0.0], [np.inf, np.inf])
H = 1e-3  # substep [s]


def on_ground(positions, *, mass=1.0, gravity=None, **properties):
    return world(particles_2d(positions, mass=mass, room=(*ABOVE, properties), gravity=gravity))


def peaks(heights):
    """Local maxima in the order of time."""
    inner = heights[1:-1]
    return inner[(inner > heights[:-2]) & (inner >= heights[2:])]


@pytest.mark.parametrize("restitution", [0.5, 0.8, 1.0])
def test_bounce_heights_shrink_by_the_square_of_restitution(restitution):
    state = on_ground((0.0, 1.0), restitution=restitution)
    heights = []
    for _ in range(3000):
        state.step(H, 1)
        heights.append(state.x[0, 0, 1])
    measured = peaks(np.array(heights))[:3]
    expected = restitution ** (2 * np.arange(1, len(measured) + 1))
    assert len(measured) == 3 if restitution > 0.5 else len(measured) >= 2
    # each impact is found up to a substep late, which costs v h of way and g h of speed in the
    # worst case: at v = 4.4 m/s up to 2 v h = 9 mm of height per bounce
    slack = 2.0 * np.sqrt(2.0 * GRAVITY) * H * np.arange(1, len(measured) + 1)
    np.testing.assert_array_less(np.abs(measured - expected), slack)


def test_resting_contact_does_not_hop():
    state = on_ground((0.0, 0.0), restitution=0.9)
    for _ in range(300):
        state.step(1 / 60, 10)
        assert state.x[0, 0, 1] == 0.0
        assert state.v[0, 0, 1] == 0.0


@pytest.mark.parametrize("radius", [0.0, 0.05])
def test_a_dropped_particle_comes_to_rest_on_the_ground(radius):
    state = on_ground((0.0, 0.5), restitution=0.6, radius=radius)
    for _ in range(300):
        state.step(1 / 60, 10)
    assert state.x[0, 0, 1] == radius
    assert state.v[0, 0, 1] == 0.0


@pytest.mark.parametrize("mass", [0.01, 1.0, 100.0])
@pytest.mark.parametrize("friction", [0.2, 0.6])
def test_a_sliding_particle_stops_after_v2_over_2_mu_g(mass, friction):
    speed = 2.0
    state = on_ground((0.0, 0.0), mass=mass, friction=friction)
    state.v[0, 0, 0] = speed
    for _ in range(1500):
        state.step(H, 1)
    # the kick of friction acts over the whole substep: the discrete sum is short by exactly v h/2,
    # up to the last, partial substep of mu g h^2
    expected = speed**2 / (2.0 * friction * GRAVITY) - speed * H / 2.0
    assert state.x[0, 0, 0] == pytest.approx(expected, abs=friction * GRAVITY * H**2)
    assert state.v[0, 0, 0] == 0.0


def test_a_particle_sticks_below_the_angle_of_friction_and_slides_above_it():
    friction = 0.5
    for tangent, slides in ((friction - 1e-6, False), (friction + 1e-3, True)):
        angle = np.arctan(tangent)
        # the ground stays level and gravity is tilted
        gravity = GRAVITY * np.array([np.sin(angle), -np.cos(angle)])
        state = on_ground((0.0, 0.0), friction=friction, gravity=gravity)
        for _ in range(1000):
            state.step(H, 1)
        if slides:
            way = GRAVITY * (np.sin(angle) - friction * np.cos(angle)) / 2.0
            # first order in h: way = a/2 t (t + h)
            assert state.x[0, 0, 0] == pytest.approx(way * (1.0 + H), rel=1e-6)
        else:
            assert state.x[0, 0, 0] == pytest.approx(0.0, abs=1e-12)


def test_nothing_leaves_the_room():
    random = np.random.default_rng(3)
    lower, upper, radius = np.array([-1.0, -0.5]), np.array([1.0, 0.5]), 0.02
    properties = {"restitution": 0.9, "friction": 0.3, "radius": radius}
    starts = random.uniform(0.9 * lower, 0.9 * upper, (40, 2))
    state = world(particles_2d(starts, room=(lower, upper, properties)))
    state.v[0] = random.normal(scale=50.0, size=(40, 2))
    for _ in range(200):
        state.step(1 / 60, 10)
        assert (state.x >= lower + radius).all()
        assert (state.x <= upper - radius).all()


def test_bounces_do_not_bring_in_energy():
    random = np.random.default_rng(4)
    walls = ([-1.0, -1.0], [1.0, 1.0], {"restitution": 1.0})
    state = world(particles_2d(random.uniform(-0.9, 0.9, (30, 2)), room=walls, gravity=(0, 0)))
    state.v[0] = random.normal(scale=5.0, size=(30, 2))
    before = np.sum(state.v**2)
    for _ in range(200):
        state.step(1 / 60, 10)
        # a reflection keeps the speed; v = (x - x_start)/h rounds to 1e-13 m/s
        assert np.sum(state.v**2) == pytest.approx(before, rel=1e-10)


def test_a_particle_inside_a_wall_is_let_out_without_a_launch():
    state = on_ground((0.0, -0.3))
    state.step(1 / 60, 10)
    assert state.x[0, 0, 1] == 0.0
    assert state.v[0, 0, 1] == 0.0


def test_a_rope_falls_together_on_the_ground_and_rests():
    model = rope_2d(8, length=0.5, damping=1.0)
    assert np.isinf(model.room.lower).all()
    room = ([-np.inf, -0.7], [np.inf, np.inf], {"friction": 0.5})
    pile = particles_2d(model.positions, room=room)
    state = world(pile)
    for _ in range(120):
        state.step(1 / 60, 10)
    np.testing.assert_array_equal(state.x[0, :, 1], -0.7)
    np.testing.assert_array_equal(state.v, 0.0)

import numpy as np
import pytest

from pbd_gym.physics import ModelBuilder, shapes
from scenes import cloth_3d, momenta, strain, world


def closest(state):
    """Smallest distance of two particles [m]."""
    x = state.x[0]
    gaps = np.linalg.norm(x[:, None] - x[None], axis=2)
    return gaps[np.triu_indices(len(x), 1)].min()


def test_a_free_cloth_keeps_its_momenta():
    state = world(cloth_3d(gravity=(0, 0, 0), damping=0.0, ground=False))
    state.v[0] = np.random.default_rng(2).normal(scale=0.2, size=state.v[0].shape)
    linear, _ = momenta(state)
    state.step(1e-3, 1)
    before, spin = momenta(state)
    np.testing.assert_allclose(before, linear, atol=1e-11)
    for _ in range(30):
        state.step(1 / 30, 20)
    after, last_spin = momenta(state)
    # forces between particles cancel; v = (x - x_start)/h rounds to 1e-16/1.7e-3 = 6e-14 m/s
    np.testing.assert_allclose(after, before, atol=1e-11)
    # the read-off of PBD damps rotations by (omega h)^2 per substep; shear of 1 m/s over 4 cm is
    # 5 rad/s: (5 * 1.7e-3)^2 * 600 substeps = 4 % of the largest spins, of either sign
    assert np.abs(last_spin).max() < 1.1 * np.abs(spin).max()


def test_the_threads_of_a_hanging_cloth_stretch_little():
    state = world(cloth_3d((10, 10), height=0.6, pins=[(0, 0), (0, 9)], ground=False))
    worst = 0.0
    for step in range(1, 91):
        # one corner is led up and down by 5 cm at 1 Hz
        targets = state.model.positions[None, state.model.pins].copy()
        targets[0, 1, 2] += 0.05 * np.sin(2 * np.pi * step / 30)
        state.step(1 / 30, 20, targets=targets)
        worst = max(worst, strain(state))
    # the bound that the cloth task promises for its threads
    assert worst < 0.05


@pytest.mark.parametrize(("side", "substeps", "bound"), [(16, 10, 0.005), (32, 20, 0.01)])
def test_a_cloth_between_a_fixed_and_a_driven_corner_keeps_its_threads(side, substeps, bound):
    builder = ModelBuilder(3)
    grid = shapes.cloth(
        builder,
        (0.0, 0.0, 0.0),
        (0.0, 0.0, -1.0),
        (1.0, 0.0, 0.0),
        (side, side),
        mass=0.2,
        stretch_compliance=0.0,
        bending_compliance=0.1,
        pinned=[(0, 0), (0, -1)],
    )
    # two particles that are apart: only to choose the kernels that the other tests use
    builder.set_self_collision(grid[-1, [0, -1]], 0.01)
    state = world(builder.build(iterations=2))
    # it sags out of its plane, in which 10 % of slack have no room
    state.x[0, :, 1] = np.random.default_rng(0).normal(scale=1e-3, size=side * side)
    state.x[0, state.model.pins, 1] = 0.0
    for step in range(1, 181):
        time = step / 60 - 1.0
        angle = 0.25 * np.sin(2.0 * np.pi * time) * np.clip(2.0 * time, 0.0, 1.0)
        reach = 1.0 - 0.1 * min(step / 60, 1.0)
        corner = (reach * np.cos(angle), 0.0, reach * np.sin(angle))
        state.step(1 / 60, substeps, targets=np.array([[(0.0, 0.0, 0.0), corner]]))
        # a second to let out the slack, then two seconds at 1 Hz with a ramp of half a second;
        # MuJoCo's implicit cloth has 2.9 % and 5.3 % there
        assert strain(state) < bound


def test_particles_do_not_fall_through_a_sieve_of_others():
    distance, spacing = 0.024, 0.03
    side = spacing * np.arange(6)
    sieve = np.array([(x, y, 0.0) for x in side for y in side])
    builder = ModelBuilder(3)
    builder.add_particles(sieve, 1.0, pinned=True)
    # dropped on the middles of the meshes, 0.707 * 3 cm from four wires: too narrow to pass
    dropped = np.array([(x, y, 0.2) for x in side[:-1] for y in side[:-1]]) + spacing / 2
    falling = builder.add_particles(dropped, 0.01)
    builder.set_self_collision(np.arange(len(sieve) + len(dropped)), distance)
    builder.set_room((-0.5, -0.5, -1.0), (0.7, 0.7, 1.0))
    state = world(builder.build(damping=1.0, iterations=2))
    for _ in range(60):
        state.step(1 / 30, 20)
        gaps = np.linalg.norm(state.x[0, falling][:, None] - sieve, axis=2)
        # gravity presses by g h^2 = 3e-5 m per substep, and four contacts are solved in turn
        assert gaps.min() > 0.95 * distance
        assert (state.x[0, falling, 2] > 0.0).all()


def test_a_cloth_laid_flat_on_the_table_lies_still():
    state = world(cloth_3d(height=0.004))
    for _ in range(30):
        state.step(1 / 30, 20)
    # it starts at rest and nothing pulls: 1 cm/s is what the cloth task calls still
    assert np.linalg.norm(state.v, axis=2).max() < 0.01
    np.testing.assert_allclose(state.x[0], state.model.positions, atol=1e-3)


def cloud(strangers):
    """60 particles at rest on a grid, numbered after some others far away that meet nobody."""
    builder = ModelBuilder(3)
    if strangers:
        builder.add_particles([(100.0 + i, 0.0, 0.0) for i in range(strangers)], 0.1)
    grid = np.stack(np.unravel_index(np.arange(60), (5, 4, 3)), axis=1)
    builder.add_particles(0.3 * grid, 0.1)
    builder.set_self_collision(np.arange(strangers + 60), 0.1)
    return world(builder.build(gravity=(0, 0, 0)))


@pytest.mark.parametrize("strangers", [1, 5])
def test_which_pairs_meet_does_not_depend_on_who_else_is_compared(strangers):
    # strangers move all others on to other blocks, whose boxes are compared first
    random = np.random.default_rng(4)
    x, v = random.uniform(0.0, 0.8, (60, 3)), random.normal(scale=2.0, size=(60, 3))
    runs = []
    for count in (0, strangers):
        state = cloud(count)
        state.x[0, count:], state.v[0, count:] = x, v
        for _ in range(5):
            state.step(1 / 30, 20)
        runs.append((state.x[0, count:].copy(), state.v[0, count:].copy()))
    np.testing.assert_array_equal(runs[1], runs[0])
    # without meeting anybody they would have flown on
    assert np.abs(runs[0][1] - v).max() > 0.1


def test_two_particles_that_fly_at_each_other_do_not_pass():
    distance = 0.024
    builder = ModelBuilder(3)
    builder.add_particles([(0.0, 0.0, 0.0), (1.0, 0.001, 0.0)], 0.1)
    builder.set_self_collision([0, 1], distance)
    state = world(builder.build(gravity=(0, 0, 0)))
    state.v[0, :, 0] = (1.0, -1.0)
    smallest = np.inf
    for _ in range(40):
        state.step(1 / 30, 20)
        smallest = min(smallest, closest(state))
    # a pair alone is set exactly to the distance in the substep in which it meets
    assert smallest > distance * (1.0 - 1e-9)
    assert state.x[0, 0, 0] < state.x[0, 1, 0]
    momentum, _ = momenta(state)
    np.testing.assert_allclose(momentum, 0.0, atol=1e-12)  # rounding of 1e-16 m / 1.7e-3 s


def test_particles_that_touch_rub_each_other_to_a_stop():
    distance, speed, friction = 0.024, 0.2, 0.5
    builder = ModelBuilder(3)
    builder.add_particles([(0.0, 0.0, 0.1), (1.0, 0.0, 0.1)], 0.1)
    builder.set_self_collision([0, 1], distance, friction=friction)
    state = world(builder.build())
    # one slides past the other, which lies half a collision distance away from it
    state.x[0, 1] = (0.0, 0.5 * distance, 0.1)
    state.v[0, 0, 0] = speed
    momentum, _ = momenta(state)
    state.step(1 / 30, 20)
    # pressed together by twice its weight, each of them is braked by 2 mu g: the relative speed of
    # 0.2 m/s falls by 4 mu g dt = 0.65 m/s within a step, so that nothing is left to slide but what
    # the overlap, let apart at 0.03 m/s, gives along the line between them, which has turned
    assert np.abs(state.v[0, 0, 0] - state.v[0, 1, 0]) < 0.03
    np.testing.assert_allclose(state.v[0, :, 0].sum() * 0.1, momentum[0], atol=1e-12)


def test_damped_links_draw_the_velocities_of_their_ends_together():
    rate, h = 20.0, 1 / 600
    builder = ModelBuilder(3)
    builder.add_particles((0.0, 0.0, 0.0), 0.1)
    builder.add_particles((1.0, 0.0, 0.0), 0.3)
    builder.add_chain([0, 1], damping=rate)
    # the distance of self-collision only chooses the kernels that the other tests use
    builder.set_self_collision([0, 1], 0.01)
    state = world(builder.build(gravity=(0, 0, 0)))
    state.v[0, 0] = (0.3, 0.01, 0.02)
    momentum, _ = momenta(state)
    before = state.v[0, 0, 1] - state.v[0, 1, 1]
    state.step(h, 1)
    after = state.v[0, 0, 1] - state.v[0, 1, 1]
    # backward Euler: 1/(1 + rate h) per substep. The link turns by v h / l = 2e-5 within it, which
    # carries that share of the 0.3 m/s along it over to the others
    assert after == pytest.approx(before / (1.0 + rate * h), abs=1e-5)
    np.testing.assert_allclose(momenta(state)[0], momentum, atol=1e-12)


def test_a_strain_limit_cuts_links_short():
    builder = ModelBuilder(3)
    builder.add_particles((0.0, 0.0, 0.0), 1.0, pinned=True)
    builder.add_particles((0.0, 0.0, -1.0), 1.0)
    builder.add_chain([0, 1], compliance=0.01, strain_limit=0.02)
    # the distance of self-collision only chooses the kernels that the other tests use
    builder.set_self_collision([0, 1], 0.01)
    state = world(builder.build(damping=2.0))
    for _ in range(120):
        state.step(1 / 30, 20)
        assert strain(state) < 0.02 + 1e-12
    # without the limit, the weight of 9.81 N would stretch it by 9.8 cm
    assert strain(state) == pytest.approx(0.02, abs=1e-12)


@pytest.mark.parametrize("spread", [0.0, 1e-9])
def test_a_cloth_crumpled_into_a_point_stays_finite(spread):
    state = world(cloth_3d((4, 4)))
    state.x[0] = [0.0, 0.0, 0.1]
    state.x[0] += np.random.default_rng(5).normal(scale=spread, size=state.x[0].shape)
    for _ in range(10):
        state.step(1 / 30, 20)
    assert np.isfinite(state.x).all()
    assert np.isfinite(state.v).all()

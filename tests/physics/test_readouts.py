import numpy as np
import pytest

from pbd_gym.physics import ModelBuilder, World, readouts, shapes
from scenes import GRAVITY, cloth_3d, particles_2d, rope_2d, world

DT, SUBSTEPS = 1 / 60, 10
H = DT / SUBSTEPS


def hanging(mass=2.0, particles=11, steps=0, **settings):
    """A rope that hangs from its first particle."""
    state = world(rope_2d(particles, pins=[0], rope={"mass": mass}, **settings))
    for _ in range(steps):
        state.step(DT, SUBSTEPS)
    return state


def carried(mass, particles):
    """Weight of what hangs below each link [N]."""
    return np.arange(particles - 1, 0, -1) * mass / particles * GRAVITY


@pytest.mark.parametrize("integrator", ["pbd", "rattle"])
@pytest.mark.parametrize("iterations", [1, 3])
def test_the_links_of_a_hanging_chain_carry_what_hangs_below(integrator, iterations):
    state = hanging(integrator=integrator, iterations=iterations)
    for _ in range(3):
        state.step(DT, SUBSTEPS, record=True)
    # s = C / ... is exact from the first iteration on; C is the difference of positions of 1 m,
    # whose rounding of 1e-16 m becomes 1e-16 * m / h^2 = 4e-11 N
    np.testing.assert_allclose(state.forces.chains[0], carried(2.0, 11), rtol=0, atol=1e-9)


def test_a_spring_at_rest_pulls_with_the_law_of_hooke():
    builder = ModelBuilder(2)
    builder.add_particles((0.0, 0.0), 1.0, pinned=True)
    builder.add_particles((0.0, -1.0), 1.5)
    builder.add_distance(0, 1, compliance=1e-3)
    state = world(builder.build(damping=4.0))
    for _ in range(600):
        state.step(DT, SUBSTEPS)
    state.step(DT, SUBSTEPS, record=True)
    # at rest to exp(-2 * 10) of the first swing of alpha m g
    assert state.forces.distances[0, 0] == pytest.approx(1.5 * GRAVITY, rel=1e-7)
    stretch = readouts.distance_violations(state.model, state.x)[0, 0]
    assert stretch / 1e-3 == pytest.approx(1.5 * GRAVITY, rel=1e-7)


def test_a_moving_spring_pulls_by_its_stretch_at_the_end_of_the_substep():
    builder = ModelBuilder(2)
    builder.add_particles([(0.0, 0.0), (1.3, 0.0)], 1.0)
    builder.add_distance(0, 1, rest=1.0, compliance=1e-2)
    state = world(builder.build(gravity=(0.0, 0.0)))
    for _ in range(5):
        state.step(DT, SUBSTEPS, record=True)
        stretch = readouts.distance_violations(state.model, state.x)
        # backward Euler: C_new = alpha F; rounding of 1 m
        np.testing.assert_allclose(state.forces.distances, stretch / 1e-2, rtol=1e-10)


def test_a_bend_pushes_its_ends_with_its_violation_over_its_compliance():
    builder = ModelBuilder(2)
    builder.add_particles([(-1.0, 0.2), (0.0, 0.0), (1.0, 0.2)], 1.0)
    builder.add_bend(0, 1, 2, compliance=0.05)
    state = world(builder.build(gravity=(0.0, 0.0)))
    state.step(DT, SUBSTEPS, record=True)
    violation = readouts.bend_violations(state.model, state.x)
    np.testing.assert_allclose(state.forces.bends, violation / 0.05, rtol=1e-10)


@pytest.mark.parametrize("integrator", ["pbd", "rattle"])
def test_the_ground_carries_the_weight_of_what_lies_on_it(integrator):
    room = ([-np.inf, 0.0], [np.inf, np.inf], {"restitution": 0.5})
    state = world(
        particles_2d([(0.0, 0.0), (1.0, 5.0)], mass=3.0, room=room, integrator=integrator)
    )
    for _ in range(5):
        state.step(DT, SUBSTEPS, record=True)
    # the other particle is in the air
    np.testing.assert_allclose(
        state.forces.walls[0], [[0.0, 3.0 * GRAVITY], [0.0, 0.0]], rtol=1e-10, atol=0
    )
    np.testing.assert_array_equal(readouts.touches_wall(state.model, state.x), [[True, False]])


def test_friction_holds_a_particle_on_a_slope_and_no_more_than_it_can():
    friction = 0.5
    # the ground stays level and gravity is tilted
    for angle, held in ((0.3, True), (0.6, False)):
        gravity = GRAVITY * np.array([np.sin(angle), -np.cos(angle)])
        room = ([-np.inf, 0.0], [np.inf, np.inf], {"friction": friction})
        state = world(particles_2d((0.0, 0.0), mass=2.0, room=room, gravity=gravity))
        for _ in range(5):
            state.step(DT, SUBSTEPS, record=True)
        rub, normal = state.forces.walls[0, 0]
        assert normal == pytest.approx(2.0 * GRAVITY * np.cos(angle), rel=1e-10)
        expected = 2.0 * GRAVITY * np.sin(angle) if held else friction * normal
        assert -rub == pytest.approx(expected, rel=1e-9)


def test_a_wall_gives_back_the_momentum_of_a_bounce():
    room = ([-np.inf, 0.0], [np.inf, np.inf], {"restitution": 0.8})
    state = world(particles_2d((0.0, 0.5), mass=2.0, room=room))
    state.v[0, 0, 1] = -1.0
    while not state.v[0, 0, 1] > 0.0:
        before = state.v[0, 0, 1]
        state.step(H, 1, record=True)
    change = 2.0 * (state.v[0, 0, 1] - before)
    # Newton: change of momentum over h is gravity and wall; rounding of 1e-16 m / h^2
    assert change / H == pytest.approx(state.forces.walls[0, 0, 1] - 2.0 * GRAVITY, rel=1e-9)


def test_the_forces_of_a_substep_that_is_solved_again_are_those_of_the_second_solve():
    # the lower link turns by a radian per substep, which the second-order solve cannot follow
    builder = ModelBuilder(2)
    shapes.pendulum(builder, (0.0, 0.0), [0.5, 0.5], [1.0, 1.0])
    state = world(builder.build(integrator="rattle", iterations=2, gravity=(0.0, 0.0)))
    state.v[0, 2] = (0.5 * 300.0, 0.0)
    for _ in range(3):
        before = state.v[0, 2].copy()
        state.step(1 / 300, 1, record=True)
        # Newton's law for the lower bob, which only the lower link pulls: every multiplier of this
        # substep counts once. The link's direction turns between its four projections by less than
        # the radian of the substep, so that their forces add up to no less than cos(1) = 0.54
        acceleration = np.linalg.norm(state.v[0, 2] - before) * 300.0
        assert 0.54 < acceleration / state.forces.chains[0, 1] < 1.0 + 1e-9


def test_forces_are_those_of_each_world():
    state = world(rope_2d(6, pins=[0], rope={"mass": 1.2}), 3)
    state.v[1] += (0.3, 0.0)
    alone = world(state.model)
    for _ in range(4):
        state.step(DT, SUBSTEPS, record=True)
        alone.step(DT, SUBSTEPS, record=True)
    np.testing.assert_array_equal(state.forces.chains[[0, 2]], alone.forces.chains[[0, 0]])
    assert (state.forces.chains[1] != alone.forces.chains[0]).all()


def test_recording_does_not_change_the_motion_by_a_bit():
    states = [hanging(), hanging()]
    for state in states:
        state.v[:] = np.random.default_rng(2).normal(scale=0.2, size=state.v.shape)
        for step in range(6):
            state.step(DT, SUBSTEPS, record=state is states[0] and step % 2 == 1)
    np.testing.assert_array_equal(states[0].x, states[1].x)
    np.testing.assert_array_equal(states[0].v, states[1].v)
    assert states[0].forces is not None
    assert states[1].forces is None


def test_forces_belong_to_the_last_step_only():
    state = hanging()
    state.step(DT, SUBSTEPS, record=True)
    forces = state.forces
    kept = forces.chains.copy()
    state.v += 1.0
    state.step(DT, SUBSTEPS, record=True)
    np.testing.assert_array_equal(forces.chains, kept)
    state.step(DT, SUBSTEPS)
    assert state.forces is None


def test_kinds_that_a_model_lacks_have_no_forces():
    state = hanging()
    state.step(DT, SUBSTEPS, record=True)
    particles = ("walls", "colliders", "self_collision", "encounters")
    for name, part in state.forces._asdict().items():
        if name in particles:
            np.testing.assert_array_equal(part, np.zeros((1, 11, 2)), name)
        elif name not in ("chains", "contacts"):
            assert part.shape[:2] == (1, 0), name


def test_modified_energy_is_invariant_in_free_flight():
    state = world(particles_2d([(0.0, 0.0), (1.0, 2.0)], mass=0.7))
    state.v[0] = [(1.0, 5.0), (-2.0, 3.0)]
    model, energies = state.model, []
    for _ in range(50):
        power = readouts.linear_momentum(model, state.v) @ model.gravity
        energy = readouts.kinetic_energy(model, state.v) + readouts.potential_energy(model, state.x)
        energies.append(energy + 0.5 * H * power)
        state.step(DT, SUBSTEPS)
    # E + h/2 m g.v is an invariant of v += g h, x += v h; v = dx/h rounds to 1e-13 m/s
    np.testing.assert_allclose(energies, np.broadcast_to(energies[0], (50, 1)), rtol=1e-11)


def test_energies_and_momenta_are_those_of_point_masses():
    builder = ModelBuilder(3)
    builder.add_particles((1.0, 2.0, 3.0), 2.0)
    builder.add_particles((9.0, 9.0, 9.0), 1.0, pinned=True)
    builder.add_particles((0.0, 1.0, 0.0), 0.5)
    state = World(builder.build(), 2, lanes=1)
    state.v[1] = [(1.0, 0.0, 0.0), (5.0, 5.0, 5.0), (0.0, 0.0, 4.0)]
    model, x, v = state.model, state.x, state.v
    np.testing.assert_allclose(readouts.kinetic_energy(model, v), [0.0, 1.0 + 4.0])
    np.testing.assert_allclose(readouts.potential_energy(model, x), 2.0 * GRAVITY * 3.0)
    np.testing.assert_allclose(readouts.linear_momentum(model, v)[1], [2.0, 0.0, 2.0])
    # 2 kg: (1, 2, 3) x (2, 0, 0) = (0, 6, -4); 0.5 kg: (0, 1, 0) x (0, 0, 2) = (2, 0, 0)
    np.testing.assert_allclose(readouts.angular_momentum(model, x, v)[1], [2.0, 6.0, -4.0])


def test_angular_momentum_in_the_plane_is_a_number():
    model = particles_2d([(2.0, 0.0), (0.0, 1.0)], mass=3.0)
    v = np.array([[[0.0, 1.0], [1.0, 0.0]]])
    np.testing.assert_allclose(readouts.angular_momentum(model, model.positions[None], v), [3.0])


def test_strains_and_violations_are_those_of_the_geometry():
    builder = ModelBuilder(2)
    builder.add_particles([(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (2.0, 1.0)], 1.0)
    builder.add_chain([0, 1, 2], rest=0.8, compliance=0.01)
    builder.add_chain([2, 3], rest=1.0)
    builder.add_distance(0, 3, rest=2.0, compliance=0.5)
    builder.add_bend(1, 2, 3, compliance=0.1)
    model = builder.build()
    x = model.positions[None]
    np.testing.assert_allclose(readouts.link_strains(model, x), [[0.25, 0.25, 0.0]])
    np.testing.assert_allclose(readouts.link_violations(model, x), [[0.2, 0.2, 0.0]])
    diagonal = np.sqrt(5.0) - 2.0
    np.testing.assert_allclose(readouts.distance_violations(model, x), [[diagonal]])
    np.testing.assert_allclose(readouts.distance_strains(model, x), [[diagonal / 2.0]])
    # (1, 0) - 2 (2, 0) + (2, 1) = (-1, 1)
    np.testing.assert_allclose(readouts.bend_violations(model, x), [[np.sqrt(2.0)]])
    # the rigid link of the second chain stores nothing
    stored = 0.5 * (2 * 0.2**2 / 0.01 + diagonal**2 / 0.5 + 2.0 / 0.1)
    np.testing.assert_allclose(readouts.elastic_energy(model, x), stored)


def test_particles_that_touch_are_told():
    model = cloth_3d((5, 5), height=0.05)
    x = np.repeat(model.positions[None], 2, axis=0)
    assert not readouts.touches_particle(model, x).any()
    x[1, 0] = x[1, 24] + (0.0, 0.0, 0.6 * 0.04)  # a corner at the collision distance of another
    np.testing.assert_array_equal(
        np.argwhere(readouts.touches_particle(model, x)), [[1, 0], [1, 24]]
    )
    assert not readouts.touches_particle(rope_2d(), np.zeros((1, 8, 2))).any()

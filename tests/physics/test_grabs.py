"""A particle becomes a pin and back while time runs, in each world by itself."""

import pickle

import numpy as np
import pytest

from pbd_gym.physics import Adaptive, ModelBuilder, Snapshot, World, shapes
from scenes import GRAVITY, momenta, world

DT, SUBSTEPS = 1 / 60, 10


def grabbable_rope(particles=8, *, grabbable=(0, 7), pins=(), **settings):
    """A rope of 1 m along x at rest."""
    builder = ModelBuilder(2)
    indices = shapes.rope(builder, (0.0, 0.0), (1.0, 0.0), particles, mass=0.8)
    builder.make_grabbable(indices[list(grabbable)])
    builder.pin(indices[list(pins)])
    return builder.build(**settings)


def rope(num_worlds=1, **settings):
    return world(grabbable_rope(**settings), num_worlds)


def pinned_rope(pins, **settings):
    """The same rope with pins for good: the positions of particles 0 and 7 do not matter to it."""
    builder = ModelBuilder(2)
    indices = shapes.rope(builder, (0.0, 0.0), (1.0, 0.0), 8, mass=0.8)
    builder.pin(indices[list(pins)])
    return world(builder.build(**settings))


def test_a_rope_that_is_not_grabbed_falls_freely():
    state = rope(gravity=(0.0, -GRAVITY))
    nobody = np.full((1, 2, 2), np.nan)  # targets of what is not grabbed are not read
    for _ in range(30):
        state.step(DT, SUBSTEPS, nobody)
    n, h = 30 * SUBSTEPS, DT / SUBSTEPS
    # exact for v += g h, x += v h; rounding of 300 substeps
    np.testing.assert_allclose(state.x[0, :, 1], -GRAVITY / 2 * n * h * (n * h + h), atol=1e-12)


@pytest.mark.parametrize("integrator", ["pbd", "rattle"])
def test_a_grabbed_particle_is_a_pin_to_the_last_bit(integrator):
    grabbed = rope(integrator=integrator, iterations=2)
    grabbed.grabbed[:] = True
    pinned = pinned_rope([0, 7], integrator=integrator, iterations=2)
    targets = pinned.x[:, [0, 7]].copy()
    for step in range(30):
        targets[0, 0] += (0.005, 0.01 * np.cos(step))
        grabbed.step(DT, SUBSTEPS, targets)
        pinned.step(DT, SUBSTEPS, targets)
    np.testing.assert_array_equal(grabbed.x, pinned.x)
    np.testing.assert_array_equal(grabbed.v, pinned.v)


def test_a_grabbed_particle_is_a_pin_even_where_a_solve_fails():
    states = [rope(integrator="rattle"), pinned_rope([0, 7], integrator="rattle")]
    states[0].grabbed[:] = True
    targets = states[0].x[:, [0, 7]] + np.array([0.013, 0.07])
    for state in states:
        state.v[0, 3:5] = [(0.0, 300.0), (0.0, -300.0)]  # a link turns by more than a radian
        state.step(DT, SUBSTEPS, targets)
    np.testing.assert_array_equal(states[0].x, states[1].x)
    np.testing.assert_array_equal(states[0].v, states[1].v)


def test_a_released_particle_keeps_the_velocity_of_the_pin():
    state = rope(gravity=(0.0, 0.0), grabbable=(0,), particles=2)
    state.grabbed[:] = True
    shift = np.array([0.02, 0.01])
    targets = state.x[:, :1].copy()
    # dragged along until the whole rope moves with the pin
    state.v[:] = shift / DT
    for _ in range(5):
        targets += shift
        state.step(DT, SUBSTEPS, targets)
    state.grabbed[:] = False
    at = state.x.copy()
    for _ in range(5):
        state.step(DT, SUBSTEPS)
    # free flight at the pin's speed; velocities carry 1e-16 m / h
    np.testing.assert_allclose(state.v[0], np.tile(shift / DT, (2, 1)), rtol=1e-10)
    np.testing.assert_allclose(state.x, at + 5 * shift, rtol=0, atol=1e-12)


def test_a_release_gives_the_rope_only_the_momentum_of_the_pin():
    state = rope(gravity=(0.0, 0.0), grabbable=(0,))
    state.grabbed[:] = True
    targets = state.x[:, :1].copy()
    for _ in range(10):
        targets += (0.0, 0.02)
        state.step(DT, SUBSTEPS, targets)
    before = momenta(state)[0]  # the pin's velocity with the particle's own mass counts already
    state.grabbed[:] = False
    state.step(DT, SUBSTEPS)
    # inner forces cancel in pairs; rounding of positions over h
    np.testing.assert_allclose(momenta(state)[0], before, atol=1e-12)


def test_a_grab_does_not_snap():
    state = rope(grabbable=(7,), pins=(0,))
    for _ in range(20):
        state.step(DT, SUBSTEPS)
    at = state.x[0, 7].copy()
    state.grabbed[:] = True
    target = at + np.array([0.01, 0.02])
    state.step(DT, SUBSTEPS, np.array([[[0.0, 0.0], target]]))
    np.testing.assert_array_equal(state.x[0, 7], target)
    # moved from where it was, at constant speed: two roundings
    np.testing.assert_allclose(state.v[0, 7], (target - at) / DT, rtol=1e-13)


def test_without_targets_a_grabbed_particle_stays_where_it_is():
    state = rope()
    state.grabbed[0, 1] = True
    for _ in range(10):
        state.step(DT, SUBSTEPS)
    np.testing.assert_array_equal(state.x[0, 7], [1.0, 0.0])
    np.testing.assert_array_equal(state.v[0, 7], 0.0)
    assert state.x[0, 0, 1] < -0.05  # the other end swings down


def test_a_grab_concerns_one_world():
    together, alone = rope(3), rope()
    together.grabbed[1, 0] = True
    targets = together.x[:, [0, 7]].copy()
    for _ in range(10):
        targets[1, 0] += (0.0, 0.01)
        together.step(DT, SUBSTEPS, targets)
        alone.step(DT, SUBSTEPS)
    np.testing.assert_array_equal(together.x[[0, 2]], np.repeat(alone.x, 2, axis=0))
    assert together.x[1, 0, 1] == pytest.approx(0.1)


def test_a_grabbed_particle_goes_through_walls():
    builder = ModelBuilder(2)
    builder.make_grabbable(builder.add_particles([(0.0, 0.5), (0.5, 0.5)], 1.0))
    builder.set_ground(0.0, friction=0.5)
    state = world(builder.build())
    state.grabbed[0, 0] = True
    for _ in range(60):
        state.step(DT, SUBSTEPS, np.array([[[0.0, -0.2], [np.nan, np.nan]]]))
    np.testing.assert_array_equal(state.x[0, 0], [0.0, -0.2])
    assert state.x[0, 1, 1] == 0.0  # the other one lies on the ground
    state.grabbed[:] = False
    state.step(DT, SUBSTEPS)
    assert state.x[0, 0, 1] == 0.0  # let out without a launch
    assert state.v[0, 0, 1] == 0.0


def test_lanes_and_threads_do_not_change_a_bit_of_grabs_and_adaptive_substeps():
    results = []
    substeps = Adaptive(reach=0.01, least=2, most=16)
    for num_worlds, keywords in ((1, {}), (11, {}), (11, {"lanes": 8, "num_threads": 2})):
        state = world(grabbable_rope(), num_worlds, **keywords)
        random = np.random.default_rng(5)
        for _ in range(8):
            state.grabbed[:] = random.random((11, 2))[:num_worlds] < 0.5
            way = random.normal(scale=0.05, size=(11, 2, 2)) * np.arange(1, 12)[:, None, None] / 11
            state.step(DT, substeps, state.x[:, [0, 7]] + way[:num_worlds])
        results.append(np.concatenate([state.x, state.v], axis=1))
    one, several, lanes = results
    np.testing.assert_array_equal(several, lanes)
    np.testing.assert_array_equal(one, several[:1])
    assert len(np.unique(state.substeps_used)) > 1


def test_a_snapshot_remembers_what_is_grabbed():
    state = rope()
    state.grabbed[0, 0] = True
    branch = Snapshot.from_bytes(state.snapshot().to_bytes())
    twin = rope()
    twin.restore(branch)
    state.grabbed[:] = False
    state.restore(branch)
    for copy in (twin, state, pickle.loads(pickle.dumps(state))):
        np.testing.assert_array_equal(copy.grabbed, [[True, False]])
        copy.step(DT, SUBSTEPS)
        np.testing.assert_array_equal(copy.x[0, 0], 0.0)


def test_a_snapshot_without_grabs_fits_no_world_with_them():
    state = rope()
    branch = Snapshot(state.model.fingerprint, state.x.copy(), state.v.copy())
    with pytest.raises(ValueError, match="grabbed particles"):
        state.restore(branch)


def test_the_target_of_a_grabbed_particle_is_finite():
    state = rope(2)
    state.grabbed[1, 1] = True
    targets = np.full((2, 2, 2), np.nan)
    with pytest.raises(ValueError, match=r"target of grabbable particle 1 in world 1 is \[nan"):
        state.step(DT, SUBSTEPS, targets)
    with pytest.raises(ValueError, match=r"expected \(2, 2, 2\)"):
        state.step(DT, SUBSTEPS, targets[:, :1])


def test_a_pinned_particle_cannot_be_grabbed():
    with pytest.raises(ValueError, match="grabbable particle 0 is 7; it is pinned for good"):
        grabbable_rope(grabbable=(7,), pins=(7,))


@pytest.mark.parametrize("particle", [-1, 3])
def test_only_particles_that_exist_can_be_made_grabbable(particle):
    builder = ModelBuilder(2)
    builder.add_particles(np.zeros((3, 2)), 1.0)
    with pytest.raises(ValueError, match=f"cannot grab particle {particle}: there are 3"):
        builder.make_grabbable(particle)


def test_a_particle_is_made_grabbable_once():
    builder = ModelBuilder(2)
    builder.add_particles(np.zeros((3, 2)), 1.0)
    with pytest.raises(ValueError, match="particle 1 is grabbable already"):
        builder.make_grabbable([1, 1])


def test_an_ordinary_model_has_nothing_to_grab():
    state = World(pinned_rope([0]).model, 2)
    assert state.grabbed.shape == (2, 0)
    assert len(state.model.grabbable) == 0
    assert state.snapshot().grabbed is None

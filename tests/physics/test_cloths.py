import numpy as np
import pytest
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


def test_particles_of_a_cloth_keep_their_distance():
    distance = 0.6 * 0.04
    state = world(cloth_3d((8, 8), pins=[(0, 0), (0, 7)]))
    start = state.x[:, state.model.pins].copy()
    low = 0.0
    for step in range(1, 91):
        # two corners are led over to the opposite side, 5 cm above the table, and wait
        share = min(step / 45.0, 1.0)
        lift = 0.1 * np.sin(np.pi * share) - 0.25 * share
        state.step(1 / 30, 20, targets=start + share * np.array([0.26, 0.0, 0.0]) + [0, 0, lift])
        low = min(low, closest(state) - distance)
    # contacts are solved after the threads, one sweep per substep: pairs in a pile push each other
    # back by a part of their depth; a fifth of the distance is what the weave cannot pass through
    assert low > -0.2 * distance
    assert state.x[0, :, 2].min() >= 0.004 - 1e-12


def test_a_cloth_laid_flat_on_the_table_lies_still():
    state = world(cloth_3d(height=0.004))
    for _ in range(30):
        state.step(1 / 30, 20)
    # it starts at rest and nothing pulls: 1 cm/s is what the cloth task calls still
    assert np.linalg.norm(state.v, axis=2).max() < 0.01
    np.testing.assert_allclose(state.x[0], state.model.positions, atol=1e-3)


def test_two_particles_that_fly_at_each_other_do_not_pass():
    state = world(cloth_3d((2, 2), gravity=(0, 0, 0), ground=False, damping=0.0))
    # opposite corners are shot at each other within the plane, at a tenth of a distance per substep
    centre = state.x[0].mean(axis=0)
    state.v[0] = (centre - state.x[0]) / 0.028 * 2.0
    smallest = np.inf
    for _ in range(60):
        state.step(1 / 30, 20)
        smallest = min(smallest, closest(state))
    assert smallest > 0.8 * 0.6 * 0.04


@pytest.mark.parametrize("spread", [0.0, 1e-9])
def test_a_cloth_crumpled_into_a_point_stays_finite(spread):
    state = world(cloth_3d((4, 4)))
    state.x[0] = [0.0, 0.0, 0.1]
    state.x[0] += np.random.default_rng(5).normal(scale=spread, size=state.x[0].shape)
    for _ in range(10):
        state.step(1 / 30, 20)
    assert np.isfinite(state.x).all()
    assert np.isfinite(state.v).all()

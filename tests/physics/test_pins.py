import numpy as np
import pytest

from scenes import rope_2d, world


def drawn(state, steps, substeps, shift=(0.05, 0.0), dt=1 / 30):
    """Move the first pin by a shift [m] in every control step; return the largest speed seen."""
    fastest = 0.0
    target = state.x[:, state.model.pins].copy()
    for _ in range(steps):
        target += shift
        state.step(dt, substeps, targets=target)
        fastest = max(fastest, np.linalg.norm(state.v, axis=2).max())
    return fastest


@pytest.mark.parametrize("substeps", [1, 3, 10])
def test_pins_reach_their_targets_exactly(substeps):
    state = world(rope_2d(6, pins=[0, 2]))
    targets = np.array([[[0.1, 0.7], [1 / 3, -0.4]]])
    state.step(1 / 60, substeps, targets=targets)
    np.testing.assert_array_equal(state.x[:, [0, 2]], targets)
    start = rope_2d(6, pins=[0, 2]).positions[[0, 2]]
    # one division of a way by dt: two roundings
    np.testing.assert_allclose(state.v[0, [0, 2]], (targets[0] - start) * 60.0, rtol=1e-14)


def test_pins_stay_where_they_are_without_targets():
    state = world(rope_2d(6, pins=[0, 2]))
    before = state.x[:, [0, 2]].copy()
    state.step(1 / 60, 10)
    np.testing.assert_array_equal(state.x[:, [0, 2]], before)
    np.testing.assert_array_equal(state.v[:, [0, 2]], 0.0)


def test_pins_feel_neither_gravity_nor_rope_nor_walls():
    state = world(rope_2d(6, pins=[0], rope={"mass": 1e6}, damping=9.0))
    for step in range(1, 31):
        state.step(1 / 60, 10, targets=np.array([[[0.01 * step, 0.0]]]))
        np.testing.assert_array_equal(state.x[0, 0], [0.01 * step, 0.0])


def test_a_pin_moves_linearly_within_a_control_step():
    # a light particle on a rigid link directly above the path shows where the pin is
    shift = np.array([[[0.02, 0.0]]])
    whole, parts = (world(rope_2d(3, pins=[0])) for _ in range(2))
    whole.step(0.04, 4, targets=shift)
    for part in range(1, 5):
        parts.step(0.01, 1, targets=shift * part / 4)
    # four steps to the quarter points are the four substeps of one; rounding of 1 m / h
    np.testing.assert_allclose(whole.x, parts.x, atol=1e-14)
    np.testing.assert_allclose(whole.v, parts.v, atol=1e-11)


def test_the_speed_of_a_dragged_rope_does_not_grow_with_substeps():
    speeds = [drawn(world(rope_2d(20, pins=[0], iterations=2)), 10, n) for n in (10, 20, 40, 80)]
    # the pin moves with 1.5 m/s; a pin that jumped would give speeds proportional to substeps
    assert max(speeds) < 1.5 * speeds[0]
    assert max(speeds) < 10.0 * 1.5

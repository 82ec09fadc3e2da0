import numpy as np
import pytest

from pbd_gym.physics import World
from scenes import rope_2d, world


def moving(num_worlds=3):
    """Worlds with two pins, on their way, and a copy of their state."""
    state = world(rope_2d(6, pins=[0, 3]), num_worlds)
    state.v[:] = np.random.default_rng(0).normal(scale=0.1, size=state.v.shape)
    state.step(1 / 60, 10)
    return state, state.snapshot()


def assert_untouched(state, before):
    np.testing.assert_array_equal(state.x, before.x)
    np.testing.assert_array_equal(state.v, before.v)


@pytest.mark.parametrize("name", ["num_worlds", "num_threads", "lanes"])
@pytest.mark.parametrize("value", [0, -1, 1.5, "2"])
def test_counts_are_whole_numbers(name, value):
    with pytest.raises(ValueError, match=f"{name} is {value!r}; expected a whole number from 1 up"):
        World(rope_2d(), **{"num_worlds": 2, name: value})


@pytest.mark.parametrize("dtype", [np.float16, np.int64, "complex128"])
def test_a_world_computes_in_single_or_double_precision(dtype):
    with pytest.raises(ValueError, match="allowed: float32, float64"):
        World(rope_2d(), dtype=dtype)


@pytest.mark.parametrize("dt", [0.0, -0.1, np.nan, np.inf])
def test_a_step_takes_positive_time(dt):
    state, before = moving()
    with pytest.raises(ValueError, match=f"dt is {dt}"):
        state.step(dt, 10)
    assert_untouched(state, before)


@pytest.mark.parametrize("substeps", [0, -3, 2.0, "10"])
def test_substeps_are_a_whole_number(substeps):
    state, before = moving()
    with pytest.raises(ValueError, match=f"substeps is {substeps!r}"):
        state.step(1 / 60, substeps)
    assert_untouched(state, before)


@pytest.mark.parametrize("shape", [(3, 2), (3, 1, 2), (1, 2, 2), (3, 2, 3), (4, 2, 2), (12,), ()])
def test_targets_have_one_place_per_world_and_pin(shape):
    state, before = moving()
    with pytest.raises(ValueError, match=r"targets have shape .* expected \(3, 2, 2\)"):
        state.step(1 / 60, 10, targets=np.zeros(shape))
    assert_untouched(state, before)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_targets_are_finite(value):
    state, before = moving()
    targets = state.x[:, [0, 3]].copy()
    targets[2, 1, 0] = value
    with pytest.raises(ValueError, match=rf"target of pin 1 in world 2 is \[\s*{value}"):
        state.step(1 / 60, 10, targets=targets)
    assert_untouched(state, before)


def test_a_refused_step_leaves_no_trace_in_the_next():
    state, before = moving()
    twin = world(state.model, 3)
    twin.restore(before)
    for wrong in ({"dt": -1.0}, {"dt": 1 / 50, "substeps": 0}, {"dt": 0.1, "targets": np.zeros(3)}):
        with pytest.raises(ValueError, match=r"is|have"):
            state.step(**wrong)
    state.step(1 / 60, 10)
    twin.step(1 / 60, 10)
    np.testing.assert_array_equal(state.x, twin.x)
    np.testing.assert_array_equal(state.v, twin.v)


def test_targets_may_be_lists_and_of_another_dtype():
    state, _ = moving(1)
    state.step(1 / 60, 10, targets=[[[0, 0], [0, -1]]])
    np.testing.assert_array_equal(state.x[0, [0, 3]], [[0.0, 0.0], [0.0, -1.0]])


def test_targets_are_not_changed():
    state, _ = moving(1)
    targets = np.array([[[0.1, 0.0], [0.1, -0.6]]])
    kept = targets.copy()
    state.step(1 / 60, 10, targets=targets)
    np.testing.assert_array_equal(targets, kept)

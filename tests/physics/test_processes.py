"""Worlds in other processes and in several Python threads at once."""

import copy
import importlib
import multiprocessing
import pickle
import time
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import numpy as np
import pytest

from pbd_gym.physics.compiling import load_kernels
from scenes import cloth_3d, rope_2d, world


def moving(num_threads=2):
    """Worlds that two threads share."""
    model = rope_2d(8, pins=[0], iterations=2, damping=0.3)
    state = world(model, 4, num_threads=num_threads)
    state.v[:] = np.random.default_rng(0).normal(scale=0.3, size=state.v.shape)
    return advance(state, 3)


def advance(state, steps):
    for _ in range(steps):
        state.step(1 / 60, 10)
    return state


def assert_same(a, b):
    np.testing.assert_array_equal(a.x, b.x)
    np.testing.assert_array_equal(a.v, b.v)


@pytest.mark.parametrize("clone", [lambda w: pickle.loads(pickle.dumps(w)), copy.deepcopy])
def test_a_copy_of_a_world_continues_to_the_last_bit_on_its_own(clone):
    state = moving()
    twin = clone(state)
    before = twin.x.copy()
    advance(state, 5)
    np.testing.assert_array_equal(twin.x, before)
    assert_same(advance(twin, 5), state)


def test_a_copy_of_a_world_with_self_collision_continues_to_the_last_bit():
    state = advance(world(cloth_3d((5, 5), height=0.05, pins=[(0, 0)])), 5)
    twin = pickle.loads(pickle.dumps(state))
    assert_same(advance(twin, 5), advance(state, 5))


def test_a_pickled_model_is_the_same_model_and_read_only():
    model = rope_2d(8, pins=[0])
    twin = pickle.loads(pickle.dumps(model))
    assert twin.fingerprint == model.fingerprint
    assert twin.bodies == model.bodies
    np.testing.assert_array_equal(twin.pins, model.pins)
    with pytest.raises(ValueError, match="read-only"):
        twin.positions[0] = 1.0


def step_in_child(state, connection):
    advance(state, 5)
    connection.send((state.x, state.v, state.num_threads))


@pytest.mark.parametrize(
    "method", sorted({"fork", "spawn"}.intersection(multiprocessing.get_all_start_methods()))
)
def test_a_child_process_steps_on_after_its_parent_used_threads(method):
    state = moving()
    context = multiprocessing.get_context(method)
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=step_in_child, args=(state, sender))
    child.start()
    sender.close()
    try:
        assert receiver.poll(60), "the child hangs"
        x, v, num_threads = receiver.recv()
    finally:
        child.kill()
        child.join()
    assert num_threads == 2
    advance(state, 5)
    np.testing.assert_array_equal(x, state.x)
    np.testing.assert_array_equal(v, state.v)


def test_worlds_step_in_two_python_threads_at_once():
    expected = advance(moving(), 50)
    with ThreadPoolExecutor(2) as threads:
        results = list(threads.map(lambda _: advance(moving(), 50), range(4)))
    for result in results:
        assert_same(result, expected)


def test_threads_that_want_the_same_kernels_at_once_load_them_once(monkeypatch):
    gate, loads, load = Barrier(4), [], importlib.import_module

    def slow_load(name):
        loads.append(name)
        time.sleep(0.05)  # time for the other threads to come
        return load(name)

    def wanted(_):
        gate.wait()
        return load_kernels(3, 101)  # which no other test loads

    monkeypatch.setattr(importlib, "import_module", slow_load)
    with ThreadPoolExecutor(4) as threads:
        loaded = list(threads.map(wanted, range(4)))
    # a second load would replace the package that the first is still taking DIM and LANES from
    assert len(loads) == 1
    assert {(kernels, kernels.DIM, kernels.LANES) for kernels in loaded} == {(loaded[0], 3, 101)}

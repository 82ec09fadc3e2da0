import io
import pickle
import zipfile

import numpy as np
import pytest

from pbd_gym.physics import Snapshot, World
from scenes import cloth_3d, rope_2d, world


def moving(num_worlds=2, **keywords):
    state = world(rope_2d(6, pins=[0]), num_worlds, **keywords)
    state.v[:] = np.random.default_rng(0).normal(scale=0.3, size=state.v.shape)
    advance(state, 3)
    return state


def advance(state, steps):
    for _ in range(steps):
        state.step(1 / 60, 10)


def assert_same(a, b):
    np.testing.assert_array_equal(a.x, b.x)
    np.testing.assert_array_equal(a.v, b.v)


def test_a_branch_from_a_snapshot_continues_to_the_last_bit():
    state = moving()
    branch = state.snapshot()
    advance(state, 10)
    first = state.snapshot()
    state.restore(branch)
    advance(state, 10)
    assert_same(state, first)


def test_another_world_continues_from_the_bytes_of_a_snapshot():
    state = moving()
    twin = world(rope_2d(6, pins=[0]), 2)
    twin.restore(Snapshot.from_bytes(state.snapshot().to_bytes()))
    advance(state, 10)
    advance(twin, 10)
    assert_same(state, twin)


def test_self_collision_keeps_nothing_from_before_a_snapshot():
    state = world(cloth_3d((5, 5), height=0.05, pins=[(0, 0)]))
    advance(state, 10)
    branch = state.snapshot()
    twin = world(state.model)
    twin.restore(branch)
    advance(state, 10)
    advance(twin, 10)
    assert_same(state, twin)


def test_a_snapshot_does_not_share_memory_with_the_world():
    state = moving()
    branch = state.snapshot()
    kept = branch.x.copy()
    advance(state, 1)
    np.testing.assert_array_equal(branch.x, kept)
    state.restore(branch)
    advance(state, 1)
    np.testing.assert_array_equal(branch.x, kept)


def test_a_snapshot_of_another_model_is_refused():
    state = moving()
    before = state.snapshot()
    other = world(rope_2d(6, pins=[0], damping=0.1), 2).snapshot()
    with pytest.raises(ValueError, match=other.fingerprint[:12]):
        state.restore(other)
    assert_same(state, before)


def test_a_snapshot_of_another_number_of_worlds_or_dtype_is_refused():
    state = moving()
    before = state.snapshot()
    with pytest.raises(ValueError, match=r"\(3, 6, 2\).*\(2, 6, 2\)"):
        state.restore(World(state.model, 3, dtype=np.float64).snapshot())
    with pytest.raises(ValueError, match=r"float32.*float64"):
        state.restore(World(state.model, 2, dtype=np.float32).snapshot())
    with pytest.raises(ValueError, match=r"velocities are float64 \(1, 6, 2\)"):
        state.restore(Snapshot(before.fingerprint, np.zeros((2, 6, 2)), np.zeros((1, 6, 2))))
    assert_same(state, before)


class Bomb:
    """Notes that it was unpickled."""

    exploded = False

    def __reduce__(self):
        return Bomb.explode, ()

    @staticmethod
    def explode():
        Bomb.exploded = True


def archive(**arrays):
    """An npz archive in memory; object arrays are pickled."""
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def npy(array):
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def bombs():
    return np.array([Bomb()], dtype=object)


WHOLE = np.zeros((1, 2, 2), dtype=int)
GOOD = {"fingerprint": np.array("f"), "x": np.zeros((1, 2, 2)), "v": np.zeros((1, 2, 2))}


def zipped(name, data):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as file:
        file.writestr(name, data)
    return buffer.getvalue()


JUNK = {
    "nothing": b"",
    "noise": np.random.default_rng(0).bytes(500),
    "text": b"x = 1",
    "a cut snapshot": archive(**GOOD)[:300],
    "a zip of something else": zipped("readme.txt", b"hello"),
    "a bare array": npy(np.zeros((1, 2, 2))),
    "missing velocities": archive(fingerprint=GOOD["fingerprint"], x=GOOD["x"]),
    "numbers as fingerprint": archive(**{**GOOD, "fingerprint": np.array(3.0)}),
    "several fingerprints": archive(**{**GOOD, "fingerprint": np.array(["f", "g"])}),
    "whole numbers": archive(**{**GOOD, "x": WHOLE, "v": WHOLE}),
    "two dtypes": archive(**{**GOOD, "v": np.zeros((1, 2, 2), np.float32)}),
    "two shapes": archive(**{**GOOD, "v": np.zeros((1, 3, 2))}),
    "a flat array": archive(**{**GOOD, "x": np.zeros(4), "v": np.zeros(4)}),
    "text in place of positions": archive(**{**GOOD, "x": np.array("x"), "v": np.array("v")}),
}


@pytest.mark.parametrize("name", JUNK)
def test_bytes_that_are_not_a_snapshot_are_refused(name):
    with pytest.raises(ValueError, match="not a snapshot"):
        Snapshot.from_bytes(JUNK[name])


def test_a_changed_byte_in_the_arrays_is_refused():
    data = bytearray(archive(**GOOD))
    data[len(data) // 2] ^= 0xFF
    with pytest.raises(ValueError, match="not a snapshot"):
        Snapshot.from_bytes(bytes(data))


@pytest.mark.parametrize("part", ["fingerprint", "x", "v", "pickle", "array"])
def test_nothing_is_unpickled(part):
    Bomb.exploded = False
    data = {
        "pickle": lambda: pickle.dumps(Bomb()),
        "array": lambda: npy(bombs()),
    }.get(part, lambda: archive(**{**GOOD, part: bombs()}))()
    with pytest.raises(ValueError, match="not a snapshot"):
        Snapshot.from_bytes(data)
    assert not Bomb.exploded


def test_the_bomb_would_have_gone_off():
    Bomb.exploded = False
    pickle.loads(pickle.dumps(Bomb()))
    assert Bomb.exploded


def test_a_good_archive_of_a_stranger_is_read_but_fits_no_world():
    snapshot = Snapshot.from_bytes(archive(**GOOD))
    with pytest.raises(ValueError, match="the snapshot is of model f"):
        moving().restore(snapshot)

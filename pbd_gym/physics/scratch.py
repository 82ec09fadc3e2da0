"""What the kernels of one thread work in."""

from __future__ import annotations

from typing import Any

import numpy as np

from pbd_gym.physics.model import Model
from pbd_gym.physics.parameters import PARTICLES_OF_A_BOX

# Pairs of self-collision that a world can list in a control step, and for each particle of a large
# cloth. Memory that is never written takes no space.
_PAIRS = 524_288
_PAIRS_PER_PARTICLE = 24
_CACHE_LINE = 64  # bytes


def allocate(model: Model, lanes: int, width: int, dtype: np.dtype) -> tuple[Any, ...]:
    """Return the rows of the particles, and lists of what may collide in a control step or None.

    Args:
        model: Of the worlds.
        lanes: Worlds side by side.
        width: Of a row.
        dtype: Of the worlds.
    """
    work = _zeros_on_cache_lines((model.num_particles + 3, width), dtype)
    return work, _pairs(model, lanes, dtype), _encounters(model, lanes, dtype)


def _zeros_on_cache_lines(shape: tuple[int, int], dtype: np.dtype) -> np.ndarray:
    """Return zeros that begin on a cache line: a vector that straddles two takes twice as long."""
    size = shape[0] * shape[1] * dtype.itemsize
    memory = np.zeros(size + _CACHE_LINE, dtype=np.uint8)
    begin = -memory.ctypes.data % _CACHE_LINE
    return memory[begin : begin + size].view(dtype).reshape(shape)


def _pairs(model: Model, lanes: int, dtype: np.dtype) -> tuple[np.ndarray, ...] | None:
    """Return scratch of self-collision, see `find_pairs`."""
    if model.self_collision is None:
        return None
    count = len(model.self_collision.particles)
    capacity = min(count * (count - 1) // 2, max(_PAIRS, _PAIRS_PER_PARTICLE * count))
    pairs = np.zeros((lanes, capacity, 3), dtype=np.int32)
    boxes = _zeros_on_cache_lines((-(-count // PARTICLES_OF_A_BOX), 4 * model.dim * lanes), dtype)
    return pairs, np.zeros(lanes, dtype=np.int64), np.zeros((1, lanes), dtype=dtype), boxes


def _encounters(model: Model, lanes: int, dtype: np.dtype) -> tuple[np.ndarray, ...] | None:
    """Return scratch of encounters, see `list_encounters`."""
    table = model.encounters
    if table is None:
        return None
    capacity = len(table.particles)
    indices = np.zeros((lanes, capacity, 6), dtype=np.int32)
    contacts = np.zeros((lanes * capacity, 4 + model.dim), dtype=dtype)
    scratch = np.zeros((2, lanes), dtype=dtype)
    return indices, np.zeros((2, lanes), dtype=np.int64), contacts, scratch

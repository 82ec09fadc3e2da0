"""What is recorded of each kind, and where the kernels leave it when it is asked for.

The kernels write plain numbers: those of a world are one row, of which each kind has a part. A new
kind is a field of `Forces`, a line in `_kinds` and a name in kernels/forces.py.
"""

from __future__ import annotations

from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from pbd_gym.physics.model import Model
from pbd_gym.physics.parameters import Forces
from pbd_gym.physics.tables import entries_of_joints, entries_of_links


class _Kind(NamedTuple):
    """How a kind is recorded.

    Attributes:
        numbers: How many the kernels note of a world; 0 if the model lacks the kind.
        shape: Of what is handed out.
        entries: Those of the numbers that are handed out; all where None.
    """

    numbers: int
    shape: tuple[int, ...]
    entries: np.ndarray | None = None


def _kinds(model: Model) -> dict[str, _Kind]:
    """Return how every kind is recorded, in the order of `Forces`."""
    vector = (model.dim,)
    return {
        "chains": _in_rows(model.chains, entries_of_links),
        "ropes": _in_rows(model.ropes, entries_of_links),
        "distances": _of_each(model.distances, "rest"),
        "limits": _of_each(model.limits, "greatest"),
        "bends": _of_each(model.bends, "compliance"),
        "rods": _in_rows(model.rods, entries_of_joints),
        "hinges": _of_each(model.hinges, "compliance"),
        "folds": _of_each(model.folds, "compliance"),
        "volumes": _of_each(model.volumes, "rest"),
        "shape_matches": _of_each(model.shape_matches, "particles", vector),
        "attachments": _of_each(model.attachments, "compliance", vector),
        "walls": _of_particles(model, model.room),
        "colliders": _of_particles(model, model.colliders),
        "self_collision": _of_particles(model, model.self_collision),
        "encounters": _of_particles(model, model.encounters),
        "contacts": _Kind(model.num_particles, (model.num_particles,)),
    }


def _of_each(table: Any, field: str, shape: tuple[int, ...] = ()) -> _Kind:
    """Return how a number or vector for each entry of a table's field is recorded."""
    count = 0 if table is None else len(getattr(table, field))
    return _Kind(count * int(np.prod(shape)), (count, *shape))


def _in_rows(table: Any, entries_of: Any) -> _Kind:
    """Return how chains, ropes and rods are recorded: at some of their particles nothing is."""
    if table is None:
        return _Kind(0, (0,))
    entries = entries_of(table)
    return _Kind(len(table.particles), (len(entries),), entries)


def _of_particles(model: Model, table: Any) -> _Kind:
    """Return how the forces of a kind of contact on all particles are recorded."""
    shape = model.num_particles, model.dim
    return _Kind(0 if table is None else int(np.prod(shape)), shape)


def allocate_forces(
    model: Model, num_worlds: int, lanes: int, num_threads: int, dtype: np.dtype
) -> list[tuple[np.ndarray, ...]]:
    """Return what the kernels of each thread write forces in (see kernels/forces.py).

    They share what is handed out, (W, numbers), the third of the tuple.
    """
    numbers = [kind.numbers for kind in _kinds(model).values()]
    starts, total = np.array([0, *accumulate(numbers)][:-1], dtype=np.int64), sum(numbers)
    out = np.zeros((num_worlds, total), dtype=dtype)
    scratch = [
        [np.zeros((total, lanes), dtype=dtype) for _ in range(2)] for _ in range(num_threads)
    ]
    return [(*pair, out, starts) for pair in scratch]


def copy_of_forces(model: Model, out: np.ndarray) -> Forces:
    """Return what the kernels wrote as forces by kind; absent contacts are zero."""
    parts, first = [], 0
    for kind in _kinds(model).values():
        part = out[:, first : first + kind.numbers]
        first += kind.numbers
        if kind.entries is not None:
            part = part[:, kind.entries]
        shape = len(out), *kind.shape
        parts.append(part.reshape(shape).copy() if kind.numbers else np.zeros(shape, out.dtype))
    return Forces(*parts)

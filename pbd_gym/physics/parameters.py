"""What the kernels are called with: a model's tables and the time step, in the state's dtype."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pbd_gym.physics.tables import (
    Attachments,
    Bends,
    Chains,
    Colliders,
    Distances,
    Encounters,
    Folds,
    Hinges,
    Limits,
    Particles,
    Rods,
    Room,
    Ropes,
    SelfCollision,
    ShapeMatches,
    Volumes,
)


class Parameters(NamedTuple):
    """A model as the kernels read it.

    A kind that a model does not have is None, which is known when the kernels are compiled: what
    would serve it is not compiled at all.

    Attributes:
        second_order: True for RATTLE, None for PBD.
        iterations: Projections of the rigid constraints in a substep.
    """

    particles: Particles
    chains: Chains
    ropes: Ropes | None
    distances: Distances
    limits: Limits | None
    bends: Bends
    rods: Rods | None
    hinges: Hinges | None
    folds: Folds | None
    volumes: Volumes | None
    shape_matches: ShapeMatches | None
    attachments: Attachments | None
    room: Room
    colliders: Colliders | None
    self_collision: SelfCollision | None
    encounters: Encounters | None
    second_order: bool | None
    iterations: int


class Timing(NamedTuple):
    """What the kernels derive from the time step, in the state's dtype.

    Attributes:
        dt: Control step [s].
        h: Substep [s].
        inverse_h2: 1/h^2 [1/s2].
        decay: exp(-damping h).
        rest_speed: Speed below which impacts do not bounce [m/s].
        gravity: Size of gravity [m/s2].
        speed_limit: That no free particle exceeds [m/s].
    """

    dt: Any
    h: Any
    inverse_h2: Any
    decay: Any
    rest_speed: Any
    gravity: Any
    speed_limit: Any


class Forces(NamedTuple):
    """Forces [N] of the last substep of a control step, one row per world.

    Attributes:
        chains: (W, links) of the chains, the first of `Model.links`; positive where a link pulls.
        distances: (W, E); positive where a distance pulls.
        bends: (W, B) size of the force on each outer particle; the middle one feels twice that.
        walls: (W, N, dim) of walls and shapes on each particle, friction included.
    """

    chains: Any
    distances: Any
    bends: Any
    walls: Any


def as_read(table: Any, dtype: np.dtype) -> Any:
    """Return a table as the kernels read it: its numbers in a dtype, its arrays writable copies.

    A read-only array would be another type to compile for.
    """
    if table is None or isinstance(table, bool | int):
        return table
    if isinstance(table, float):
        return dtype.type(table)
    if isinstance(table, np.ndarray):
        return table.astype(dtype if table.dtype.kind == "f" else np.int64)
    return type(table)(*(as_read(value, dtype) for value in table))

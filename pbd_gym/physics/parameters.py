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

# Particles that share a box where pairs that may meet are looked for: tells the kernels how to fill
# their scratch, and how much of it there must be.
PARTICLES_OF_A_BOX = 8


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
    """What held and touched in the last substep of a control step, one row per world.

    Forces are averages over that substep. An absent kind of constraint has no columns, an absent
    kind of contact is zero. The kernels number the kinds in this order.

    Attributes:
        chains: (W, links) tension [N] of the chains, the first of `Model.links`; negative where a
            link pushes. Strain limits are part of it, the damping of chains is not.
        ropes: (W, links) tension [N] of the implicit and slack chains, the others of `Model.links`.
            What brings a rope that follows a single pin back to length (part 3 in
            kernels/rope.py) is no force between particles and not part of it.
        distances: (W, E) pull [N]; negative where a distance pushes.
        limits: (W, E) pull [N] of slack distances, strain limits and tethers; negative where a
            lower bound pushes.
        bends: (W, B) size [N] of the force on each outer particle; the middle one feels twice
            that. Times the spacing it is the bending moment.
        rods: (W, joints) the same for each particle of a rod but its first and last.
        hinges: (W, H) torque [N m] about the edge; positive where it lessens the angle.
        folds: (W, F) size [N] of the multiplier; corner i feels weight_i times that.
        volumes: (W, V) pressure with which a content pushes outwards, [N/m] of an area and [Pa] of
            a volume or tetrahedron; negative where it is larger than its rest.
        shape_matches: (W, L, dim) force [N] on each particle of each matched body; a pin's is 0.
        attachments: (W, A, dim) force [N] on the particle; its anchor feels the opposite.
        walls: (W, N, dim) force [N] of the room on each particle, friction included.
        colliders: (W, N, dim) the same of solid shapes.
        self_collision: (W, N, dim) the same of the other particles of a cloth.
        encounters: (W, N, dim) the same of other bodies.
        contacts: (W, N) sum [N] of the sizes of all normal forces on each particle: what presses
            on it, whatever it is that touches.
    """

    chains: Any
    ropes: Any
    distances: Any
    limits: Any
    bends: Any
    rods: Any
    hinges: Any
    folds: Any
    volumes: Any
    shape_matches: Any
    attachments: Any
    walls: Any
    colliders: Any
    self_collision: Any
    encounters: Any
    contacts: Any


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

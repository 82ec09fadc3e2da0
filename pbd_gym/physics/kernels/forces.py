"""Forces of constraints and contacts, noted only where they were asked for.

A constraint moves the particles of a substep by w n s: its force along n, averaged over the
substep, is s/h^2. What is added to the velocities (the second half of RATTLE, restitution, rubbing)
counts as s h. The s are collected over all iterations of a substep.

`forces` is None, and no line of this is compiled, or a tuple of
    what is collected, (rows, LANES): one row for each number that is told of a world,
    what is put aside while a substep is solved again, of the same shape,
    what is handed out, (W, rows), and
    the first row of each kind, in the order of `Forces`.
A constraint with a vector has DIM rows, so that a pointer to the first serves k * LANES + lane.
"""

import numpy as np
from numba.core import types
from numba.extending import overload

from ..compiling import kernel, row
from ..parameters import Forces
from .layout import DIM, DIRECTION, FAILED, LANES, MULTIPLIER, TOO_FAST
from .tiles import lanes_used, world_of

(
    CHAINS,
    ROPES,
    DISTANCES,
    LIMITS,
    BENDS,
    RODS,
    HINGES,
    FOLDS,
    VOLUMES,
    SHAPE_MATCHES,
    ATTACHMENTS,
    WALLS,
    COLLIDERS,
    SELF_COLLISION,
    ENCOUNTERS,
    CONTACTS,
) = range(len(Forces._fields))


@kernel
def force_row(forces, kind, index):
    """Return where a force is collected, or None; index counts numbers, DIM to a vector."""
    if forces is None:
        return None
    return row(forces[0], forces[3][kind] + index)


def note(force, at, multiplier):
    """Add to what is collected in a row of `force_row`."""
    if force is not None:
        force[at] += multiplier


# Written into its callers. numba optimises a function before its callees are linked in; of a loop
# with calls LLVM then peels the first lane off, which leaves 31 lanes to vectorise.
@overload(note, inline="always")
def _note(force, at, multiplier):
    def add(force, at, multiplier):
        force[at] += multiplier

    if isinstance(force, types.NoneType):
        return lambda force, at, multiplier: None
    return add


@kernel
def note_move(force, at, move, inverse_mass):
    """Add what moves a particle; what cannot be moved feels no force."""
    if force is not None and inverse_mass > 0:
        force[at] += move / inverse_mass


@kernel
def note_normal(told, lane, push):
    """Add what presses the particles of a contact together.

    told: the forces, a kind, the particles and their shares in a force on the first; or None.
    """
    if told is None:
        return
    forces, _, corners, shares = told
    for corner in range(len(corners)):
        note(force_row(forces, CONTACTS, corners[corner]), lane, abs(shares[corner]) * push)


@kernel
def note_contact(told, at, push):
    """Add one component of the force on the first particle of a contact, and what answers it."""
    if told is None:
        return
    forces, kind, corners, shares = told
    for corner in range(len(corners)):
        note(force_row(forces, kind, corners[corner] * DIM), at, shares[corner] * push)


@kernel
def note_chain(forces, work, particles, first, last, scale):
    """Collect the multipliers of a chain that was just solved."""
    if forces is None:
        return
    for entry in range(first, last):
        at, into = row(work, particles[entry]), force_row(forces, CHAINS, entry)
        for lane in range(LANES):
            square = scale * 0
            for k in range(DIM):
                direction = at[DIRECTION + k * LANES + lane]
                square += direction * direction
            into[lane] += at[MULTIPLIER + lane] * np.sqrt(square) * scale


@kernel
def forget_forces(forces):
    """Begin a substep."""
    if forces is None:
        return
    forces[0][:] = 0


@kernel
def keep_forces(forces):
    """Put aside what a solve that may have failed has collected, and begin again."""
    if forces is None:
        return
    for index in range(forces[0].shape[0]):
        collected, kept = row(forces[0], index), row(forces[1], index)
        for lane in range(LANES):
            kept[lane] = collected[lane]
            collected[lane] = 0


@kernel
def take_up_kept_forces(forces, work):
    """Return to what was put aside in the lanes that have not failed."""
    if forces is None:
        return
    marks = row(work, work.shape[0] - 2)
    for index in range(forces[0].shape[0]):
        collected, kept = row(forces[0], index), row(forces[1], index)
        for lane in range(LANES):
            collected[lane] = kept[lane] if marks[FAILED + lane] == 0 else collected[lane]


@kernel
def store_forces(forces, x, tile, worlds, work, inverse_h2, mark):
    """Write the forces of the last substep, for the lanes of a tile that bear a mark."""
    if forces is None:
        return
    collected, out = forces[0], forces[2]
    marks = row(work, work.shape[0] - 2)
    for lane in range(lanes_used(tile, x, worlds)):
        if marks[TOO_FAST + lane] == mark:
            world = world_of(tile, lane, x, worlds)
            for index in range(out.shape[1]):
                out[world, index] = collected[index, lane] * inverse_h2

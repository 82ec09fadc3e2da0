"""Forces of constraints, noted only where they were asked for.

A constraint moves the particles of a substep by w n s: its force along n, averaged over the
substep, is s/h^2. What the second half of RATTLE adds to the velocities counts as s h. The scratch
collects s over the iterations of a substep; without it (None) no line of this is compiled. `forces`
are what is collected, what is kept while a substep is solved again, and what is handed out.
"""

import numpy as np

from ..compiling import kernel, row
from .layout import DIM, DIRECTION, FAILED, LANES, MULTIPLIER, TOO_FAST
from .masses import in_lane, inverse_mass_of
from .tiles import lanes_used, world_of


@kernel
def forget_forces(forces):
    """Begin a substep."""
    if forces is None:
        return
    noted = forces[0]
    noted.chains[:] = 0
    noted.distances[:] = 0
    noted.bends[:] = 0
    noted.walls[:] = 0


@kernel
def distance_row(forces, index):
    """Return where the force of a distance is collected, or None."""
    if forces is None:
        return None
    return row(forces[0].distances, index)


@kernel
def bend_row(forces, index):
    """Return where the force of a bend is collected, or None."""
    if forces is None:
        return None
    return row(forces[0].bends, index)


@kernel
def wall_row(forces, particle):
    """Return where the moves of a particle by walls are collected, or None."""
    if forces is None:
        return None
    return row(forces[0].walls, particle)


@kernel
def note(forces, index, multiplier):
    """Add to what is collected in a row."""
    if forces is not None:
        forces[index] += multiplier


@kernel
def note_chain(forces, work, particles, first, last, scale):
    """Collect the multipliers of a chain that was just solved."""
    if forces is None:
        return
    for entry in range(first, last):
        at, into = row(work, particles[entry]), row(forces[0].chains, entry)
        for lane in range(LANES):
            square = scale * 0
            for k in range(DIM):
                direction = at[DIRECTION + k * LANES + lane]
                square += direction * direction
            into[lane] += at[MULTIPLIER + lane] * np.sqrt(square) * scale


@kernel
def note_limit(forces, entry, lane, multiplier):
    """Collect what the strain limit of a chain's link adds."""
    if forces is not None:
        forces[0].chains[entry, lane] += multiplier


@kernel
def keep_forces(forces):
    """Put aside what a solve that may have failed has collected, and begin again."""
    if forces is None:
        return
    noted, kept = forces[0], forces[1]
    kept.chains[:] = noted.chains
    kept.distances[:] = noted.distances
    kept.bends[:] = noted.bends
    forget_forces(forces)


@kernel
def take_up_kept_forces(forces, work):
    """Return to what was put aside in the lanes that have not failed."""
    if forces is None:
        return
    noted, kept = forces[0], forces[1]
    marks = row(work, work.shape[0] - 2)
    for lane in range(LANES):
        if marks[FAILED + lane] == 0:
            noted.chains[:, lane] = kept.chains[:, lane]
            noted.distances[:, lane] = kept.distances[:, lane]
            noted.bends[:, lane] = kept.bends[:, lane]


@kernel
def store_forces(forces, x, tile, worlds, work, masses, inverse_h2, mark):
    """Write the forces [N] of the last substep, for the lanes of a tile that bear a mark."""
    if forces is None:
        return
    noted, _, out = forces
    marks = row(work, work.shape[0] - 2)
    for lane in range(lanes_used(tile, x, worlds)):
        if marks[TOO_FAST + lane] != mark:
            continue
        world = world_of(tile, lane, x, worlds)
        for index in range(out.chains.shape[1]):
            out.chains[world, index] = noted.chains[index, lane] * inverse_h2
        for index in range(out.distances.shape[1]):
            out.distances[world, index] = noted.distances[index, lane] * inverse_h2
        for index in range(out.bends.shape[1]):
            out.bends[world, index] = noted.bends[index, lane] * inverse_h2
        for particle in range(out.walls.shape[1]):
            w = in_lane(inverse_mass_of(masses, particle), row(work, particle), lane)
            for k in range(DIM):
                move = noted.walls[particle, k * LANES + lane]
                out.walls[world, particle, k] = move * inverse_h2 / w if w > 0 else w

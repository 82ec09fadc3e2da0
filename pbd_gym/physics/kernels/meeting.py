"""Lists, once per control step, which bodies can meet in it: particles and links of others."""

import numpy as np

from ..compiling import kernel, row
from .layout import DIM, LANES, POSITION, VELOCITY

# Speeds may grow within a control step, as light things are hit by heavy ones.
_SPEED_UP = 2.0


@kernel
def list_encounters(work, encounters, listed, timing):
    """List, for every lane, the encounters that can come about within the control step.

    listed: their indices, and what is near in a substep (LANES, capacity, 6), the numbers of what
    is listed and near (2, LANES), what a contact pushes (LANES * capacity, 4 + DIM), see
    `encounter`, and scratch (2, LANES): by how much two things can approach. All have room in the
    lists.
    """
    if encounters is None:
        return
    indices, counts, _, scratch = listed
    travel, beyond = row(scratch, 0), row(scratch, 1)
    _measure_travel(work, encounters.movers, travel, timing.dt, timing.gravity)
    for lane in range(LANES):
        counts[0, lane] = 0
    for index in range(encounters.reach.shape[0]):
        c = row(work, encounters.particles[index])
        a, b = row(work, encounters.links[index, 0]), row(work, encounters.links[index, 1])
        if _can_meet(c, a, b, encounters.reach[index], travel, beyond):
            for lane in range(LANES):
                if beyond[lane] < 0:
                    indices[lane, counts[0, lane], 0] = index
                    counts[0, lane] += 1


@kernel
def _measure_travel(work, movers, travel, dt, gravity):
    """Write by how much two things can approach within a control step, in every lane [m]."""
    real = type(dt)
    for lane in range(LANES):
        travel[lane] = real(0)
    for index in range(movers.shape[0]):
        at = row(work, movers[index])
        for lane in range(LANES):
            square = real(0)
            for k in range(DIM):
                square += at[VELOCITY + k * LANES + lane] * at[VELOCITY + k * LANES + lane]
            travel[lane] = max(travel[lane], square)
    for lane in range(LANES):
        travel[lane] = real(2 * _SPEED_UP) * (np.sqrt(travel[lane]) + gravity * dt) * dt


@kernel
def _can_meet(c, a, b, reach, travel, beyond):
    """Tell whether a particle can come to a link in any lane: where `beyond` [m2] is negative."""
    real = type(reach)
    half, zero, near = real(0.5), real(0), False
    for lane in range(LANES):
        square = zero
        for k in range(DIM):
            at = POSITION + k * LANES + lane
            delta = c[at] - half * (a[at] + b[at])
            square += delta * delta
        beyond[lane] = square - (reach + travel[lane]) * (reach + travel[lane])
        near |= beyond[lane] < zero
    return near

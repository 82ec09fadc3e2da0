"""Where a second-order solve fails: the substep is solved again in first order.

Along the directions of the substep's start a link cannot be brought to its length once it has
turned too far, and Newton's method does not arrive where light particles whip between heavy ones.
Left alone, the error would feed the next substep and energy would grow without bound. First-order
projection takes energy out instead.
"""

import numpy as np

from ..compiling import kernel, row
from .layout import DIM, KEPT, LANES, POSITION, START, VELOCITY

# Error of a rigid length beyond which the solve has failed, as a share of it.
_LENGTH_ERROR = 0.02
# The same for a soft length: beyond this its squared form is far from Hooke's law.
_STRETCH = 0.5
# Cosine of the greatest angle through which a link may turn within a substep.
_TURN = 0.5


@kernel
def count_failures(work, chains, distances):
    """Mark the lanes in which the second-order solve has failed; return how many there are."""
    failed = row(work, work.shape[0] - 2)
    for lane in range(LANES):
        failed[lane] = 0
    for chain in range(chains.offsets.shape[0] - 1):
        for entry in range(chains.offsets[chain], chains.offsets[chain + 1] - 1):
            a, b = row(work, chains.particles[entry]), row(work, chains.particles[entry + 1])
            _mark(a, b, chains.rest[entry], chains.compliance[entry], failed)
    for index in range(distances.rest.shape[0]):
        a, b = row(work, distances.pairs[index, 0]), row(work, distances.pairs[index, 1])
        # a soft one leaves an error in its length
        soft = distances.compliance[index] + (1 - distances.stiffness[index])
        _mark(a, b, distances.rest[index], soft, failed)
    count = 0
    for lane in range(LANES):
        count += 1 if failed[lane] > 0 else 0
    return count


@kernel
def _mark(a, b, rest, compliance, failed):
    real = type(rest)
    one, zero = real(1), real(0)
    tolerated = rest * (real(_LENGTH_ERROR) if compliance == zero else real(_STRETCH))
    cosine = real(_TURN)
    for lane in range(LANES):
        square, aligned, square_start = zero, zero, zero
        for k in range(DIM):
            now = a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane]
            start = a[START + k * LANES + lane] - b[START + k * LANES + lane]
            square += now * now
            aligned += now * start
            square_start += start * start
        # written so that what is no number has failed too
        in_length = abs(np.sqrt(square) - rest) <= tolerated
        in_line = aligned >= cosine * np.sqrt(square * square_start)
        failed[lane] = failed[lane] if in_length and in_line else one


@kernel
def return_to_prediction(work, masses, h):
    """Keep what was found, and go back to where the particles were predicted to be."""
    for particle in range(masses.inverse_mass.shape[0]):
        if masses.inverse_mass[particle] > 0:
            at = row(work, particle)
            for lane in range(DIM * LANES):
                at[KEPT + lane] = at[POSITION + lane]
                at[POSITION + lane] = at[START + lane] + at[VELOCITY + lane] * h


@kernel
def take_up_kept(work, masses):
    """Return to what was kept in the lanes that have not failed."""
    failed = row(work, work.shape[0] - 2)
    for particle in range(masses.inverse_mass.shape[0]):
        if masses.inverse_mass[particle] > 0:
            at = row(work, particle)
            for k in range(DIM):
                for lane in range(LANES):
                    again, kept = at[POSITION + k * LANES + lane], at[KEPT + k * LANES + lane]
                    at[POSITION + k * LANES + lane] = again if failed[lane] > 0 else kept

"""What is done where a solve fails.

Second order: along the directions of the substep's start a link cannot be brought to its length
once it has turned too far, and Newton's method does not arrive where light particles whip between
heavy ones. Left alone, the error would feed the next substep and energy would grow without bound.
The substep is solved again in first order, which takes energy out instead.

Any order: constraints that contradict each other may send a particle anywhere. A control step that
ends beyond the speed limit is taken again with every substep held within it.
"""

import numpy as np

from ..compiling import kernel, row
from .layout import DIM, FAILED, KEPT, LANES, POSITION, SQUARES, START, TOO_FAST, VELOCITY
from .masses import inverse_mass_of, is_grabbed

# Error of a rigid length beyond which the solve has failed, as a share of it.
_LENGTH_ERROR = 0.02
# The same for a soft length: beyond this its squared form is far from Hooke's law.
_STRETCH = 0.5
# Squared cosine of the greatest angle through which a link may turn within a substep.
_TURN = 0.25


@kernel
def has_failed(work, chains, distances):
    """Mark the lanes in which the second-order solve has failed; tell whether there are any."""
    marks = row(work, work.shape[0] - 2)
    for lane in range(LANES):
        marks[FAILED + lane] = 0
    for chain in range(chains.offsets.shape[0] - 1):
        for entry in range(chains.offsets[chain], chains.offsets[chain + 1] - 1):
            a, b = row(work, chains.particles[entry]), row(work, chains.particles[entry + 1])
            _mark(a, b, chains.rest[entry], chains.compliance[entry], marks)
    for index in range(distances.rest.shape[0]):
        a, b = row(work, distances.pairs[index, 0]), row(work, distances.pairs[index, 1])
        # a soft one leaves an error in its length
        soft = distances.compliance[index] + (1 - distances.stiffness[index])
        _mark(a, b, distances.rest[index], soft, marks)
    return _is_marked(marks, FAILED)


@kernel
def _is_marked(marks, quantity):
    marked = False
    for lane in range(LANES):
        marked = marked or marks[quantity + lane] > 0
    return marked


@kernel
def _mark(a, b, rest, compliance, marks):
    real = type(rest)
    one, zero = real(1), real(0)
    tolerated = real(_LENGTH_ERROR if compliance == zero else _STRETCH)
    least, greatest = rest * (one - tolerated), rest * (one + tolerated)
    cosine2 = real(_TURN)
    for lane in range(LANES):
        square, aligned, square_start = zero, zero, zero
        for k in range(DIM):
            now = a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane]
            start = a[START + k * LANES + lane] - b[START + k * LANES + lane]
            square += now * now
            aligned += now * start
            square_start += start * start
        # written so that what is no number has failed too
        in_length = least * least <= square and square <= greatest * greatest
        in_line = aligned >= zero and aligned * aligned >= cosine2 * square * square_start
        marks[FAILED + lane] = marks[FAILED + lane] if in_length and in_line else one


@kernel
def return_to_prediction(work, masses, h):
    """Keep what was found, and go back to where the particles were predicted to be."""
    for particle in range(masses.inverse_mass.shape[0]):
        if masses.inverse_mass[particle] > 0:
            at, mass = row(work, particle), inverse_mass_of(masses, particle)
            for k in range(DIM):
                for lane in range(LANES):
                    at_k = k * LANES + lane
                    at[KEPT + at_k] = at[POSITION + at_k]
                    if not is_grabbed(mass, at, lane):
                        at[POSITION + at_k] = at[START + at_k] + at[VELOCITY + at_k] * h


@kernel
def take_up_kept(work, masses):
    """Return to what was kept in the lanes that have not failed."""
    marks = row(work, work.shape[0] - 2)
    for particle in range(masses.inverse_mass.shape[0]):
        if masses.inverse_mass[particle] > 0:
            at = row(work, particle)
            for k in range(DIM):
                for lane in range(LANES):
                    again, kept = at[POSITION + k * LANES + lane], at[KEPT + k * LANES + lane]
                    at[POSITION + k * LANES + lane] = again if marks[FAILED + lane] > 0 else kept


@kernel
def add_up_speeds(work, masses):
    """Add up the squares of all speeds of each lane."""
    marks = row(work, work.shape[0] - 2)
    for lane in range(LANES):
        marks[SQUARES + lane] = 0
    for particle in range(masses.inverse_mass.shape[0]):
        at = row(work, particle)
        for k in range(DIM):
            _add_squares(marks, at, VELOCITY + k * LANES, np.int64(LANES))


@kernel
def _add_squares(marks, at, quantity, lanes):
    # lanes: see `_read_off` in contact.py
    for lane in range(lanes):
        speed = at[quantity + lane]
        marks[SQUARES + lane] += speed * speed


@kernel
def is_too_fast(work, limit):
    """Mark the lanes in which all speeds together exceed a limit; tell whether there are any."""
    marks = row(work, work.shape[0] - 2)
    for lane in range(LANES):
        # what is no number is too fast too
        marks[TOO_FAST + lane] = 0 if marks[SQUARES + lane] <= limit * limit else 1
    return _is_marked(marks, TOO_FAST)


@kernel
def limit_moves(work, masses, reach):
    """Let no free particle move farther than `reach` in a substep; put back what is no number."""
    one = type(reach)(1)
    for particle in range(masses.inverse_mass.shape[0]):
        if masses.inverse_mass[particle] > 0:
            at, mass = row(work, particle), inverse_mass_of(masses, particle)
            for lane in range(LANES):
                square = reach * 0
                for k in range(DIM):
                    move = at[POSITION + k * LANES + lane] - at[START + k * LANES + lane]
                    square += move * move
                share = one if is_grabbed(mass, at, lane) else _share_within(square, reach)
                for k in range(DIM):
                    now, start = at[POSITION + k * LANES + lane], at[START + k * LANES + lane]
                    limited = start + share * (now - start) if share > 0 else start
                    at[POSITION + k * LANES + lane] = now if share == 1 else limited


@kernel
def limit_velocities(work, masses, speed):
    """Let no free particle be faster than `speed`; stop what is no number."""
    one = type(speed)(1)
    for particle in range(masses.inverse_mass.shape[0]):
        if masses.inverse_mass[particle] > 0:
            at, mass = row(work, particle), inverse_mass_of(masses, particle)
            for lane in range(LANES):
                square = speed * 0
                for k in range(DIM):
                    square += at[VELOCITY + k * LANES + lane] * at[VELOCITY + k * LANES + lane]
                share = one if is_grabbed(mass, at, lane) else _share_within(square, speed)
                for k in range(DIM):
                    now = at[VELOCITY + k * LANES + lane]
                    at[VELOCITY + k * LANES + lane] = share * now if share > 0 else speed * 0


@kernel
def _share_within(square, longest):
    """Return by how much to shorten a vector of a square length; 0 if it is not a number."""
    real = type(longest)
    if square <= longest * longest:
        return real(1)
    return longest / np.sqrt(square) if square < real(np.inf) else real(0)

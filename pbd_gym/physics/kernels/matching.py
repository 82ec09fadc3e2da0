"""Shape matching: the particles of a body are drawn to its rest shape, moved and turned to fit.

Mueller et al. 2005, "Meshless deformations based on shape matching".
"""

from ..compiling import kernel, row
from .forces import SHAPE_MATCHES, force_row, note_move
from .layout import CENTRE, DIM, LANES, MOMENT, POSITION, REST_CENTRE, SUMS, TOTAL
from .masses import in_lane, inverse_mass_of
from .rotation import rotate_2d, rotate_3d

_PIN_WEIGHT = 1000.0  # of a pin, where all free particles of its body together weigh 1


@kernel
def match_shapes(work, masses, matches, inverse_h2, iteration, forces):
    """Draw every particle of a body by the same share to its place in the turned rest shape.

    One share for the whole body: so the corrections add up to no impulse and, as the rotation is
    the best one, to no angular impulse. A pin stays and weighs so much that the body follows it. A
    compliant match is projected in the first iteration only: a second would make it stiffer.
    """
    if matches is None:
        return
    offsets, particles, weight = matches.offsets, matches.particles, matches.weight
    rest, softness = matches.rest, matches.softness
    sums = row(work, work.shape[0] - 3)
    one = work.dtype.type(1)
    for index in range(softness.shape[0]):
        if iteration == 0 or softness[index] == 0:
            first, last = offsets[index], offsets[index + 1]
            _clear(sums)
            for entry in range(first, last):
                i = particles[entry]
                w = inverse_mass_of(masses, i)
                _add_to_centre(row(work, i), w, weight[entry], row(rest, entry), sums)
            _divide(sums)
            for entry in range(first, last):
                i = particles[entry]
                w = inverse_mass_of(masses, i)
                _add_to_moment(row(work, i), w, weight[entry], row(rest, entry), sums)
            if DIM == 2:
                rotate_2d(sums)
            else:
                rotate_3d(sums)
            share = one / (one + softness[index] * inverse_h2)
            for entry in range(first, last):
                i, force = particles[entry], force_row(forces, SHAPE_MATCHES, entry * DIM)
                w = inverse_mass_of(masses, i)
                _move(row(work, i), w, row(rest, entry), sums, share, force)


@kernel
def _clear(sums):
    zero = type(sums[0])(0)
    for lane in range(SUMS):
        sums[lane] = zero


@kernel
def _add_to_centre(at, inverse_mass, weight, rest, sums):
    real = type(weight)
    pin, zero = real(_PIN_WEIGHT), real(0)
    for lane in range(LANES):
        sums[TOTAL + lane] += weight if in_lane(inverse_mass, at, lane) > zero else pin
    for k in range(DIM):
        for lane in range(LANES):
            m = weight if in_lane(inverse_mass, at, lane) > zero else pin
            sums[CENTRE + k * LANES + lane] += m * at[POSITION + k * LANES + lane]
            sums[REST_CENTRE + k * LANES + lane] += m * rest[k]


@kernel
def _divide(sums):
    one = type(sums[0])(1)
    for k in range(DIM):
        for lane in range(LANES):
            inverse = one / sums[TOTAL + lane]
            sums[CENTRE + k * LANES + lane] *= inverse
            sums[REST_CENTRE + k * LANES + lane] *= inverse


@kernel
def _add_to_moment(at, inverse_mass, weight, rest, sums):
    """Add m p q^T. The origin of q may lie anywhere, because the m p add up to zero."""
    real = type(weight)
    pin, zero = real(_PIN_WEIGHT), real(0)
    for i in range(DIM):
        for j in range(DIM):
            for lane in range(LANES):
                m = weight if in_lane(inverse_mass, at, lane) > zero else pin
                p = at[POSITION + i * LANES + lane] - sums[CENTRE + i * LANES + lane]
                sums[MOMENT + (i * DIM + j) * LANES + lane] += m * p * rest[j]


@kernel
def _move(at, inverse_mass, rest, sums, share, force):
    real = type(share)
    zero = real(0)
    for i in range(DIM):
        for lane in range(LANES):
            goal = sums[CENTRE + i * LANES + lane]
            for j in range(DIM):
                q = rest[j] - sums[REST_CENTRE + j * LANES + lane]
                goal += sums[MOMENT + (i * DIM + j) * LANES + lane] * q
            move = share * (goal - at[POSITION + i * LANES + lane])
            w = in_lane(inverse_mass, at, lane)
            at[POSITION + i * LANES + lane] += move if w > zero else zero
            note_move(force, i * LANES + lane, move, w)

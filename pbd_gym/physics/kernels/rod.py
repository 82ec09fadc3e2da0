"""Bending along a row of particles, solved directly: a pentadiagonal system, O(particles).

Joint b between its neighbours a and c has the vector C_b = x_a - 2 x_b + x_c, which is zero where
evenly spaced particles are in line and spacing^2/radius towards the centre where they are on a
circle. It is linear in the positions and couples joints that share particles, joint b and the two
before it:

    (w_a + 4 w_b + w_c + alpha/h^2) s_b - 2 (w_a + w_b) s_a + w_a s_(a - 1) + ... = C_b

The matrix is symmetric and the same along each axis; the system is solved by its LDL^T
factorisation. Particles move by x_a -= w_a s_b, x_b += 2 w_b s_b, x_c -= w_c s_b.

Where the rest is curved, only the component of C_b along a direction n_b is brought to its rest.
The matrix entries of two joints then carry the cosine of their directions.
"""

import numpy as np

from ..compiling import kernel, row
from .forces import RODS, force_row, note
from .layout import COUPLING, DIM, DIRECTION, LANES, MULTIPLIER, PIVOT, POSITION, SCALE
from .masses import in_lane, inverse_mass_of

# In the row of a joint's particle:
NEXT_TO = COUPLING  # entry of L that couples the joint to the one before
BEYOND = SCALE  # entry of L that couples the joint to the last but one
UNKNOWN = DIRECTION  # straight: right-hand side, then the joint's multiplier, per axis


@kernel
def project_rods(work, masses, rods, inverse_h2, forces):
    """Bend every rod towards its rest, all joints at once."""
    if rods is None:
        return
    offsets, curved = rods.offsets, rods.curved
    for rod in range(offsets.shape[0] - 1):
        first, last = offsets[rod] + 1, offsets[rod + 1] - 1
        if curved[rod]:
            _eliminate_curved(work, masses, rods, first, last, inverse_h2)
            _substitute_curved(work, masses, rods.particles, first, last, forces)
        else:
            _eliminate_straight(work, masses, rods, first, last, inverse_h2)
            _substitute_straight(work, masses, rods.particles, first, last, forces)


@kernel
def _eliminate_straight(work, masses, rods, first, last, inverse_h2):
    particles, compliance = rods.particles, rods.compliance
    before = row(work, work.shape[0] - 1)
    beyond = before
    for entry in range(first, last):
        i, j, k = particles[entry - 1], particles[entry], particles[entry + 1]
        joint = row(work, j)
        _eliminate_vector(
            beyond,
            before,
            row(work, i),
            joint,
            row(work, k),
            inverse_mass_of(masses, i),
            inverse_mass_of(masses, j),
            inverse_mass_of(masses, k),
            compliance[entry] * inverse_h2,
        )
        before, beyond = joint, before


@kernel
def _eliminate_vector(beyond, before, a, b, c, mass_a, mass_b, mass_c, alpha):
    """Find the joint's row of L, its pivot and its right-hand side after elimination."""
    real = type(b[0])
    one, two, four, zero = real(1), real(2), real(4), real(0)
    for lane in range(LANES):
        w_a, w_b = in_lane(mass_a, a, lane), in_lane(mass_b, b, lane)
        w_c = in_lane(mass_c, c, lane)
        next_to = -two * (w_a + w_b) - w_a * before[NEXT_TO + lane]
        factor = next_to * before[PIVOT + lane]
        far = w_a * beyond[PIVOT + lane]
        pivot = w_a + four * w_b + w_c + alpha - factor * next_to - far * w_a
        b[PIVOT + lane] = one / pivot if pivot > zero else zero
        b[NEXT_TO + lane] = factor
        b[BEYOND + lane] = far
        for k in range(DIM):
            at, unknown = POSITION + k * LANES + lane, UNKNOWN + k * LANES + lane
            known = factor * before[unknown] + far * beyond[unknown]
            b[unknown] = a[at] - two * b[at] + c[at] - known


@kernel
def _substitute_straight(work, masses, particles, first, last, forces):
    after = row(work, work.shape[0] - 1)
    beyond = after
    for entry in range(last - 1, first - 1, -1):
        i, j, k = particles[entry - 1], particles[entry], particles[entry + 1]
        joint = row(work, j)
        _substitute_vector(joint, after, beyond)
        _move_by_vector(
            row(work, i),
            joint,
            row(work, k),
            inverse_mass_of(masses, i),
            inverse_mass_of(masses, j),
            inverse_mass_of(masses, k),
            force_row(forces, RODS, entry),
        )
        after, beyond = joint, after


@kernel
def _substitute_vector(b, after, beyond):
    for lane in range(LANES):
        for k in range(DIM):
            at = UNKNOWN + k * LANES + lane
            known = after[NEXT_TO + lane] * after[at] + beyond[BEYOND + lane] * beyond[at]
            b[at] = b[at] * b[PIVOT + lane] - known


@kernel
def _move_by_vector(a, b, c, mass_a, mass_b, mass_c, force):
    real = type(b[0])
    two, zero = real(2), real(0)
    for lane in range(LANES):
        w_a, w_b = in_lane(mass_a, a, lane), in_lane(mass_b, b, lane)
        w_c = in_lane(mass_c, c, lane)
        square = zero
        for k in range(DIM):
            multiplier = b[UNKNOWN + k * LANES + lane]
            a[POSITION + k * LANES + lane] -= w_a * multiplier
            b[POSITION + k * LANES + lane] += two * w_b * multiplier
            c[POSITION + k * LANES + lane] -= w_c * multiplier
            square += multiplier * multiplier
        note(force, lane, np.sqrt(square))


@kernel
def _eliminate_curved(work, masses, rods, first, last, inverse_h2):
    particles, rest, compliance = rods.particles, rods.rest, rods.compliance
    before = row(work, work.shape[0] - 1)
    beyond = before
    for entry in range(first, last):
        i, j, k = particles[entry - 1], particles[entry], particles[entry + 1]
        joint = row(work, j)
        _direct(row(work, i), joint, row(work, k), rest[entry])
        _eliminate_scalar(
            beyond,
            before,
            row(work, i),
            joint,
            row(work, k),
            inverse_mass_of(masses, i),
            inverse_mass_of(masses, j),
            inverse_mass_of(masses, k),
            compliance[entry] * inverse_h2,
        )
        before, beyond = joint, before


@kernel
def _direct(a, b, c, rest):
    """Set the direction n of a joint and the multiplier to n.C - rest.

    In 2D n is upright on the line from a to c, to its left: evenly spaced particles have C along
    it, so that its turning does not change n.C. In 3D n is the direction of C itself.
    """
    real = type(a[0])
    one, two, zero = real(1), real(2), real(0)
    for lane in range(LANES):
        if DIM == 2:
            x, y = POSITION + lane, POSITION + LANES + lane
            b[DIRECTION + lane], b[DIRECTION + LANES + lane] = a[y] - c[y], c[x] - a[x]
        else:
            for k in range(DIM):
                at = POSITION + k * LANES + lane
                b[DIRECTION + k * LANES + lane] = a[at] - two * b[at] + c[at]
        square = zero
        for k in range(DIM):
            square += b[DIRECTION + k * LANES + lane] * b[DIRECTION + k * LANES + lane]
        size = np.sqrt(square)
        inverse = one / size if size > zero else zero
        component = zero
        for k in range(DIM):
            at, n = POSITION + k * LANES + lane, b[DIRECTION + k * LANES + lane] * inverse
            b[DIRECTION + k * LANES + lane] = n
            component += n * (a[at] - two * b[at] + c[at])
        b[MULTIPLIER + lane] = component - rest


@kernel
def _eliminate_scalar(beyond, before, a, b, c, mass_a, mass_b, mass_c, alpha):
    """Find the joint's row of L, its pivot and its right-hand side after elimination."""
    real = type(b[0])
    one, two, four, zero = real(1), real(2), real(4), real(0)
    for lane in range(LANES):
        w_a, w_b = in_lane(mass_a, a, lane), in_lane(mass_b, b, lane)
        w_c = in_lane(mass_c, c, lane)
        cosine, cosine_beyond = zero, zero
        for k in range(DIM):
            n = b[DIRECTION + k * LANES + lane]
            cosine += n * before[DIRECTION + k * LANES + lane]
            cosine_beyond += n * beyond[DIRECTION + k * LANES + lane]
        to_beyond = w_a * cosine_beyond
        next_to = -two * (w_a + w_b) * cosine - to_beyond * before[NEXT_TO + lane]
        factor = next_to * before[PIVOT + lane]
        far = to_beyond * beyond[PIVOT + lane]
        pivot = w_a + four * w_b + w_c + alpha - factor * next_to - far * to_beyond
        b[PIVOT + lane] = one / pivot if pivot > zero else zero
        b[NEXT_TO + lane] = factor
        b[BEYOND + lane] = far
        known = factor * before[MULTIPLIER + lane] + far * beyond[MULTIPLIER + lane]
        b[MULTIPLIER + lane] -= known


@kernel
def _substitute_curved(work, masses, particles, first, last, forces):
    after = row(work, work.shape[0] - 1)
    beyond = after
    for entry in range(last - 1, first - 1, -1):
        i, j, k = particles[entry - 1], particles[entry], particles[entry + 1]
        joint = row(work, j)
        _substitute_scalar(joint, after, beyond)
        _move_by_scalar(
            row(work, i),
            joint,
            row(work, k),
            inverse_mass_of(masses, i),
            inverse_mass_of(masses, j),
            inverse_mass_of(masses, k),
            force_row(forces, RODS, entry),
        )
        after, beyond = joint, after


@kernel
def _substitute_scalar(b, after, beyond):
    for lane in range(LANES):
        known = after[NEXT_TO + lane] * after[MULTIPLIER + lane]
        known += beyond[BEYOND + lane] * beyond[MULTIPLIER + lane]
        b[MULTIPLIER + lane] = b[MULTIPLIER + lane] * b[PIVOT + lane] - known


@kernel
def _move_by_scalar(a, b, c, mass_a, mass_b, mass_c, force):
    real = type(b[0])
    two = real(2)
    for lane in range(LANES):
        w_a, w_b = in_lane(mass_a, a, lane), in_lane(mass_b, b, lane)
        w_c = in_lane(mass_c, c, lane)
        note(force, lane, abs(b[MULTIPLIER + lane]))
        for k in range(DIM):
            move = b[MULTIPLIER + lane] * b[DIRECTION + k * LANES + lane]
            a[POSITION + k * LANES + lane] -= w_a * move
            b[POSITION + k * LANES + lane] += two * w_b * move
            c[POSITION + k * LANES + lane] -= w_c * move

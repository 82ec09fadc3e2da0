"""Bending along a row of particles, solved directly: a pentadiagonal system, O(particles).

Joint b between its neighbours a and c has the vector C_b = x_a - 2 x_b + x_c - r_b. For evenly
spaced particles on a circle the sum of the three is (spacing^2 / radius) towards the centre, which
is what the rest r_b is made of. C is linear in the positions and couples joints that share
particles, joint b and the two before it:

    (w_a + 4 w_b + w_c + alpha/h^2) s_b - 2 (w_a + w_b) s_a + w_a s_(a - 1) + ... = C_b

The matrix is symmetric and the same along each axis; the system is solved by its LDL^T
factorisation. Particles move by x_a -= w_a s_b, x_b += 2 w_b s_b, x_c -= w_c s_b.
"""

import numpy as np

from ..compiling import kernel, row
from .layout import COUPLING, DIM, DIRECTION, LANES, PIVOT, POSITION, SCALE
from .masses import in_lane, inverse_mass_of

# In the row of a joint's particle:
NEXT_TO = COUPLING  # entry of L that couples the joint to the one before
BEYOND = SCALE  # entry of L that couples the joint to the last but one
UNKNOWN = DIRECTION  # right-hand side, then the joint's multiplier, per axis


@kernel
def project_rods(work, masses, rods, inverse_h2):
    """Bend every rod towards its rest, all joints at once."""
    if rods is None:
        return
    offsets, particles = rods.offsets, rods.particles
    rest, compliance = rods.rest, rods.compliance
    zero_row = row(work, work.shape[0] - 1)
    for rod in range(offsets.shape[0] - 1):
        first, last = offsets[rod] + 1, offsets[rod + 1] - 1
        before, beyond = zero_row, zero_row
        for entry in range(first, last):
            i, j, k = particles[entry - 1], particles[entry], particles[entry + 1]
            joint = row(work, j)
            _measure(row(work, i), joint, row(work, k), rest[entry])
            _eliminate(
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
        before, beyond = zero_row, zero_row
        for entry in range(last - 1, first - 1, -1):
            i, j, k = particles[entry - 1], particles[entry], particles[entry + 1]
            joint = row(work, j)
            _back_substitute(joint, before, beyond)
            _move(
                row(work, i),
                joint,
                row(work, k),
                inverse_mass_of(masses, i),
                inverse_mass_of(masses, j),
                inverse_mass_of(masses, k),
            )
            before, beyond = joint, before


@kernel
def _measure(a, b, c, rest):
    """Set the unknowns to C. The rest vector is held fixed while C is brought to zero.

    In 2D it stands upright on the line from a to c, to its left where positive. In 3D it points
    where the vector itself does: a rod without twist has no other direction, its plane is free.
    """
    real = type(a[0])
    one, two, zero = real(1), real(2), real(0)
    if DIM == 2:
        for lane in range(LANES):
            x, y = POSITION + lane, POSITION + LANES + lane
            along, up = c[x] - a[x], c[y] - a[y]
            chord = np.sqrt(along * along + up * up)
            scale = rest / chord if chord > zero else zero
            b[UNKNOWN + lane] = a[x] - two * b[x] + c[x] + scale * up
            b[UNKNOWN + LANES + lane] = a[y] - two * b[y] + c[y] - scale * along
    else:
        for lane in range(LANES):
            square = zero
            for k in range(DIM):
                at = POSITION + k * LANES + lane
                vector = a[at] - two * b[at] + c[at]
                square += vector * vector
            size = np.sqrt(square)
            share = one - rest / size if size > zero else zero
            for k in range(DIM):
                at = POSITION + k * LANES + lane
                b[UNKNOWN + k * LANES + lane] = share * (a[at] - two * b[at] + c[at])


@kernel
def _eliminate(beyond, before, a, b, c, mass_a, mass_b, mass_c, alpha):
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
            at = UNKNOWN + k * LANES + lane
            b[at] -= factor * before[at] + far * beyond[at]


@kernel
def _back_substitute(b, after, beyond):
    for lane in range(LANES):
        for k in range(DIM):
            at = UNKNOWN + k * LANES + lane
            known = after[NEXT_TO + lane] * after[at] + beyond[BEYOND + lane] * beyond[at]
            b[at] = b[at] * b[PIVOT + lane] - known


@kernel
def _move(a, b, c, mass_a, mass_b, mass_c):
    real = type(b[0])
    two = real(2)
    for lane in range(LANES):
        w_a, w_b = in_lane(mass_a, a, lane), in_lane(mass_b, b, lane)
        w_c = in_lane(mass_c, c, lane)
        for k in range(DIM):
            multiplier = b[UNKNOWN + k * LANES + lane]
            a[POSITION + k * LANES + lane] -= w_a * multiplier
            b[POSITION + k * LANES + lane] += two * w_b * multiplier
            c[POSITION + k * LANES + lane] -= w_c * multiplier

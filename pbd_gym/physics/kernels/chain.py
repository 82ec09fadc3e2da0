"""Chains of links solved directly: a tridiagonal system in the links' multipliers, O(links).

Link i holds particle i to particle i + 1 with C_i = |x_i - x_(i+1)| - rest_i. Its gradients are
+n_i and -n_i, neighbouring links share one particle, so the system of Newton's method is

    (w_i + w_(i+1) + alpha_i/h^2) s_i - w_i (n_i.n_(i-1)) s_(i-1) - w_(i+1) (n_i.n_(i+1)) s_(i+1) =
    C_i

and the particles move by x_i -= w_i n_i s_i, x_(i+1) += w_(i+1) n_i s_i (Mueller et al. 2007, eq.
8-11, but for all links of the chain at once instead of one after another).
"""

import numpy as np

from ..compiling import apart, kernel, row
from .forces import note_chain
from .layout import (
    COUPLING,
    DIM,
    DIRECTION,
    LANES,
    MULTIPLIER,
    PIVOT,
    POSITION,
    SCALE,
    START,
    VELOCITY,
)
from .masses import in_lane, inverse_mass_of

# A pivot below this share of the diagonal means that the links fight over a taut line between two
# pins; the floor keeps their multipliers finite.
_PIVOT_FLOOR = 1e-5
# Stands for an infinite compliance: the link takes no part.
_FREE = 1e30


@kernel
def project_chains(work, masses, chains, inverse_h2, iteration, forces):
    """Bring the links of every chain to their lengths, along their current directions."""
    offsets, particles = chains.offsets, chains.particles
    rest, compliance = chains.rest, chains.compliance
    zero_row = row(work, work.shape[0] - 1)
    for chain in range(offsets.shape[0] - 1):
        first, last = offsets[chain], offsets[chain + 1] - 1
        before = zero_row
        for entry in range(first, last):
            i, j = particles[entry], particles[entry + 1]
            link = row(work, i)
            _eliminate_current(
                before,
                link,
                row(work, j),
                inverse_mass_of(masses, i),
                inverse_mass_of(masses, j),
                rest[entry],
                _stiffened(compliance, entry, inverse_h2, iteration),
            )
            before = link
        _back_substitute(work, masses, particles, first, last, POSITION)
        note_chain(forces, work, particles, first, last, work.dtype.type(1))


@kernel
def project_chains_from_start(work, masses, chains, inverse_h2, iteration, forces):
    """Bring the links to their lengths along their directions at the substep's start (SHAKE)."""
    offsets, particles = chains.offsets, chains.particles
    rest, compliance = chains.rest, chains.compliance
    zero_row = row(work, work.shape[0] - 1)
    for chain in range(offsets.shape[0] - 1):
        first, last = offsets[chain], offsets[chain + 1] - 1
        before = zero_row
        for entry in range(first, last):
            i, j = particles[entry], particles[entry + 1]
            link = row(work, i)
            _eliminate_start(
                before,
                link,
                row(work, j),
                inverse_mass_of(masses, i),
                inverse_mass_of(masses, j),
                rest[entry],
                _stiffened(compliance, entry, inverse_h2, iteration),
            )
            before = link
        _back_substitute(work, masses, particles, first, last, POSITION)
        note_chain(forces, work, particles, first, last, work.dtype.type(1))


@kernel
def project_chain_velocities(work, masses, chains, h, forces):
    """Remove the velocity along rigid links (the second half of RATTLE)."""
    offsets, particles = chains.offsets, chains.particles
    compliance = chains.compliance
    zero_row = row(work, work.shape[0] - 1)
    free = work.dtype.type(_FREE)
    zero = work.dtype.type(0)
    for chain in range(offsets.shape[0] - 1):
        first, last = offsets[chain], offsets[chain + 1] - 1
        before = zero_row
        for entry in range(first, last):
            i, j = particles[entry], particles[entry + 1]
            link = row(work, i)
            _eliminate_velocity(
                before,
                link,
                row(work, j),
                inverse_mass_of(masses, i),
                inverse_mass_of(masses, j),
                zero if compliance[entry] == zero else free,
            )
            before = link
        _back_substitute(work, masses, particles, first, last, VELOCITY)
        note_chain(forces, work, particles, first, last, h)


@kernel
def _stiffened(compliance, entry, inverse_h2, iteration):
    """Return compliance/h^2; after the first iteration a compliant link keeps its force."""
    if iteration == 0:
        return compliance[entry] * inverse_h2
    if compliance[entry] == 0:
        return compliance[entry]
    return compliance.dtype.type(_FREE)


@apart
def _eliminate_current(before, a, b, mass_a, mass_b, rest, alpha):
    """Eliminate the link before this one; the direction is the current one."""
    real = type(a[0])
    one, zero = real(1), real(0)
    floor = real(_PIVOT_FLOOR)
    for lane in range(LANES):
        square = zero
        for k in range(DIM):
            delta = a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane]
            square += delta * delta
        length = np.sqrt(square)
        inverse = one / length if length > zero else zero
        error = length - rest
        cosine = zero
        for k in range(DIM):
            delta = a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane]
            cosine += delta * inverse * before[DIRECTION + k * LANES + lane]
            a[DIRECTION + k * LANES + lane] = delta * inverse
        w_a, w_b = in_lane(mass_a, a, lane), in_lane(mass_b, b, lane)
        coupling = -w_a * cosine
        factor = coupling * before[PIVOT + lane]
        diagonal = w_a + w_b + alpha
        pivot = max(diagonal - factor * coupling, floor * diagonal)
        a[COUPLING + lane] = coupling
        a[PIVOT + lane] = one / pivot if pivot > zero else zero
        a[MULTIPLIER + lane] = error - factor * before[MULTIPLIER + lane]


@apart
def _eliminate_start(before, a, b, mass_a, mass_b, rest, alpha):
    """Eliminate the link before this one; the direction is that of the start of the substep.

    C = (|x_a - x_b|^2 - rest^2) / (2 rest) has the gradient (x_a - x_b)/rest: no square root, and
    with corrections along the start direction the system is no longer symmetric.
    """
    real = type(a[0])
    one, zero, half = real(1), real(0), real(0.5)
    floor = real(_PIVOT_FLOOR)
    inverse = one / rest
    for lane in range(LANES):
        square, own, lower, upper = zero, zero, zero, zero
        for k in range(DIM):
            now = a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane]
            start = a[START + k * LANES + lane] - b[START + k * LANES + lane]
            link_before = before[POSITION + k * LANES + lane] - a[POSITION + k * LANES + lane]
            direction = start * inverse
            square += now * now
            own += now * inverse * direction
            lower += now * inverse * before[DIRECTION + k * LANES + lane]
            upper += link_before * before[SCALE + lane] * direction
            a[DIRECTION + k * LANES + lane] = direction
        a[SCALE + lane] = inverse
        w_a, w_b = in_lane(mass_a, a, lane), in_lane(mass_b, b, lane)
        diagonal = (w_a + w_b) * own + alpha
        factor = -w_a * lower * before[PIVOT + lane]
        coupling = -w_a * upper
        pivot = max(diagonal - factor * coupling, floor * diagonal)
        a[COUPLING + lane] = coupling
        a[PIVOT + lane] = one / pivot if pivot > zero else zero
        a[MULTIPLIER + lane] = half * (square * inverse - rest) - factor * before[MULTIPLIER + lane]


@apart
def _eliminate_velocity(before, a, b, mass_a, mass_b, alpha):
    """Eliminate the link before this one; the unknowns are impulses along the links."""
    real = type(a[0])
    one, zero = real(1), real(0)
    floor = real(_PIVOT_FLOOR)
    for lane in range(LANES):
        square, rate = zero, zero
        for k in range(DIM):
            delta = a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane]
            square += delta * delta
            rate += delta * (a[VELOCITY + k * LANES + lane] - b[VELOCITY + k * LANES + lane])
        length = np.sqrt(square)
        inverse = one / length if length > zero else zero
        cosine = zero
        for k in range(DIM):
            delta = a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane]
            cosine += delta * inverse * before[DIRECTION + k * LANES + lane]
            a[DIRECTION + k * LANES + lane] = delta * inverse
        w_a, w_b = in_lane(mass_a, a, lane), in_lane(mass_b, b, lane)
        coupling = -w_a * cosine
        factor = coupling * before[PIVOT + lane]
        diagonal = w_a + w_b + alpha
        pivot = max(diagonal - factor * coupling, floor * diagonal)
        a[COUPLING + lane] = coupling
        a[PIVOT + lane] = one / pivot if pivot > zero else zero
        a[MULTIPLIER + lane] = rate * inverse - factor * before[MULTIPLIER + lane]


@kernel
def _back_substitute(work, masses, particles, first, last, quantity):
    """Find the multipliers from the last link to the first and move the particles by them."""
    after = row(work, work.shape[0] - 1)
    for entry in range(last - 1, first - 1, -1):
        i, j = particles[entry], particles[entry + 1]
        link = row(work, i)
        _apply(
            link,
            row(work, j),
            after,
            inverse_mass_of(masses, i),
            inverse_mass_of(masses, j),
            quantity,
        )
        after = link


@apart
def _apply(a, b, after, mass_a, mass_b, quantity):
    for lane in range(LANES):
        above = after[COUPLING + lane] * after[MULTIPLIER + lane]
        step = (a[MULTIPLIER + lane] - above) * a[PIVOT + lane]
        a[MULTIPLIER + lane] = step
        for k in range(DIM):
            move = step * a[DIRECTION + k * LANES + lane]
            a[quantity + k * LANES + lane] -= in_lane(mass_a, a, lane) * move
            b[quantity + k * LANES + lane] += in_lane(mass_b, b, lane) * move

"""What the threads of a cloth need beyond the chain solve: a strain limit and inner friction."""

import numpy as np

from ..compiling import apart, kernel, row
from .forces import CHAINS, force_row, note
from .layout import DIM, LANES, POSITION, VELOCITY
from .masses import in_lane, inverse_mass_of


@kernel
def limit_strains(work, masses, chains, forces):
    """Shorten links that are stretched beyond their limit, one after another.

    Threads that cross are solved in turn, so the last ones leave an error in the others; where a
    cloth is pulled taut between its pins it would take many turns to vanish.
    """
    offsets, particles = chains.offsets, chains.particles
    greatest = chains.greatest
    count = offsets.shape[0] - 1
    shortened = False
    for turn in range(2 * count):
        # there and back, so that no thread is always the last
        chain = turn if turn < count else 2 * count - 1 - turn
        if turn == count and not shortened:
            return  # nothing has moved: no link is too long on the way back either
        for entry in range(offsets[chain], offsets[chain + 1] - 1):
            i, j = particles[entry], particles[entry + 1]
            a, b, longest = row(work, i), row(work, j), greatest[entry]
            if longest < np.inf and _is_longer(a, b, longest * longest):
                shortened = True
                w_a, w_b = inverse_mass_of(masses, i), inverse_mass_of(masses, j)
                _shorten(a, b, w_a, w_b, longest, force_row(forces, CHAINS, entry))


@apart
def _shorten(a, b, mass_a, mass_b, greatest, force):
    real = type(a[0])
    one, zero = real(1), real(0)
    for lane in range(LANES):
        w_a, w_b = in_lane(mass_a, a, lane), in_lane(mass_b, b, lane)
        total = w_a + w_b
        share = one / total if total > zero else zero
        square = zero
        for k in range(DIM):
            delta = a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane]
            square += delta * delta
        length = np.sqrt(square)
        scale = share * (one - greatest / length) if square > greatest * greatest else zero
        note(force, lane, scale * length)
        for k in range(DIM):
            move = scale * (a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane])
            a[POSITION + k * LANES + lane] -= w_a * move
            b[POSITION + k * LANES + lane] += w_b * move


@apart
def _is_longer(a, b, greatest_square):
    """Tell whether a link is too long in any lane: a quick test, as most links are not."""
    zero, longer = type(greatest_square)(0), False
    for lane in range(LANES):
        square = zero
        for k in range(DIM):
            delta = a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane]
            square += delta * delta
        longer |= square > greatest_square
    return longer


@kernel
def damp_chains(work, masses, chains, h):
    """Draw the velocities of linked particles together, as the inner friction of a thread does.

    Implicit in time, so that no rate is too large. Keeps the momentum; the relative velocities in
    which a cloth trembles decay at the rate, those between distant parts hardly at all.
    """
    offsets, particles, damping = chains.offsets, chains.particles, chains.damping
    one = work.dtype.type(1)
    for chain in range(offsets.shape[0] - 1):
        for entry in range(offsets[chain], offsets[chain + 1] - 1):
            if damping[entry] > 0:
                i, j = particles[entry], particles[entry + 1]
                share = damping[entry] * h / (one + damping[entry] * h)
                _damp(
                    row(work, i),
                    row(work, j),
                    inverse_mass_of(masses, i),
                    inverse_mass_of(masses, j),
                    share,
                )


@apart
def _damp(a, b, mass_a, mass_b, share):
    zero = type(share)(0)
    for lane in range(LANES):
        w_a, w_b = in_lane(mass_a, a, lane), in_lane(mass_b, b, lane)
        total = w_a + w_b
        part = share / total if total > zero else zero
        for k in range(DIM):
            at = VELOCITY + k * LANES + lane
            change = part * (a[at] - b[at])
            a[at] -= w_a * change
            b[at] += w_b * change

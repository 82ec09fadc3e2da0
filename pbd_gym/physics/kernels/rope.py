"""Chains that stay stable under any tension and may be slack: many short links, heavy end masses.

A chain of chain.py corrects links along the directions that they have before the correction. That
is explicit integration of tension: where its waves, of speed sqrt(tension/mass per length), run
further than half a link in a substep, the chain blows up. A rope's projection has three parts, each
linear in the number of links:

1. Tension. The tridiagonal system of chain.py gives the links' multipliers s. A slack rope has the
   conditions s >= 0 and, where s = 0, C <= 0: it is solved twice, see `_choose`.
2. Shape. The multipliers are forces s/rest per length along the links as they will be, so that
       x_i + w_i (s_i/rest_i) (x_i - x_(i+1)) + w_i (s_(i-1)/rest_(i-1)) (x_i - x_(i-1)) =
       predicted x_i
   A tridiagonal system for each axis, diagonally dominant: no tension makes it unstable. It is the
   geometric stiffness of Tournier et al. 2015, without the part along the links.
3. Length, once after all iterations. What hangs from a single pin follows it link by link and has
   its lengths exactly. Of all others, links are corrected as in chain.py.
"""

import numpy as np

from ..compiling import kernel, row
from .chain import _stiffened
from .forces import ROPES, force_row, note
from .layout import COUPLING, DIM, DIRECTION, LANES, MULTIPLIER, PIVOT, POSITION, SCALE
from .masses import in_lane, inverse_mass_of

# Links shorter than this share of their rest are slack at once. Above it they may be short by
# rounding, or because what pulls on them has not been solved yet.
_SLACK_BELOW = 0.9999
_PIVOT_FLOOR = 1e-5  # as in chain.py

# In the row of a link's first particle:
PULLS = SCALE  # 1 where the link may pull, else 0
SHAPE = DIRECTION  # in part 2, the position after elimination
PINS = SCALE  # in part 3, the number of pins up to this particle
LENGTH = MULTIPLIER  # in part 3, the length that the link should have


@kernel
def project_ropes(work, masses, ropes, inverse_h2, iteration, forces):
    """Find every rope's tensions and the shape that it has under them (parts 1 and 2)."""
    if ropes is None:
        return
    offsets, slack = ropes.offsets, ropes.slack
    for rope in range(offsets.shape[0] - 1):
        first, last = offsets[rope], offsets[rope + 1] - 1
        _find_tensions(work, masses, ropes, first, last, slack[rope], inverse_h2, iteration)
        _shape(work, masses, ropes, first, last, inverse_h2, iteration, forces)


@kernel
def finish_ropes(work, masses, ropes, inverse_h2, forces):
    """Bring the links of every rope to their lengths (part 3)."""
    if ropes is None:
        return
    offsets, particles, slack = ropes.offsets, ropes.particles, ropes.slack
    for rope in range(offsets.shape[0] - 1):
        first, last = offsets[rope], offsets[rope + 1] - 1
        _follow_pins(work, masses, ropes, first, last, slack[rope], forces)
        # a second iteration: compliant links keep the force that they have
        _find_tensions(work, masses, ropes, first, last, slack[rope], inverse_h2, 1)
        for entry in range(first, last):
            i, j = particles[entry], particles[entry + 1]
            _pull(
                row(work, i),
                row(work, j),
                inverse_mass_of(masses, i),
                inverse_mass_of(masses, j),
                force_row(forces, ROPES, entry),
            )


@kernel
def _find_tensions(work, masses, ropes, first, last, slack, inverse_h2, iteration):
    particles, rest, compliance = ropes.particles, ropes.rest, ropes.compliance
    for entry in range(first, last):
        _choose(row(work, particles[entry]), row(work, particles[entry + 1]), rest[entry], slack)
    for _ in range(2 if slack else 1):
        before = row(work, work.shape[0] - 1)
        for entry in range(first, last):
            i, j = particles[entry], particles[entry + 1]
            link = row(work, i)
            _eliminate(
                before,
                link,
                row(work, j),
                inverse_mass_of(masses, i),
                inverse_mass_of(masses, j),
                rest[entry],
                _stiffened(compliance, entry, inverse_h2, iteration),
            )
            before = link
        after = row(work, work.shape[0] - 1)
        for entry in range(last - 1, first - 1, -1):
            link = row(work, particles[entry])
            _back_substitute(link, after, slack)
            after = link


@kernel
def _choose(a, b, rest, slack):
    """Say which links may pull: at first all that are not clearly short.

    Where the solution makes one of them push, the link is slack, and the second solution leaves it
    out. Back substitution sets a multiplier that pushes to zero before the next one is computed
    from it (Brennan and Schwartz 1977), so that no link ever pushes. What this choice gets wrong,
    the next iteration or substep sees.
    """
    real = type(a[0])
    one, zero = real(1), real(0)
    least = real(_SLACK_BELOW) * rest
    for lane in range(LANES):
        square = zero
        for k in range(DIM):
            delta = a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane]
            square += delta * delta
        a[PULLS + lane] = zero if slack and square < least * least else one


@kernel
def _eliminate(before, a, b, mass_a, mass_b, rest, alpha):
    """Eliminate the link before this one; a slack link has no direction and couples nothing."""
    real = type(a[0])
    zero = real(0)
    floor = real(_PIVOT_FLOOR)
    for lane in range(LANES):
        square = zero
        for k in range(DIM):
            delta = a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane]
            square += delta * delta
        length = np.sqrt(square)
        pulls = a[PULLS + lane]
        inverse = pulls / length if length > zero else zero
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
        a[PIVOT + lane] = pulls / pivot if pivot > zero else zero
        a[MULTIPLIER + lane] = length - rest - factor * before[MULTIPLIER + lane]


@kernel
def _back_substitute(a, after, slack):
    real = type(a[0])
    one, zero = real(1), real(0)
    for lane in range(LANES):
        above = after[COUPLING + lane] * after[MULTIPLIER + lane]
        multiplier = (a[MULTIPLIER + lane] - above) * a[PIVOT + lane]
        pushes = multiplier <= zero
        a[MULTIPLIER + lane] = zero if slack and pushes else multiplier
        a[PULLS + lane] = zero if slack and pushes else one


@kernel
def _pull(a, b, mass_a, mass_b, force):
    for lane in range(LANES):
        note(force, lane, a[MULTIPLIER + lane])
        for k in range(DIM):
            move = a[MULTIPLIER + lane] * a[DIRECTION + k * LANES + lane]
            a[POSITION + k * LANES + lane] -= in_lane(mass_a, a, lane) * move
            b[POSITION + k * LANES + lane] += in_lane(mass_b, b, lane) * move


@kernel
def _shape(work, masses, ropes, first, last, inverse_h2, iteration, forces):
    particles, rest, compliance = ropes.particles, ropes.rest, ropes.compliance
    before = row(work, work.shape[0] - 1)
    for entry in range(first, last + 1):
        particle = particles[entry]
        at = row(work, particle)
        alpha = _stiffened(compliance, entry, inverse_h2, iteration)
        _eliminate_shape(
            before, at, inverse_mass_of(masses, particle), rest[entry], alpha, entry == last
        )
        before = at
    after = row(work, work.shape[0] - 1)
    for entry in range(last, first - 1, -1):
        at = row(work, particles[entry])
        _substitute_shape(at, after, force_row(forces, ROPES, entry))
        after = at


@kernel
def _eliminate_shape(before, a, mass, rest, alpha, is_last):
    """Eliminate the particle before this one; pushing links are left to part 3."""
    real = type(a[0])
    one, zero = real(1), real(0)
    for lane in range(LANES):
        weight = in_lane(mass, a, lane)
        multiplier = zero if is_last else max(a[MULTIPLIER + lane], zero)
        # stretched by its compliance, the link pulls with the same force over a greater length
        tension = multiplier / (rest + alpha * multiplier)
        a[MULTIPLIER + lane] = tension
        lower = weight * before[MULTIPLIER + lane]
        pivot = one / (one + weight * tension + lower - lower * before[COUPLING + lane])
        a[COUPLING + lane] = weight * tension * pivot
        for k in range(DIM):
            known = a[POSITION + k * LANES + lane] + lower * before[SHAPE + k * LANES + lane]
            a[SHAPE + k * LANES + lane] = known * pivot


@kernel
def _substitute_shape(a, after, force):
    zero = type(a[0])(0)
    for lane in range(LANES):
        square = zero
        for k in range(DIM):
            at = POSITION + k * LANES + lane
            a[at] = a[SHAPE + k * LANES + lane] + a[COUPLING + lane] * after[at]
            square += (a[at] - after[at]) * (a[at] - after[at])
        note(force, lane, a[MULTIPLIER + lane] * np.sqrt(square))


@kernel
def _follow_pins(work, masses, ropes, first, last, slack, forces):
    """Bring links to their lengths one after another, away from the pin if there is one.

    A rope without pins is swept there and back, as its momentum asks for. Between two pins nothing
    can follow.
    """
    particles, rest, compliance = ropes.particles, ropes.rest, ropes.compliance
    before = row(work, work.shape[0] - 1)
    for entry in range(first, last + 1):
        particle = particles[entry]
        at = row(work, particle)
        next_to = row(work, particles[min(entry + 1, last)])
        rigid = compliance[entry] == 0
        _aim(before, at, next_to, inverse_mass_of(masses, particle), rest[entry], rigid)
        before = at
    end = row(work, particles[last])
    for turn in range(2):
        for step in range(last - first):
            entry = first + step if turn == 0 else last - 1 - step
            i, j = particles[entry], particles[entry + 1]
            _follow(
                row(work, i),
                row(work, j),
                end,
                inverse_mass_of(masses, i),
                inverse_mass_of(masses, j),
                slack,
                turn == 0,
                force_row(forces, ROPES, entry),
            )


@kernel
def _aim(before, a, b, mass, rest, rigid):
    """Count the pins up to here and note the length that the link should have."""
    real = type(a[0])
    one, zero = real(1), real(0)
    for lane in range(LANES):
        square = zero
        for k in range(DIM):
            delta = a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane]
            square += delta * delta
        pin = one if in_lane(mass, a, lane) == zero else zero
        a[PINS + lane] = before[PINS + lane] + pin
        a[LENGTH + lane] = rest if rigid else np.sqrt(square)


@kernel
def _follow(a, b, end, mass_a, mass_b, slack, outward, force):
    real = type(a[0])
    one, zero = real(1), real(0)
    for lane in range(LANES):
        w_a, w_b = in_lane(mass_a, a, lane), in_lane(mass_b, b, lane)
        total = w_a + w_b
        one_pin, no_pin = end[PINS + lane] == one, end[PINS + lane] == zero
        behind_pin = a[PINS + lane] > zero
        share_a = one if one_pin and not outward and not behind_pin else zero
        share_b = one if one_pin and outward and behind_pin else zero
        share_a = w_a / total if no_pin else share_a
        share_b = w_b / total if no_pin else share_b
        square = zero
        for k in range(DIM):
            delta = a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane]
            square += delta * delta
        length = np.sqrt(square)
        error = length - a[LENGTH + lane]
        error = max(error, zero) if slack else error
        scale = error / length if length > zero else zero
        note(force, lane, error / total if no_pin else zero)
        for k in range(DIM):
            move = scale * (a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane])
            a[POSITION + k * LANES + lane] -= share_a * move
            b[POSITION + k * LANES + lane] += share_b * move

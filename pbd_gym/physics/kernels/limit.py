"""Distances kept between bounds, one after another: slack ropes, tethers, strain limits."""

import numpy as np

from ..compiling import kernel, row
from .forces import LIMITS, force_row, note
from .layout import DIM, LANES, POSITION
from .masses import in_lane, inverse_mass_of


@kernel
def project_limits(work, masses, limits, inverse_h2, iteration, forces):
    """Bring every distance that has left its bounds back to the nearer one.

    It is C = |x_a - x_b| - greatest <= 0 and least - |x_a - x_b| <= 0 (Mueller et al. 2007, 3.3:
    inequality constraints are projected only where they are violated).
    """
    if limits is None:
        return
    pairs, compliance = limits.pairs, limits.compliance
    least, greatest = limits.least, limits.greatest
    for index in range(least.shape[0]):
        i, j = pairs[index, 0], pairs[index, 1]
        alpha = compliance[index]
        if iteration == 0 or alpha == 0:
            _limit(
                row(work, i),
                row(work, j),
                inverse_mass_of(masses, i),
                inverse_mass_of(masses, j),
                least[index],
                greatest[index],
                alpha * inverse_h2,
                force_row(forces, LIMITS, index),
            )


@kernel
def _limit(a, b, mass_a, mass_b, least, greatest, alpha, force):
    real = type(a[0])
    one, zero = real(1), real(0)
    for lane in range(LANES):
        w_a, w_b = in_lane(mass_a, a, lane), in_lane(mass_b, b, lane)
        total = w_a + w_b + alpha
        share = one / total if total > zero else zero
        square = zero
        for k in range(DIM):
            delta = a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane]
            square += delta * delta
        length = np.sqrt(square)
        # no calls of max and min: see `_note` in forces.py
        over, under = length - greatest, length - least
        error = (over if over > zero else zero) + (under if under < zero else zero)
        scale = share * error / length if length > zero else zero
        note(force, lane, scale * length)
        for k in range(DIM):
            move = scale * (a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane])
            a[POSITION + k * LANES + lane] -= w_a * move
            b[POSITION + k * LANES + lane] += w_b * move

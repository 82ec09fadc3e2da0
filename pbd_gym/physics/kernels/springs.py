"""The energy that links and bends release in a control step: C^2/(2 alpha) before less that after.

What is too stiff for the substep to resolve its swing is as good as rigid, and its error is none of
the energy that went in.

Points are read from rows of two layouts: particle i has its axes at i, first + k step.
"""

import numpy as np

from ..compiling import kernel
from .layout import DIM, LANES, POSITION


@kernel
def released_by_springs(x, world, lane, work, model, timing):
    """Return by how much the elastic energy of links and bends fell in a lane [J].

    x: Positions at the start of the control step; those at its end are in the scratch rows.
    """
    masses, inverse_h2 = model.particles.inverse_mass, timing.inverse_h2
    before, after, lane = x[world], work, POSITION + lane
    released = _of_rows(before, after, lane, masses, model.chains, None, inverse_h2)
    released += _of_ropes(before, after, lane, masses, model.ropes, inverse_h2)
    released += _of_distances(before, after, lane, masses, model.distances, inverse_h2)
    released += _of_limits(before, after, lane, masses, model.limits, inverse_h2)
    released += _of_bends(before, after, lane, masses, model.bends, inverse_h2)
    return released + _of_rods(before, after, lane, masses, model.rods, inverse_h2)


@kernel
def _of_ropes(before, after, first, masses, ropes, inverse_h2):
    if ropes is None:
        return inverse_h2 * 0
    return _of_rows(before, after, first, masses, ropes, ropes.slack, inverse_h2)


@kernel
def _of_rows(before, after, first, masses, rows, slack, inverse_h2):
    """Of chains or ropes; slack: which of them do not push, None if all do."""
    released = inverse_h2 * 0
    for index in range(rows.offsets.shape[0] - 1):
        for entry in range(rows.offsets[index], rows.offsets[index + 1] - 1):
            i, j = rows.particles[entry], rows.particles[entry + 1]
            rest, compliance = rows.rest[entry], rows.compliance[entry]
            least = rest
            if slack is not None:
                least = rest if slack[index] == 0 else inverse_h2 * 0
            if compliance * inverse_h2 >= masses[i] + masses[j]:
                released += _of_link(before, after, first, i, j, least, rest, compliance)
    return released


@kernel
def _of_distances(before, after, first, masses, distances, inverse_h2):
    released = inverse_h2 * 0
    one = type(inverse_h2)(1)
    for index in range(distances.rest.shape[0]):
        i, j = distances.pairs[index, 0], distances.pairs[index, 1]
        share, compliance = distances.stiffness[index], distances.compliance[index]
        rest, weights = distances.rest[index], masses[i] + masses[j]
        if share < one:
            # what the seed's stiffness is at this substep
            compliance += weights * (one - share) / (share * inverse_h2)
        if share < one or compliance * inverse_h2 >= weights:
            released += _of_link(before, after, first, i, j, rest, rest, compliance)
    return released


@kernel
def _of_limits(before, after, first, masses, limits, inverse_h2):
    released = inverse_h2 * 0
    if limits is None:
        return released
    for index in range(limits.least.shape[0]):
        i, j = limits.pairs[index, 0], limits.pairs[index, 1]
        least, greatest = limits.least[index], limits.greatest[index]
        compliance = limits.compliance[index]
        if compliance * inverse_h2 >= masses[i] + masses[j]:
            released += _of_link(before, after, first, i, j, least, greatest, compliance)
    return released


@kernel
def _of_bends(before, after, first, masses, bends, inverse_h2):
    released = inverse_h2 * 0
    for index in range(bends.triples.shape[0]):
        a, b, c = bends.triples[index, 0], bends.triples[index, 1], bends.triples[index, 2]
        compliance = bends.compliance[index]
        if _swings(masses, a, b, c, compliance * inverse_h2):
            was = _deflection(before, a, b, c, 0, 1, False)
            released += _fall(was, _deflection(after, a, b, c, first, LANES, False), compliance)
    return released


@kernel
def _of_rods(before, after, first, masses, rods, inverse_h2):
    released = inverse_h2 * 0
    if rods is None:
        return released
    for rod in range(rods.offsets.shape[0] - 1):
        is_curved = rods.curved[rod] != 0
        for entry in range(rods.offsets[rod] + 1, rods.offsets[rod + 1] - 1):
            a, b, c = rods.particles[entry - 1], rods.particles[entry], rods.particles[entry + 1]
            rest, compliance = rods.rest[entry], rods.compliance[entry]
            if _swings(masses, a, b, c, compliance * inverse_h2):
                was = _deflection(before, a, b, c, 0, 1, is_curved) - rest
                now = _deflection(after, a, b, c, first, LANES, is_curved) - rest
                released += _fall(was, now, compliance)
    return released


@kernel
def _swings(masses, a, b, c, softness):
    """Tell whether the substep resolves the swing of a joint."""
    return softness >= masses[a] + type(softness)(4) * masses[b] + masses[c]


@kernel
def _of_link(before, after, first, i, j, least, greatest, compliance):
    was = _excess(_length(before, i, j, 0, 1), least, greatest)
    return _fall(was, _excess(_length(after, i, j, first, LANES), least, greatest), compliance)


@kernel
def _fall(was, now, compliance):
    """Return how much energy a C of then and of now leave between them [J]."""
    return type(was)(0.5) * (was * was - now * now) / compliance


@kernel
def _excess(length, least, greatest):
    """Return by how much a length is beyond its bounds."""
    zero = length * 0
    return max(length - greatest, zero) + min(length - least, zero)


@kernel
def _length(points, i, j, first, step):
    square = points[i, first] * 0
    for k in range(DIM):
        delta = points[i, first + k * step] - points[j, first + k * step]
        square += delta * delta
    return np.sqrt(square)


@kernel
def _deflection(points, a, b, c, first, step, is_signed):
    """Return |x_a - 2 x_b + x_c|; in 2D, where asked, negative where the joint turns right."""
    square = points[a, first] * 0
    left, two = square, type(square)(2)
    for k in range(DIM):
        at = first + k * step
        bend = points[a, at] - two * points[b, at] + points[c, at]
        square += bend * bend
        if DIM == 2:
            other = first + (1 - k) * step
            along = points[c, other] - points[a, other]
            left += bend * along if k == 1 else -bend * along
    size = np.sqrt(square)
    return -size if is_signed and left < 0 else size

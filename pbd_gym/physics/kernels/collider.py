"""Solid shapes that particles may not enter, at rest or carried by pins.

For every particle the signed distance to a shape's surface and the outward normal are found. Where
the distance is negative the particle is put back on the surface, with Coulomb friction against the
motion relative to the shape (Macklin et al. 2014, eq. 23-24). The shapes are convex, so
gap(start) >= gap(now) - normal . way tells how deep a particle began the substep: what began inside
is let out at `_PARTING_SPEED` only (Macklin et al. 2019, eq. 10).
"""

import numpy as np

from ..compiling import kernel, row
from .forces import COLLIDERS, CONTACTS, force_row, note_move
from .layout import DIM, GAP, LANES, NORMAL, POSITION, SETTLED, SHARE, START, VELOCITY
from .masses import in_lane, inverse_mass_of

# The kinds of shapes; a sphere is a capsule whose ends coincide.
PLANE, BOX, CAPSULE = 0, 1, 2
# Speed at which a particle that is inside a shape is let out [m/s].
_PARTING_SPEED = 1.0


@kernel
def collide_with_shapes(work, masses, colliders, timing, forces):
    """Put every free particle of lanes not yet settled back outside, one shape after another."""
    if colliders is None:
        return
    kinds, pins = colliders.kinds, colliders.pins
    marks = row(work, work.shape[0] - 2)
    for shape in range(kinds.shape[0]):
        kind = kinds[shape]
        first, second = _carrier(work, pins[shape, 0]), _carrier(work, pins[shape, 1])
        start, end = row(colliders.starts, shape), row(colliders.ends, shape)
        axes, size = row(colliders.axes, shape), row(colliders.sizes, shape)
        margin = colliders.margin[shape]
        for particle in range(masses.inverse_mass.shape[0]):
            if masses.inverse_mass[particle] > 0:
                at = row(work, particle)
                if kind == PLANE:
                    _measure_plane(at, first, start, axes, margin)
                elif kind == BOX:
                    _measure_box(at, first, start, axes, size, margin)
                else:
                    _measure_capsule(at, first, second, start, end, size[0] + margin)
                if _count_inside(at) > 0:
                    w = inverse_mass_of(masses, particle)
                    told = (
                        force_row(forces, COLLIDERS, particle * DIM),
                        force_row(forces, CONTACTS, particle),
                    )
                    for lane in range(LANES):
                        inside = at[GAP + lane] < 0 and marks[SETTLED + lane] == 0
                        if inside and in_lane(w, at, lane) > 0:
                            _put_outside(at, first, second, lane, colliders, shape, timing, w, told)


@kernel
def _carrier(work, pin):
    """Return the row of a pin that carries a shape; the row of zeros for a static shape."""
    return row(work, pin if pin >= 0 else work.shape[0] - 1)


@kernel
def _count_inside(at):
    """Count the lanes in which a particle is inside the shape just measured."""
    inside = 0
    for lane in range(LANES):
        inside += 1 if at[GAP + lane] < 0 else 0
    return inside


@kernel
def _measure_plane(at, pin, point, normal, margin):
    """Write the distance n . (x - p) to a plane, and its normal."""
    for lane in range(LANES):
        gap = -margin
        for k in range(DIM):
            here = at[POSITION + k * LANES + lane] - pin[POSITION + k * LANES + lane]
            gap += normal[k] * (here - point[k])
            at[NORMAL + k * LANES + lane] = normal[k]
        at[GAP + lane] = gap
        at[SHARE + lane] = margin * 0


@kernel
def _measure_box(at, pin, centre, axes, half, margin):
    """Write the distance to a box and the normal, which is rounded outside edges and corners.

    With the excess q_a = |local coordinate| - half extent of each axis a, the distance is
    |max(q, 0)| outside and max(q) inside, there along the axis of the nearest face.
    """
    real = type(margin)
    one, zero = real(1), real(0)
    for lane in range(LANES):
        square, greatest, nearest = zero, real(-np.inf), 0
        for a in range(DIM):
            local = _coordinate(at, pin, centre, axes, a, lane)
            excess = abs(local) - half[a]
            square += max(excess, zero) * max(excess, zero)
            nearest = a if excess > greatest else nearest
            greatest = max(excess, greatest)
            at[NORMAL + a * LANES + lane] = zero
        length = np.sqrt(square)
        outside = length > zero
        for a in range(DIM):
            local = _coordinate(at, pin, centre, axes, a, lane)
            sign = one if local >= zero else -one
            inner = one if a == nearest else zero
            weight = sign * (max(abs(local) - half[a], zero) / length if outside else inner)
            for k in range(DIM):
                at[NORMAL + k * LANES + lane] += weight * axes[a * DIM + k]
        at[GAP + lane] = (length if outside else greatest) - margin
        at[SHARE + lane] = zero


@kernel
def _coordinate(at, pin, centre, axes, a, lane):
    """Return a particle's coordinate along axis a of a box, from its centre."""
    local = axes[0] * 0
    for k in range(DIM):
        here = at[POSITION + k * LANES + lane] - pin[POSITION + k * LANES + lane]
        local += axes[a * DIM + k] * (here - centre[k])
    return local


@kernel
def _measure_capsule(at, first, second, start, end, radius):
    """Write the distance to a capsule, the normal, and how far along the nearest point lies.

    On the axis itself every direction across is outward; the coordinate axis most across it is
    taken, the upward one if in doubt.
    """
    real = type(radius)
    one, zero = real(1), real(0)
    for lane in range(LANES):
        along, square, least, across = zero, zero, real(np.inf), 0
        for k in range(DIM):
            a = first[POSITION + k * LANES + lane] + start[k]
            axis = second[POSITION + k * LANES + lane] + end[k] - a
            along += axis * (at[POSITION + k * LANES + lane] - a)
            square += axis * axis
            across = k if abs(axis) <= least else across
            least = min(abs(axis), least)
        share = min(max(along / square, zero), one) if square > zero else zero
        square = zero
        for k in range(DIM):
            a = first[POSITION + k * LANES + lane] + start[k]
            axis = second[POSITION + k * LANES + lane] + end[k] - a
            away = at[POSITION + k * LANES + lane] - a - share * axis
            at[NORMAL + k * LANES + lane] = away
            square += away * away
        length = np.sqrt(square)
        for k in range(DIM):
            fallback = one if k == across else zero
            away = at[NORMAL + k * LANES + lane]
            at[NORMAL + k * LANES + lane] = away / length if length > zero else fallback
        at[GAP + lane] = length - radius
        at[SHARE + lane] = share


@kernel
def _put_outside(at, first, second, lane, colliders, shape, timing, mass, told):
    """Move a particle along the normal to the surface, with friction and restitution.

    The velocity is read off later as (x - x_start)/h, so the start is shifted to where a particle
    would have come from that leaves the surface at the speed that restitution leaves it (Mueller et
    al. 2020, eq. 34).
    """
    real = type(timing.h)
    one, zero = real(1), real(0)
    restitution = colliders.restitution[shape]
    friction, kinetic = colliders.friction[shape], colliders.kinetic_friction[shape]
    approach, way, square = zero, zero, zero
    for k in range(DIM):
        normal = at[NORMAL + k * LANES + lane]
        carried = _carried(at, first, second, k, lane)
        approach -= normal * (at[VELOCITY + k * LANES + lane] - carried / timing.h)
        way += normal * _way(at, carried, k, lane)
    for k in range(DIM):
        carried = _carried(at, first, second, k, lane)
        slide = _way(at, carried, k, lane) - way * at[NORMAL + k * LANES + lane]
        square += slide * slide
    depth, distance = -at[GAP + lane], np.sqrt(square)
    parting = real(_PARTING_SPEED) * timing.h
    push = max(depth - max(depth + way - parting, zero), zero)
    # static: the whole slide is taken back; kinetic: as much as friction can hold
    share = one if distance <= friction * push else kinetic * push / distance
    rebound = restitution * approach * timing.h if approach > timing.rest_speed else zero
    force, pressed = told
    w = in_lane(mass, at, lane)
    note_move(pressed, lane, rebound - way, w)
    for k in range(DIM):
        normal = at[NORMAL + k * LANES + lane]
        carried = _carried(at, first, second, k, lane)
        slide = _way(at, carried, k, lane) - way * normal
        move, shift = push * normal - share * slide, (way + push - rebound) * normal
        at[POSITION + k * LANES + lane] += move
        at[START + k * LANES + lane] += shift
        note_move(force, k * LANES + lane, move - shift, w)


@kernel
def _carried(at, first, second, k, lane):
    """Return how far the pins carried the point of contact within the substep, along axis k [m]."""
    i = k * LANES + lane
    move = first[POSITION + i] - first[START + i]
    other = second[POSITION + i] - second[START + i]
    return move + at[SHARE + lane] * (other - move)


@kernel
def _way(at, carried, k, lane):
    """Return the way of a particle relative to the shape within the substep, along axis k [m]."""
    return at[POSITION + k * LANES + lane] - at[START + k * LANES + lane] - carried

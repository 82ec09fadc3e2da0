"""Collisions of bodies that move: particles keep their distance from the links of others.

An encounter is a particle c and a link from a to b (a = b where there is none: another particle).
With the nearest point p = (1 - t) x_a + t x_b, the constraint is C = |x_c - p| - distance >= 0; its
gradients are n, -(1 - t) n and -t n, so that no collision changes the momentum of what collides.

Encounters that can come about are listed once per control step; contacts are solved in every
substep, world by world, in the order in which they were listed.
"""

import numpy as np

from ..compiling import kernel, row
from .layout import DIM, LANES, POSITION, START, VELOCITY
from .masses import in_lane, inverse_mass_of

# Speed at which what overlaps is let apart [m/s].
_PARTING_SPEED = 0.1
# Speeds may grow within a control step, as light things are hit by heavy ones.
_SPEED_UP = 2.0


@kernel
def list_encounters(work, encounters, listed, timing):
    """List, for every lane, the encounters that can come about within the control step.

    listed: their indices (LANES, capacity), their number (LANES,) and scratch (2, LANES). What
    exceeds the capacity is left out.
    """
    if encounters is None:
        return
    indices, counts, scratch = listed
    travel, beyond = row(scratch, 0), row(scratch, 1)
    _measure_travel(work, encounters.movers, travel, timing.dt, timing.gravity)
    for lane in range(LANES):
        counts[lane] = 0
    for index in range(encounters.reach.shape[0]):
        c = row(work, encounters.particles[index])
        a, b = row(work, encounters.links[index, 0]), row(work, encounters.links[index, 1])
        if _can_meet(c, a, b, encounters.reach[index], travel, beyond):
            for lane in range(LANES):
                if beyond[lane] < 0 and counts[lane] < indices.shape[1]:
                    indices[lane, counts[lane]] = index
                    counts[lane] += 1


@kernel
def _measure_travel(work, movers, travel, dt, gravity):
    """Write by how much two things can approach within a control step, in every lane [m]."""
    real = type(dt)
    for lane in range(LANES):
        travel[lane] = real(0)
    for index in range(movers.shape[0]):
        at = row(work, movers[index])
        for lane in range(LANES):
            square = real(0)
            for k in range(DIM):
                square += at[VELOCITY + k * LANES + lane] * at[VELOCITY + k * LANES + lane]
            travel[lane] = max(travel[lane], square)
    for lane in range(LANES):
        travel[lane] = real(2 * _SPEED_UP) * (np.sqrt(travel[lane]) + gravity * dt) * dt


@kernel
def _can_meet(c, a, b, reach, travel, beyond):
    """Tell whether a particle can come to a link in any lane: where `beyond` [m2] is negative."""
    real = type(reach)
    half, zero, near = real(0.5), real(0), False
    for lane in range(LANES):
        square = zero
        for k in range(DIM):
            at = POSITION + k * LANES + lane
            delta = c[at] - half * (a[at] + b[at])
            square += delta * delta
        beyond[lane] = square - (reach + travel[lane]) * (reach + travel[lane])
        near |= beyond[lane] < zero
    return near


@kernel
def collide_with_others(work, masses, encounters, listed, timing):
    """Push apart what is listed and too close, with friction and restitution.

    What began the substep too close is let apart at `_PARTING_SPEED` only (Macklin et al. 2019, eq.
    10): pushed out at once, it would fly apart at depth/h.
    """
    if encounters is None:
        return
    indices, counts, _ = listed
    for lane in range(LANES):
        for entry in range(counts[lane]):
            index = indices[lane, entry]
            particle = encounters.particles[index]
            first, second = encounters.links[index, 0], encounters.links[index, 1]
            c, a, b = row(work, particle), row(work, first), row(work, second)
            t = _nearest(c, a, b, lane)
            weights = (
                in_lane(inverse_mass_of(masses, particle), c, lane),
                in_lane(inverse_mass_of(masses, first), a, lane) * (1 - t),
                in_lane(inverse_mass_of(masses, second), b, lane) * t,
            )
            total = weights[0] + weights[1] * (1 - t) + weights[2] * t
            square = _square(c, a, b, POSITION, t, lane)
            distance = encounters.distance[index]
            if square < distance * distance and total > 0:
                _push_apart(c, a, b, lane, t, square, weights, total, encounters, index, timing)


@kernel
def _nearest(c, a, b, lane):
    """Return how far along a link the point nearest to a particle lies, in [0, 1]."""
    real = type(c[0])
    one, zero = real(1), real(0)
    along, square = zero, zero
    for k in range(DIM):
        at = POSITION + k * LANES + lane
        link = b[at] - a[at]
        along += link * (c[at] - a[at])
        square += link * link
    return min(max(along / square, zero), one) if square > zero else zero


@kernel
def _apart(c, a, b, quantity, t, k, lane):
    """Return x_c - (1 - t) x_a - t x_b along axis k, of positions, starts or velocities."""
    at = quantity + k * LANES + lane
    return c[at] - (a[at] + t * (b[at] - a[at]))


@kernel
def _square(c, a, b, quantity, t, lane):
    square = t * 0
    for k in range(DIM):
        delta = _apart(c, a, b, quantity, t, k, lane)
        square += delta * delta
    return square


@kernel
def _push_apart(c, a, b, lane, t, square, weights, total, encounters, index, timing):
    """Solve one contact.

    Which side of the link is the particle's is decided by where it came from. Restitution (Mueller
    et al. 2020, eq. 34) shifts the starts, from which velocities are read off; friction takes back
    the sideways motion as far as the push can hold it (Macklin et al. 2014, eq. 23-24).
    """
    real = type(timing.h)
    one, zero = real(1), real(0)
    length, before = np.sqrt(square), np.sqrt(_square(c, a, b, START, t, lane))
    aligned = zero
    for k in range(DIM):
        now = _apart(c, a, b, POSITION, t, k, lane)
        aligned += now * _apart(c, a, b, START, t, k, lane)
    side = -one if aligned < zero else one
    target = min(encounters.distance[index], before + real(_PARTING_SPEED) * timing.h)
    depth = max(target - side * length, zero)
    # what lies on one spot is parted along the last axis
    scale = side / length if length > zero else zero
    approach, way, slide_square = zero, zero, zero
    for k in range(DIM):
        normal = _normal(c, a, b, t, k, lane, scale)
        approach -= normal * _apart(c, a, b, VELOCITY, t, k, lane)
        way += normal * _motion(c, a, b, t, k, lane)
    for k in range(DIM):
        slide = _motion(c, a, b, t, k, lane) - way * _normal(c, a, b, t, k, lane, scale)
        slide_square += slide * slide
    slid, held = np.sqrt(slide_square), encounters.friction[index] * depth
    share = one if slid <= held else held / slid
    bounces = approach > timing.rest_speed and encounters.restitution[index] > zero
    rebound = encounters.restitution[index] * approach * timing.h
    shift = (way + depth - rebound) / total if bounces else zero
    for k in range(DIM):
        normal = _normal(c, a, b, t, k, lane, scale)
        slide = _motion(c, a, b, t, k, lane) - way * normal
        move, start = (depth * normal - share * slide) / total, shift * normal
        _move(c, k, lane, weights[0] * move, weights[0] * start)
        _move(a, k, lane, -weights[1] * move, -weights[1] * start)
        _move(b, k, lane, -weights[2] * move, -weights[2] * start)


@kernel
def _move(at, k, lane, move, start):
    at[POSITION + k * LANES + lane] += move
    at[START + k * LANES + lane] += start


@kernel
def _normal(c, a, b, t, k, lane, scale):
    """Return a component of the unit vector from a link's nearest point to a particle."""
    if scale == 0:
        return scale + 1 if k == DIM - 1 else scale
    return scale * _apart(c, a, b, POSITION, t, k, lane)


@kernel
def _motion(c, a, b, t, k, lane):
    """Return how a particle moved relative to a link within the substep, along axis k [m]."""
    return _apart(c, a, b, POSITION, t, k, lane) - _apart(c, a, b, START, t, k, lane)

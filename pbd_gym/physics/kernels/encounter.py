"""Collisions of bodies that move: particles keep their distance from the links of others.

An encounter is a particle c and a link from a to b (a = b where there is none: another particle).
With the nearest point p = (1 - t) x_a + t x_b, the constraint is C = |x_c - p| - distance >= 0; its
gradients are n, -(1 - t) n and -t n, so that no collision changes the momentum of what collides.

Encounters that can come about are listed once per control step; contacts are solved in every
substep, world by world, in the order in which they were listed.
"""

import numpy as np

from ..compiling import kernel, row
from .forces import ENCOUNTERS, note_contact, note_normal
from .layout import DIM, LANES, NORMAL, POSITION, START, VELOCITY
from .masses import in_lane, inverse_mass_of

# Speed at which what overlaps is let apart [m/s].
_PARTING_SPEED = 1.0
# Speeds may grow within a control step, as light things are hit by heavy ones.
_SPEED_UP = 2.0
# How an encounter touches.
_APART, _RESTS, _BOUNCES = 0, 1, 2


@kernel
def list_encounters(work, encounters, listed, timing):
    """List, for every lane, the encounters that can come about within the control step.

    listed: their indices and how they touch (LANES, capacity, 2), their number (LANES,), speeds at
    which they may part (LANES, capacity) [m/s], and scratch (2, LANES). What exceeds the capacity
    is left out.
    """
    if encounters is None:
        return
    indices, counts, _, scratch = listed
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
                    indices[lane, counts[lane], 0] = index
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
def collide_with_others(work, masses, encounters, listed, timing, sweep, forces):
    """Push apart what is listed and too close, with friction, and note how it touches.

    What began the substep too close is let apart at `_PARTING_SPEED` only (Macklin et al. 2019, eq.
    10): pushed out at once, it would fly apart at depth/h.
    """
    if encounters is None:
        return
    indices, counts, speeds, _ = listed
    parting = work.dtype.type(_PARTING_SPEED) * timing.h
    for lane in range(LANES):
        for entry in range(counts[lane]):
            index = indices[lane, entry, 0]
            if sweep == 0:
                indices[lane, entry, 1] = _APART
            c, a, b = _rows(work, encounters, index)
            t = _nearest(c, a, b, lane)
            weights = _weights(masses, encounters, index, c, a, b, t, lane)
            distance = encounters.distance[index]
            if _length(c, a, b, POSITION, t, lane) < distance and weights[3] > 0:
                before = _length(c, a, b, START, t, lane)
                target = min(distance, before + parting)
                depth = target - _measure(c, a, b, t, lane)
                if indices[lane, entry, 1] == _APART:
                    touch, speed = _meet(c, a, b, lane, t, encounters, index, timing)
                    indices[lane, entry, 1], speeds[lane, entry] = touch, speed
                told = _told(forces, encounters, index, t)
                _push_apart(c, a, b, lane, t, weights, depth, encounters.friction[index], told)


@kernel
def part_from_others(work, masses, encounters, listed, h, forces):
    """Give what touches the velocity at which it parts (Mueller et al. 2020, eq. 34).

    What bounces has that of restitution. What does not may not part faster than it did before it
    was pushed: a heap would hop for ever.
    """
    if encounters is None:
        return
    indices, counts, speeds, _ = listed
    for lane in range(LANES):
        for entry in range(counts[lane]):
            touch = indices[lane, entry, 1]
            if touch == _APART:
                continue
            index, speed = indices[lane, entry, 0], speeds[lane, entry]
            c, a, b = _rows(work, encounters, index)
            t = _nearest(c, a, b, lane)
            weights = _weights(masses, encounters, index, c, a, b, t, lane)
            _measure(c, a, b, t, lane)
            parting = speed * 0
            for k in range(DIM):
                parting += _normal(c, k, lane) * _apart(c, a, b, VELOCITY, t, k, lane)
            if touch == _BOUNCES or parting > speed:
                told, change = _told(forces, encounters, index, t), (speed - parting) / weights[3]
                note_normal(told, lane, change * h)
                for k in range(DIM):
                    change_k = change * _normal(c, k, lane)
                    _move(c, a, b, VELOCITY + k * LANES + lane, weights, change_k)
                    note_contact(told, k * LANES + lane, change_k * h)


@kernel
def _rows(work, encounters, index):
    """Return the rows of the particle and of the link's ends."""
    links = encounters.links
    c = row(work, encounters.particles[index])
    return c, row(work, links[index, 0]), row(work, links[index, 1])


@kernel
def _weights(masses, encounters, index, c, a, b, t, lane):
    """Return by how much an impulse along n moves the three, and how far it parts them."""
    links = encounters.links
    w_c = in_lane(inverse_mass_of(masses, encounters.particles[index]), c, lane)
    w_a = in_lane(inverse_mass_of(masses, links[index, 0]), a, lane) * (1 - t)
    w_b = in_lane(inverse_mass_of(masses, links[index, 1]), b, lane) * t
    return w_c, w_a, w_b, w_c + w_a * (1 - t) + w_b * t


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
def _length(c, a, b, quantity, t, lane):
    square = t * 0
    for k in range(DIM):
        delta = _apart(c, a, b, quantity, t, k, lane)
        square += delta * delta
    return np.sqrt(square)


@kernel
def _measure(c, a, b, t, lane):
    """Return the distance of a particle from a link and write the normal into its row.

    The distance is negative where the particle has passed the link within the substep. What lies on
    one spot is parted the way it came, or along the last axis.
    """
    real = type(c[0])
    one, zero = real(1), real(0)
    now, before = _length(c, a, b, POSITION, t, lane), _length(c, a, b, START, t, lane)
    aligned = zero
    for k in range(DIM):
        start = _apart(c, a, b, START, t, k, lane)
        aligned += start * _apart(c, a, b, POSITION, t, k, lane)
    side = -one if aligned < zero else one
    for k in range(DIM):
        normal = one if k == DIM - 1 else zero
        if now > zero:
            normal = side * _apart(c, a, b, POSITION, t, k, lane) / now
        elif before > zero:
            normal = _apart(c, a, b, START, t, k, lane) / before
        c[NORMAL + k * LANES + lane] = normal
    return side * now


@kernel
def _normal(c, k, lane):
    """Return what `_measure` has written."""
    return c[NORMAL + k * LANES + lane]


@kernel
def _motion(c, a, b, t, k, lane):
    """Return how a particle moved relative to a link within the substep, along axis k [m]."""
    return _apart(c, a, b, POSITION, t, k, lane) - _apart(c, a, b, START, t, k, lane)


@kernel
def _meet(c, a, b, lane, t, encounters, index, timing):
    """Return whether what meets bounces, and the speed at which it may part."""
    restitution = encounters.restitution[index]
    approach, way = restitution * 0, restitution * 0
    for k in range(DIM):
        approach -= _normal(c, k, lane) * _apart(c, a, b, VELOCITY, t, k, lane)
        way += _normal(c, k, lane) * _motion(c, a, b, t, k, lane)
    if approach > timing.rest_speed and restitution > 0:
        return _BOUNCES, restitution * approach
    return _RESTS, max(way, restitution * 0) / timing.h


@kernel
def _push_apart(c, a, b, lane, t, weights, depth, friction, told):
    """Part a particle and a link by a depth [m].

    Friction takes back the sideways motion as far as the push can hold it (Macklin et al. 2014, eq.
    23-24).
    """
    push = max(depth, depth * 0)
    way, square = depth * 0, depth * 0
    for k in range(DIM):
        way += _normal(c, k, lane) * _motion(c, a, b, t, k, lane)
    for k in range(DIM):
        slide = _motion(c, a, b, t, k, lane) - way * _normal(c, k, lane)
        square += slide * slide
    slid, held = np.sqrt(square), friction * push
    share = held / slid if slid > held else push * 0 + 1
    note_normal(told, lane, push / weights[3])
    for k in range(DIM):
        slide = _motion(c, a, b, t, k, lane) - way * _normal(c, k, lane)
        move = (push * _normal(c, k, lane) - share * slide) / weights[3]
        _move(c, a, b, POSITION + k * LANES + lane, weights, move)
        note_contact(told, k * LANES + lane, move)


@kernel
def _move(c, a, b, at, weights, move):
    """Move the particle one way and the link the other, so that the momentum is kept."""
    c[at] += weights[0] * move
    a[at] -= weights[1] * move
    b[at] -= weights[2] * move


@kernel
def _told(forces, encounters, index, t):
    """Return where the forces of an encounter are noted, None if nobody asks."""
    if forces is None:
        return None
    real, links = type(encounters.distance[index]), encounters.links
    corners = encounters.particles[index], links[index, 0], links[index, 1]
    return forces, ENCOUNTERS, corners, (real(1), real(t - 1), real(-t))

"""Collisions of bodies that move: particles keep their distance from the links of others.

An encounter is a particle c and a link from a to b (a = b where there is none: another particle).
With the nearest point p = (1 - t) x_a + t x_b, the constraint is C = |x_c - p| - distance >= 0; its
gradients are n, -(1 - t) n and -t n, so that no collision changes the momentum of what collides.

Contacts are solved in every substep, world by world, there and back through the list of those that
can come about in it, until that moves nothing. Two balls on the ground show why: friction takes
back how the upper one slides, moving both by half; the ground takes back the lower one's half, and
the upper one has slid by the other. Each sweep leaves half of that.
"""

import numpy as np

from ..compiling import kernel, row
from .forces import ENCOUNTERS, note_contact, note_normal
from .layout import DIM, LANES, NORMAL, POSITION, SETTLED, START, VELOCITY
from .masses import in_lane, inverse_mass_of

# Speed at which what overlaps is let apart [m/s].
_PARTING_SPEED = 1.0
# Share of g h^2 by which a sweep may still move what is settled.
_STILL = 1e-3
# What is known of a contact stands together, or sweeps would wait for the memory: in one row the
# distance to keep, the friction, the sum of what it has pushed in the substep, the speed at which
# it may part and the sum of its friction; in the other its encounter, its three particles and how
# it touches. Of that other row the first number lists what can come about in the control step.
DISTANCE, FRICTION, PUSH, SPEED, RUB = 0, 1, 2, 3, 4
LISTED, ENCOUNTER, PARTICLE, FIRST, SECOND, TOUCH = 0, 1, 2, 3, 4, 5
# How an encounter touches.
_APART, _RESTS, _BOUNCES = 0, 1, 2


@kernel
def collide_with_others(work, masses, encounters, listed, timing, sweep, forces):
    """Sweep over what is near; return whether there is a lane to sweep again.

    A lane is settled, and left alone, when nothing touches or when a sweep has moved nothing by
    more than a small share of what gravity moves in a substep: what is left of it in every substep
    is the speed at which a stack creeps.
    """
    if encounters is None:
        return False
    marks = row(work, work.shape[0] - 2)
    still = work.dtype.type(_STILL) * timing.gravity * timing.h * timing.h
    unsettled = False
    for lane in range(LANES):
        if sweep == 0:
            marks[SETTLED + lane] = 0
            _list_near(work, encounters, listed, timing, lane)
        if marks[SETTLED + lane] == 0:
            touches, greatest = _sweep(
                work, masses, encounters, listed, timing, sweep, lane, forces
            )
            if not touches or (sweep > 0 and greatest <= still):
                marks[SETTLED + lane] = 1
            else:
                unsettled = True
    return unsettled


@kernel
def unsettle(work, encounters):
    """Forget which lanes are settled."""
    if encounters is None:
        return
    marks = row(work, work.shape[0] - 2)
    for lane in range(LANES):
        marks[SETTLED + lane] = 0


@kernel
def _list_near(work, encounters, listed, timing, lane):
    """Of what can come about in the control step, list what can in this substep; none touches."""
    indices, counts, contacts, scratch = listed
    travel = scratch[0, lane] * timing.h / timing.dt
    near = 0
    for entry in range(counts[0, lane]):
        index = indices[lane, entry, LISTED]
        particle, links = encounters.particles[index], encounters.links
        c, a, b = row(work, particle), row(work, links[index, 0]), row(work, links[index, 1])
        reach = encounters.distance[index] + travel
        if _square(c, a, b, POSITION, _nearest(c, a, b, lane), lane) < reach * reach:
            indices[lane, near, ENCOUNTER] = index
            indices[lane, near, PARTICLE] = particle
            indices[lane, near, FIRST] = links[index, 0]
            indices[lane, near, SECOND] = links[index, 1]
            indices[lane, near, TOUCH] = _APART
            contact = row(contacts, lane * indices.shape[1] + near)
            contact[DISTANCE] = encounters.distance[index]
            contact[FRICTION] = encounters.friction[index]
            for k in range(PUSH, RUB + DIM):
                contact[k] = travel * 0
            near += 1
    counts[1, lane] = near


@kernel
def _sweep(work, masses, encounters, listed, timing, sweep, lane, forces):
    """Solve each contact of a lane; return whether there are any, and the greatest move [m].

    What began the substep too close is let apart at `_PARTING_SPEED` only (Macklin et al. 2019, eq.
    10): pushed out at once, it would fly apart at depth/h.
    """
    indices, counts, contacts, _ = listed
    real = work.dtype.type
    zero, parting = real(0), real(_PARTING_SPEED) * timing.h
    touches, greatest = False, zero
    for step in range(counts[1, lane]):
        near = step if sweep % 2 == 0 else counts[1, lane] - 1 - step
        contact = row(contacts, lane * indices.shape[1] + near)
        c, a, b = _rows(work, indices, lane, near)
        t = _nearest(c, a, b, lane)
        distance = contact[DISTANCE]
        square = _square(c, a, b, POSITION, t, lane)
        if contact[PUSH] == zero and square >= distance * distance:
            continue
        weights = _weights(masses, indices, near, c, a, b, t, lane)
        if weights[3] > zero:
            before = _square(c, a, b, START, t, lane)
            target = distance
            if before < distance * distance:
                target = min(distance, np.sqrt(before) + parting)
            depth = target - _measure(c, a, b, t, square, before, lane)
            if indices[lane, near, TOUCH] == _APART:
                restitution = encounters.restitution[indices[lane, near, ENCOUNTER]]
                touch, speed = _meet(c, a, b, lane, t, restitution, timing)
                indices[lane, near, TOUCH], contact[SPEED] = touch, speed
            told = _told(forces, indices, lane, near, t)
            move = _push_apart(c, a, b, lane, t, weights, depth, contact, told)
            touches, greatest = True, max(greatest, move)
    return touches, greatest


@kernel
def part_from_others(work, masses, encounters, listed, h, forces):
    """Give what touches the velocity at which it parts (Mueller et al. 2020, eq. 34).

    What bounces has that of restitution. What does not may not part faster than it did before it
    was pushed: a heap would hop for ever.
    """
    if encounters is None:
        return
    indices, counts, contacts, _ = listed
    for lane in range(LANES):
        for near in range(counts[1, lane]):
            touch = indices[lane, near, TOUCH]
            if touch == _APART:
                continue
            speed = row(contacts, lane * indices.shape[1] + near)[SPEED]
            c, a, b = _rows(work, indices, lane, near)
            t = _nearest(c, a, b, lane)
            weights = _weights(masses, indices, near, c, a, b, t, lane)
            square, before = _square(c, a, b, POSITION, t, lane), _square(c, a, b, START, t, lane)
            _measure(c, a, b, t, square, before, lane)
            parting = speed * 0
            for k in range(DIM):
                parting += _normal(c, k, lane) * _apart(c, a, b, VELOCITY, t, k, lane)
            if weights[3] > 0 and (touch == _BOUNCES or parting > speed):
                told, change = _told(forces, indices, lane, near, t), (speed - parting) / weights[3]
                note_normal(told, lane, change * h)
                for k in range(DIM):
                    change_k = change * _normal(c, k, lane)
                    _move(c, a, b, VELOCITY + k * LANES + lane, weights, change_k)
                    note_contact(told, k * LANES + lane, change_k * h)


@kernel
def _rows(work, indices, lane, near):
    """Return the rows of the particle and of the link's ends."""
    c = row(work, indices[lane, near, PARTICLE])
    return c, row(work, indices[lane, near, FIRST]), row(work, indices[lane, near, SECOND])


@kernel
def _weights(masses, indices, near, c, a, b, t, lane):
    """Return by how much an impulse along n moves the three, and how far it parts them."""
    w_c = in_lane(inverse_mass_of(masses, indices[lane, near, PARTICLE]), c, lane)
    w_a = in_lane(inverse_mass_of(masses, indices[lane, near, FIRST]), a, lane) * (1 - t)
    w_b = in_lane(inverse_mass_of(masses, indices[lane, near, SECOND]), b, lane) * t
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
def _square(c, a, b, quantity, t, lane):
    """Return the square of that vector's length."""
    square = t * 0
    for k in range(DIM):
        delta = _apart(c, a, b, quantity, t, k, lane)
        square += delta * delta
    return square


@kernel
def _measure(c, a, b, t, square, before, lane):
    """Return the distance of a particle from a link and write the normal into its row.

    Given are the squares of the distances now and at the start of the substep.

    The distance is negative where the particle has passed the link within the substep. What lies on
    one spot is parted the way it came, or along the last axis.
    """
    real = type(c[0])
    one, zero = real(1), real(0)
    now, aligned = np.sqrt(square), zero
    for k in range(DIM):
        start = _apart(c, a, b, START, t, k, lane)
        aligned += start * _apart(c, a, b, POSITION, t, k, lane)
    side = -one if aligned < zero else one
    inverse = side / now if now > zero else zero
    for k in range(DIM):
        normal = one if k == DIM - 1 else zero
        if now > zero:
            normal = inverse * _apart(c, a, b, POSITION, t, k, lane)
        elif before > zero:
            normal = _apart(c, a, b, START, t, k, lane) / np.sqrt(before)
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
def _meet(c, a, b, lane, t, restitution, timing):
    """Return whether what meets bounces, and the speed at which it may part."""
    approach, way = restitution * 0, restitution * 0
    for k in range(DIM):
        approach -= _normal(c, k, lane) * _apart(c, a, b, VELOCITY, t, k, lane)
        way += _normal(c, k, lane) * _motion(c, a, b, t, k, lane)
    if approach > timing.rest_speed and restitution > 0:
        return _BOUNCES, restitution * approach
    return _RESTS, max(way, restitution * 0) / timing.h


@kernel
def _push_apart(c, a, b, lane, t, weights, depth, contact, told):
    """Part a particle and a link by a depth [m]; return by how much they moved [m].

    The contact keeps the sums of its impulses in the substep. That of its pushes may not pull.
    Friction takes back the sideways motion as far as that sum can hold it (Macklin et al. 2014, eq.
    23-24): held by the little that a later sweep adds to the push, it would let go there, and a
    stack would creep at g h sin(slope)/(2^sweeps - 1).
    """
    zero, one = depth * 0, depth * 0 + 1
    inverse = one / weights[3]
    push = max(contact[PUSH] + depth * inverse, zero)
    way, square, moved = zero, zero, zero
    for k in range(DIM):
        way += _normal(c, k, lane) * _motion(c, a, b, t, k, lane)
    for k in range(DIM):
        rub = _rub(c, a, b, lane, t, inverse, way, contact, k)
        square += rub * rub
    held = contact[FRICTION] * push
    share = held / np.sqrt(square) if square > held * held else one
    note_normal(told, lane, push - contact[PUSH])
    for k in range(DIM):
        rub = share * _rub(c, a, b, lane, t, inverse, way, contact, k)
        move = (push - contact[PUSH]) * _normal(c, k, lane) + rub - contact[RUB + k]
        contact[RUB + k] = rub
        _move(c, a, b, POSITION + k * LANES + lane, weights, move)
        note_contact(told, k * LANES + lane, move)
        moved = max(moved, abs(move) * weights[3])
    contact[PUSH] = push
    return moved


@kernel
def _rub(c, a, b, lane, t, inverse, way, contact, k):
    """Return the impulse of friction that takes back all sideways motion, along axis k [kg m]."""
    slide = _motion(c, a, b, t, k, lane) - way * _normal(c, k, lane)
    return contact[RUB + k] - slide * inverse


@kernel
def _move(c, a, b, at, weights, move):
    """Move the particle one way and the link the other, so that the momentum is kept."""
    c[at] += weights[0] * move
    a[at] -= weights[1] * move
    b[at] -= weights[2] * move


@kernel
def _told(forces, indices, lane, near, t):
    """Return where the forces of a contact are noted, None if nobody asks."""
    if forces is None:
        return None
    real = type(t)
    corners = indices[lane, near, PARTICLE], indices[lane, near, FIRST], indices[lane, near, SECOND]
    return forces, ENCOUNTERS, corners, (real(1), real(t - 1), real(-t))

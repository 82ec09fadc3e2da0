"""Self-collision: particles of one body keep their distance.

Pairs that may meet are found once per control step, see pairs.py. Contacts are solved in every
substep, world by world, in the order in which they were found.
"""

import numpy as np

from ..compiling import kernel, row
from .forces import SELF_COLLISION, note_contact, note_normal
from .layout import DIM, LANES, POSITION, START, VELOCITY
from .masses import in_lane, inverse_mass_of

# Speed at which overlapping particles are let apart [m/s].
_PARTING_SPEED = 0.03
# Force that presses touching particles together, for friction, in units of a particle's weight:
# what pushes them apart is limited, so the solver does not know it.
_PRESSURE = 2.0


@kernel
def _square_distance(a, b, quantity, lane, zero):
    square = zero
    for k in range(DIM):
        delta = a[quantity + k * LANES + lane] - b[quantity + k * LANES + lane]
        square += delta * delta
    return square


@kernel
def collide_with_self(work, masses, collision, found, h, iteration, forces):
    """Push the listed pairs apart to the collision distance, and note which of them have touched.

    A pair that began the substep closer than that is let apart at `_PARTING_SPEED` only (Macklin et
    al. 2019, eq. 10): pushed out at once, it would fly apart at depth/h, and folds that lie through
    each other would never come to rest.
    """
    if collision is None:
        return
    pairs, counts = found[0], found[1]
    zero = work.dtype.type(0)
    distance = collision.distance
    parting = work.dtype.type(_PARTING_SPEED) * h
    for lane in range(LANES):
        for index in range(counts[lane]):
            i, j = pairs[lane, index, 0], pairs[lane, index, 1]
            a, b = row(work, i), row(work, j)
            square = _square_distance(a, b, POSITION, lane, zero)
            w_a = in_lane(inverse_mass_of(masses, i), a, lane)
            w_b = in_lane(inverse_mass_of(masses, j), b, lane)
            total = w_a + w_b
            touches = zero < square < distance * distance and total > zero
            pairs[lane, index, 2] = touches or (iteration > 0 and pairs[lane, index, 2] > 0)
            if touches:
                length = np.sqrt(square)
                before = np.sqrt(_square_distance(a, b, START, lane, zero))
                depth = max(min(distance, before + parting) - length, zero)
                push = depth / (length * total)
                told = _told(forces, i, j, type(h)(1))
                note_normal(told, lane, depth / total)
                for k in range(DIM):
                    move = push * (a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane])
                    a[POSITION + k * LANES + lane] += w_a * move
                    b[POSITION + k * LANES + lane] -= w_b * move
                    note_contact(told, k * LANES + lane, move)


@kernel
def _told(forces, i, j, one):
    """Return where the forces of a pair are noted, None if nobody asks."""
    if forces is None:
        return None
    return forces, SELF_COLLISION, (i, j), (one, -one)


@kernel
def rub_against_self(work, masses, collision, found, h, gravity, forces):
    """Dry friction of touching pairs: take back their relative velocity, as far as can be held.

    It acts on the velocities that all constraints have left: rubbed before, the links would pull
    the pair on, and a heap would creep for seconds.
    """
    if collision is None:
        return
    pairs, counts = found[0], found[1]
    zero, one = work.dtype.type(0), work.dtype.type(1)
    held = collision.friction * work.dtype.type(_PRESSURE) * gravity * h
    for lane in range(LANES):
        for index in range(counts[lane]):
            if pairs[lane, index, 2]:
                i, j = pairs[lane, index, 0], pairs[lane, index, 1]
                a, b = row(work, i), row(work, j)
                speed = np.sqrt(_square_distance(a, b, VELOCITY, lane, zero))
                w_a = in_lane(inverse_mass_of(masses, i), a, lane)
                w_b = in_lane(inverse_mass_of(masses, j), b, lane)
                share = min(held / speed, one) / (w_a + w_b) if speed > zero else zero
                told = _told(forces, i, j, one)
                for k in range(DIM):
                    at = VELOCITY + k * LANES + lane
                    change = share * (a[at] - b[at])
                    a[at] -= w_a * change
                    b[at] += w_b * change
                    note_contact(told, k * LANES + lane, -change * h)

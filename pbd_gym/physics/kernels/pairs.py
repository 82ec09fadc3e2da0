"""Which particles of one body may meet within a control step.

Every particle is compared with boxes around the particles of each block, some in a row, and then
with those in the boxes that it can meet, in vector registers. A grid would not do: its cells differ
from world to world. What is found, and in which order, is what comparing all with all would find.
"""

from ..compiling import kernel, row
from ..parameters import PARTICLES_OF_A_BOX as _BLOCK
from .layout import DIM, LANES, POSITION, VELOCITY

# Particles built closer to each other than this many collision distances are neighbours in the
# body: its own constraints hold them apart.
_NEIGHBOURHOOD = 3.0
# In the row of a block: bounds of its positions, and as far behind them, of its velocities.
_LEAST, _GREATEST, _SPEEDS = 0, DIM * LANES, 2 * DIM * LANES


@kernel
def find_pairs(work, masses, collision, found, timing):
    """List, for every lane, the pairs that can come into contact within the control step.

    found: pairs (LANES, capacity, 3), their number (LANES,), scratch (1, LANES) and boxes (blocks,
    4 DIM LANES). There is room for all pairs of 1024 particles; of more, the pairs that are left
    out are the last ones.
    """
    if collision is None:
        return
    pairs, counts, scratch, boxes = found
    particles, rest, distance = collision.particles, masses.positions, collision.distance
    apart = distance * work.dtype.type(_NEIGHBOURHOOD)
    reach = distance + timing.gravity * timing.dt * timing.dt
    excess = row(scratch, 0)
    for lane in range(LANES):
        counts[lane] = 0
    for block in range(boxes.shape[0]):
        _box(work, particles, block, row(boxes, block))
    for first in range(particles.shape[0]):
        a = row(work, particles[first])
        for block in range((first + 1) // _BLOCK, boxes.shape[0]):
            if _can_meet_box(a, row(boxes, block), reach, timing.dt):
                begin = max(first + 1, block * _BLOCK)
                for second in range(begin, min((block + 1) * _BLOCK, particles.shape[0])):
                    b = row(work, particles[second])
                    if _can_meet(a, b, excess, reach, timing.dt):
                        i, j = particles[first], particles[second]
                        if _far_at_rest(rest, i, j, apart):
                            _list_pair(i, j, excess, pairs, counts)


@kernel
def _box(work, particles, block, box):
    """Write the bounds of a block's positions and velocities, in every lane."""
    begin, end = block * _BLOCK, min((block + 1) * _BLOCK, particles.shape[0])
    for member in range(begin, end):
        at = row(work, particles[member])
        for quantity in range(2):
            source, bounds = quantity * VELOCITY, quantity * _SPEEDS
            _widen(at, box, source, _LEAST + bounds, _GREATEST + bounds, member == begin)


@kernel
def _widen(at, box, source, least, greatest, anew):
    for k in range(DIM * LANES):
        value = at[source + k]
        low, high = box[least + k], box[greatest + k]
        box[least + k] = value if anew or value < low else low
        box[greatest + k] = value if anew or value > high else high


@kernel
def _can_meet_box(a, box, reach, dt):
    """Tell whether a particle can meet any of a block in any lane.

    The same sums as in `_can_meet`, of differences that are no larger in space and no smaller in
    speed. Rounding keeps the order of numbers, so no pair is missed that would be found there.
    """
    real = type(reach)
    zero, near = real(0), False
    within, spread = real(1.5) * reach * reach, real(3) * dt * dt
    for lane in range(LANES):
        square, travel = zero, zero
        for k in range(DIM):
            at = k * LANES + lane
            below = box[_LEAST + at] - a[POSITION + at]
            above = a[POSITION + at] - box[_GREATEST + at]
            gap = below if below > above else above
            gap = gap if gap > zero else zero
            up = box[_SPEEDS + _GREATEST + at] - a[VELOCITY + at]
            down = a[VELOCITY + at] - box[_SPEEDS + _LEAST + at]
            motion = up if up > down else down
            square += gap * gap
            travel += motion * motion
        near |= square - within - spread * travel < zero
    return near


@kernel
def _can_meet(a, b, excess, reach, dt):
    """Tell whether two particles can meet within dt in any lane: where `excess` [m2] is negative.

    They can where |x_a - x_b| < reach + |v_a - v_b| dt, and (p + q)^2 <= 3/2 p^2 + 3 q^2 saves the
    root; what it adds at rest allows for velocities that change.
    """
    real = type(reach)
    zero, near = real(0), False
    within, spread = real(1.5) * reach * reach, real(3) * dt * dt
    for lane in range(LANES):
        square, travel = zero, zero
        for k in range(DIM):
            at = k * LANES + lane
            delta = a[POSITION + at] - b[POSITION + at]
            motion = a[VELOCITY + at] - b[VELOCITY + at]
            square += delta * delta
            travel += motion * motion
        beyond = square - within - spread * travel
        excess[lane] = beyond
        near |= beyond < zero
    return near


@kernel
def _far_at_rest(rest, i, j, apart):
    """Tell whether two particles were built at least `apart` from each other."""
    square = type(apart)(0)
    for k in range(DIM):
        square += (rest[i, k] - rest[j, k]) * (rest[i, k] - rest[j, k])
    return square >= apart * apart


@kernel
def _list_pair(i, j, excess, pairs, counts):
    """Add a pair to the lists of the lanes in which it can meet."""
    zero = type(excess[0])(0)
    for lane in range(LANES):
        if excess[lane] < zero and counts[lane] < pairs.shape[1]:
            pairs[lane, counts[lane], 0] = i
            pairs[lane, counts[lane], 1] = j
            counts[lane] += 1

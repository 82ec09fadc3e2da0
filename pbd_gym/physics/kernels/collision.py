"""Self-collision: particles of one body keep their distance.

Every world has contacts of its own, so this part runs world by world. Pairs that may meet are
found once per control step with a hashed grid (linear in particles), contacts are solved in every
substep, in the order in which they were found.
"""

import numpy as np

from ..compiling import kernel, row
from .layout import DIM, LANES, POSITION, START, VELOCITY

# Pairs are sought within this many collision distances at most: faster particles would meet
# undetected, but a cloth would rather fill the list with pairs that never touch.
_FARTHEST = 3.0
# Particles built closer to each other than this many collision distances are neighbours in the
# body: its own constraints hold them apart.
_NEIGHBOURHOOD = 3.0
# Speed at which overlapping particles are let apart [m/s].
_PARTING_SPEED = 0.1
_DRAG = 0.1
# Cells beyond this index mean that the world has diverged: it has no contacts any more.
_LAST_CELL = 1e6


@kernel
def find_pairs(work, model, grid, pairs, counts, dt):
    """List, for every lane, the pairs that can come into contact within the control step.

    grid: (4 + DIM, size) integers of scratch; pairs: (LANES, capacity, 2); counts: (LANES,). What exceeds
    the capacity is left out (the capacity is several times what a crumpled cloth needs).
    """
    for lane in range(LANES):
        counts[lane] = 0
        reach = _reach(work, model, lane, dt)
        if _sort_into_cells(work, model, lane, reach, grid):
            counts[lane] = _list_pairs(work, model, lane, reach, grid, pairs[lane])


@kernel
def _reach(work, model, lane, dt):
    """Return the distance within which two particles can meet in dt [m]."""
    particles = model.collision_particles
    fastest = work.dtype.type(0)
    for index in range(particles.shape[0]):
        at = row(work, particles[index])
        square = work.dtype.type(0)
        for k in range(DIM):
            square += at[VELOCITY + k * LANES + lane] * at[VELOCITY + k * LANES + lane]
        fastest = max(fastest, square)
    distance = model.collision_distance[0]
    travel = work.dtype.type(2) * np.sqrt(fastest) * dt
    return distance + min(travel, work.dtype.type(_FARTHEST - 1.0) * distance)


@kernel
def _sort_into_cells(work, model, lane, reach, grid):
    """Counting sort of the particles by hashed cell; False where a position is out of all bounds.

    Rows of grid: 0 first entry of a bucket, 1 sorted particles, 2 bucket of a particle, 3 fill
    marks, 4... cell coordinates of a particle.
    """
    particles = model.collision_particles
    count = particles.shape[0]
    buckets = grid.shape[1] - 1
    limit = work.dtype.type(_LAST_CELL)
    for bucket in range(buckets + 1):
        grid[0, bucket] = 0
    for index in range(count):
        at = row(work, particles[index])
        for k in range(DIM):
            cell = np.floor(at[POSITION + k * LANES + lane] / reach)
            if not abs(cell) < limit:
                return False
            grid[4 + k, index] = np.int64(cell)
        bucket = _bucket(grid, index, 0, buckets)
        grid[2, index] = bucket
        grid[0, bucket + 1] += 1
    for bucket in range(buckets):
        grid[0, bucket + 1] += grid[0, bucket]
        grid[3, bucket] = grid[0, bucket]
    for index in range(count):
        bucket = grid[2, index]
        grid[1, grid[3, bucket]] = index
        grid[3, bucket] += 1
    return True


@kernel
def _bucket(grid, index, neighbour, buckets):
    """Return the bucket of a neighbour (0 is the own cell) of a particle's cell."""
    key = np.int64(0)
    for k in range(DIM):
        key = (key * 73856093) ^ ((grid[4 + k, index] + _offset(neighbour, k)) * 19349663)
    return (key ^ (key >> 17)) & (buckets - 1)


@kernel
def _offset(neighbour, k):
    """Return -1, 0 or 1: neighbour counts through all 3^DIM cells around, starting at the own."""
    for _ in range(k):
        neighbour //= 3
    return (neighbour + 1) % 3 - 1


@kernel
def _list_pairs(work, model, lane, reach, grid, pairs):
    particles = model.collision_particles
    zero = work.dtype.type(0)
    rest, apart = model.positions, model.collision_distance[0] * work.dtype.type(_NEIGHBOURHOOD)
    found = 0
    for index in range(particles.shape[0]):
        particle = particles[index]
        for neighbour in range(3**DIM):
            bucket = _bucket(grid, index, neighbour, grid.shape[1] - 1)
            for entry in range(grid[0, bucket], grid[0, bucket + 1]):
                other = grid[1, entry]
                if (
                    other > index
                    and _in_cell(grid, index, other, neighbour)
                    and _far_at_rest(rest, particle, particles[other], apart)
                ):
                    other_particle = particles[other]
                    a, b = row(work, particle), row(work, other_particle)
                    square = _square_distance(a, b, POSITION, lane, zero)
                    if square < reach * reach and found < pairs.shape[0]:
                        pairs[found, 0] = particle
                        pairs[found, 1] = other_particle
                        found += 1
    return found


@kernel
def _far_at_rest(rest, i, j, apart):
    """Tell whether two particles were built at least `apart` from each other."""
    square = rest[i, 0] * 0
    for k in range(DIM):
        square += (rest[i, k] - rest[j, k]) * (rest[i, k] - rest[j, k])
    return square >= apart * apart


@kernel
def _in_cell(grid, index, other, neighbour):
    """Tell whether the other particle is in this very neighbour cell, not one of equal hash."""
    same = True
    for k in range(DIM):
        same &= grid[4 + k, other] == grid[4 + k, index] + _offset(neighbour, k)
    return same


@kernel
def _square_distance(a, b, quantity, lane, zero):
    square = zero
    for k in range(DIM):
        delta = a[quantity + k * LANES + lane] - b[quantity + k * LANES + lane]
        square += delta * delta
    return square


@kernel
def collide_with_self(work, model, pairs, counts, h):
    """Push the listed pairs apart to the collision distance, with friction between them.

    A pair that began the substep closer than that is let apart at `_PARTING_SPEED` only (Macklin et
    al. 2019, eq. 10): pushed out at once, it would fly apart at depth/h, and folds that lie through
    each other would never come to rest.
    """
    zero = work.dtype.type(0)
    inverse_mass = model.inverse_mass
    distance = model.collision_distance[0]
    friction = model.contact[2]
    parting = work.dtype.type(_PARTING_SPEED) * h
    for lane in range(LANES):
        for index in range(counts[lane]):
            i, j = pairs[lane, index, 0], pairs[lane, index, 1]
            a, b = row(work, i), row(work, j)
            square = _square_distance(a, b, POSITION, lane, zero)
            total = inverse_mass[i] + inverse_mass[j]
            if zero < square < distance * distance and total > zero:
                length = np.sqrt(square)
                before = np.sqrt(_square_distance(a, b, START, lane, zero))
                depth = max(min(distance, before + parting) - length, zero)
                push = depth / (length * total)
                for k in range(DIM):
                    move = push * (a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane])
                    a[POSITION + k * LANES + lane] += inverse_mass[i] * move
                    b[POSITION + k * LANES + lane] -= inverse_mass[j] * move
                _drag(a, b, lane, inverse_mass[i], inverse_mass[j])


@kernel
def _drag(a, b, lane, mass_a, mass_b):
    """Take a share of a touching pair's relative motion of this substep back."""
    share = type(mass_a)(_DRAG) / (mass_a + mass_b)
    for k in range(DIM):
        at = k * LANES + lane
        motion = (a[POSITION + at] - a[START + at]) - (b[POSITION + at] - b[START + at])
        a[POSITION + at] -= mass_a * share * motion
        b[POSITION + at] += mass_b * share * motion

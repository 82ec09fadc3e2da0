"""Walls, and the end of a substep: contact, friction, velocities read off, restitution."""

import numpy as np

from ..compiling import kernel, row
from .forces import CONTACTS, WALLS, force_row, note_move
from .layout import DIM, LANES, MULTIPLIER, POSITION, SETTLED, START, VELOCITY
from .masses import in_lane, inverse_mass_of, is_grabbed


@kernel
def collide_with_walls(work, masses, room, forces):
    """Put every free particle of lanes not yet settled back into the room, with friction."""
    inverse_mass, lower_wall, upper_wall = masses.inverse_mass, room.lower, room.upper
    radius, friction, kinetic = room.radius, room.friction, room.kinetic_friction
    if not _has_walls(lower_wall, upper_wall):
        return
    marks = row(work, work.shape[0] - 2)
    for particle in range(inverse_mass.shape[0]):
        if inverse_mass[particle] > 0:
            at, mass = row(work, particle), inverse_mass_of(masses, particle)
            force = force_row(forces, WALLS, particle * DIM)
            normal = force_row(forces, CONTACTS, particle)
            for axis in range(DIM):
                if lower_wall[axis] > -np.inf or upper_wall[axis] < np.inf:
                    lower, upper = lower_wall[axis] + radius, upper_wall[axis] - radius
                    _stop_at_walls(
                        at, mass, marks, axis, lower, upper, friction, kinetic, force, normal
                    )


@kernel
def _has_walls(lower, upper):
    found = False
    for axis in range(DIM):
        found = found or lower[axis] > -np.inf or upper[axis] < np.inf
    return found


@kernel
def read_velocities(work, masses, room, h, rest_speed, forces):
    """Read the velocities off the positions, v = (x - x_start)/h; at a wall, with restitution.

    rest_speed [m/s]: slower impacts do not bounce, else gravity alone would make resting particles
    hop.
    """
    inverse_mass, lower_wall, upper_wall = masses.inverse_mass, room.lower, room.upper
    radius, restitution = room.radius, room.restitution
    for particle in range(inverse_mass.shape[0]):
        if inverse_mass[particle] > 0:
            at, mass = row(work, particle), inverse_mass_of(masses, particle)
            force = force_row(forces, WALLS, particle * DIM)
            normal = force_row(forces, CONTACTS, particle)
            for axis in range(DIM):
                if lower_wall[axis] > -np.inf or upper_wall[axis] < np.inf:
                    lower, upper = lower_wall[axis] + radius, upper_wall[axis] - radius
                    _bounce(at, mass, axis, lower, upper, restitution, rest_speed, h, force, normal)
                else:
                    _read_off(at, mass, axis, h, np.int64(LANES))


@kernel
def _read_off(at, mass, axis, h, lanes):
    # lanes is LANES in a variable: LLVM unrolls so short a loop of known length, lane after lane,
    # before it comes to vectorise
    for lane in range(lanes):
        if not is_grabbed(mass, at, lane):
            k = axis * LANES + lane
            at[VELOCITY + k] = (at[POSITION + k] - at[START + k]) / h


@kernel
def _stop_at_walls(at, mass, marks, axis, lower, upper, friction, kinetic, force, normal):
    """Clamp one coordinate; Coulomb friction holds back the others.

    Macklin et al. 2014, eq. 23-24. In two loops over the lanes: LLVM does not vectorise one that
    writes at an offset known only at run time.
    """
    real = type(friction)
    one, zero = real(1), real(0)
    for lane in range(LANES):
        before = at[POSITION + axis * LANES + lane]
        stays = is_grabbed(mass, at, lane) or marks[SETTLED + lane] > zero
        after = before if stays else min(max(before, lower), upper)
        at[MULTIPLIER + lane] = abs(after - before)
        at[POSITION + axis * LANES + lane] = after
        w = in_lane(mass, at, lane)
        note_move(force, axis * LANES + lane, after - before, w)
        note_move(normal, lane, abs(after - before), w)
    for lane in range(LANES):
        depth = at[MULTIPLIER + lane]
        square = zero
        for k in range(DIM):
            slide = at[POSITION + k * LANES + lane] - at[START + k * LANES + lane]
            square += slide * slide if k != axis else zero
        distance = np.sqrt(square)
        # static: the whole slide is taken back; kinetic: as much as friction can hold
        share = one if distance <= friction * depth else kinetic * depth / distance
        for k in range(DIM):
            slide = at[POSITION + k * LANES + lane] - at[START + k * LANES + lane]
            rub = share * slide if k != axis else zero
            at[POSITION + k * LANES + lane] -= rub
            note_move(force, k * LANES + lane, -rub, in_lane(mass, at, lane))


@kernel
def _bounce(at, mass, axis, lower, upper, restitution, rest_speed, h, force, normal):
    """Read the velocity of one axis; at a wall the restituted one (Mueller et al. 2020, eq. 34).

    The speed before the impact is the predicted one, gravity's kick included. Setting the outward
    velocity instead of reading it off also lets overlapping particles out without a launch. What
    was moved since the contacts is put back behind the wall.
    """
    zero = type(restitution)(0)
    for lane in range(LANES):
        if is_grabbed(mass, at, lane):
            continue
        before = at[POSITION + axis * LANES + lane]
        position = min(max(before, lower), upper)
        at[POSITION + axis * LANES + lane] = position
        impact = at[VELOCITY + axis * LANES + lane]
        read = (position - at[START + axis * LANES + lane]) / h
        rebound = -restitution * impact if abs(impact) > rest_speed else zero
        at_lower = position <= lower
        at_upper = position >= upper
        speed = max(rebound, zero) if at_lower else read
        speed = min(rebound, zero) if at_upper else speed
        at[VELOCITY + axis * LANES + lane] = speed
        w, push = in_lane(mass, at, lane), position - before + (speed - read) * h
        note_move(force, axis * LANES + lane, push, w)
        note_move(normal, lane, -push if at_upper else push, w)

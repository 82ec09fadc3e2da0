"""Walls, and the end of a substep: contact, friction, velocities read off, restitution."""

import numpy as np

from ..compiling import kernel
from .layout import DIM, LANES, POSITION, START, VELOCITY


@kernel
def read_velocities(work, model, inverse_h):
    """Read the velocities off the moved positions, v = (x - x_start)/h: no walls in this world."""
    for particle in range(model.inverse_mass.shape[0]):
        if model.inverse_mass[particle] > 0:
            row = work[particle]
            for lane in range(DIM * LANES):
                row[VELOCITY + lane] = (row[POSITION + lane] - row[START + lane]) * inverse_h


@kernel
def collide_with_walls(work, model, inverse_h, rest_speed):
    """Put every free particle back into the room and read its velocity off, with restitution.

    rest_speed [m/s]: slower impacts do not bounce, else gravity alone would make resting particles hop.
    """
    restitution = model.contact[1]
    for particle in range(model.inverse_mass.shape[0]):
        if model.inverse_mass[particle] > 0:
            row = work[particle]
            for axis in range(DIM):
                lower = model.lower[axis] + model.contact[0]
                upper = model.upper[axis] - model.contact[0]
                _stop_at_walls(row, axis, lower, upper, model.contact[2])
            for axis in range(DIM):
                lower = model.lower[axis] + model.contact[0]
                upper = model.upper[axis] - model.contact[0]
                _bounce(row, axis, lower, upper, restitution, rest_speed, inverse_h)


@kernel
def _stop_at_walls(row, axis, lower, upper, friction):
    """Clamp one coordinate; Coulomb friction holds back the others (Macklin et al. 2014, eq. 23-24)."""
    one, zero = row.dtype.type(1), row.dtype.type(0)
    for lane in range(LANES):
        before = row[POSITION + axis * LANES + lane]
        after = min(max(before, lower), upper)
        depth = abs(after - before)
        row[POSITION + axis * LANES + lane] = after
        square = zero
        for k in range(DIM):
            slide = row[POSITION + k * LANES + lane] - row[START + k * LANES + lane]
            square += slide * slide if k != axis else zero
        distance = np.sqrt(square)
        held = friction * depth
        # static: the whole slide is taken back; kinetic: as much as friction can hold
        share = min(held / distance, one) if distance > zero else zero
        for k in range(DIM):
            slide = row[POSITION + k * LANES + lane] - row[START + k * LANES + lane]
            row[POSITION + k * LANES + lane] -= share * slide if k != axis else zero


@kernel
def _bounce(row, axis, lower, upper, restitution, rest_speed, inverse_h):
    """Read the velocity of one axis; at a wall it is the restituted one (Mueller et al. 2020, eq. 34).

    The speed before the impact is the predicted one, gravity's kick included. Setting the outward
    velocity instead of reading it off also lets overlapping particles out without a launch.
    """
    zero = row.dtype.type(0)
    for lane in range(LANES):
        position = row[POSITION + axis * LANES + lane]
        impact = row[VELOCITY + axis * LANES + lane]
        speed = (position - row[START + axis * LANES + lane]) * inverse_h
        rebound = -restitution * impact if abs(impact) > rest_speed else zero
        at_lower = position <= lower
        at_upper = position >= upper
        speed = max(rebound, zero) if at_lower else speed
        speed = min(rebound, zero) if at_upper else speed
        row[VELOCITY + axis * LANES + lane] = speed

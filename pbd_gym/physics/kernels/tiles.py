"""A tile: LANES worlds side by side in the scratch rows, and the pins that drive them."""

from ..compiling import kernel, row
from .layout import DIM, LANES, MASS, POSITION, TOO_FAST, VELOCITY


@kernel
def world_of(tile, lane, x, worlds):
    """Return the world of a lane; lanes beyond the last world repeat it and are not stored.

    worlds: Those that are advanced, in the order of the lanes; None for all.
    """
    if worlds is None:
        return min(tile * LANES + lane, x.shape[0] - 1)
    return worlds[min(tile * LANES + lane, worlds.shape[0] - 1)]


@kernel
def lanes_used(tile, x, worlds):
    """Return how many lanes of a tile stand for a world of their own."""
    if worlds is None:
        return min(LANES, x.shape[0] - tile * LANES)
    return min(LANES, worlds.shape[0] - tile * LANES)


@kernel
def load(x, v, tile, worlds, work, masses, grabbed):
    """Copy the worlds of a tile into the scratch rows."""
    for particle in range(x.shape[1]):
        at = row(work, particle)
        for lane in range(LANES):
            world = world_of(tile, lane, x, worlds)
            for k in range(DIM):
                at[POSITION + k * LANES + lane] = x[world, particle, k]
                at[VELOCITY + k * LANES + lane] = v[world, particle, k]
    _load_masses(x, tile, worlds, work, masses.inverse_mass, masses.grabbable, grabbed)


@kernel
def _load_masses(x, tile, worlds, work, inverse_mass, grabbable, grabbed):
    """Write the inverse masses per lane, 0 for what is grabbed; nothing if nothing can be."""
    if grabbable is None:
        return
    for particle in range(x.shape[1]):
        at = row(work, particle)
        for lane in range(LANES):
            at[MASS + lane] = inverse_mass[particle]
    for index in range(grabbable.shape[0]):
        at = row(work, grabbable[index])
        for lane in range(LANES):
            if grabbed[world_of(tile, lane, x, worlds), index]:
                at[MASS + lane] = 0


@kernel
def store(x, v, tile, worlds, work, mark):
    """Copy the scratch rows back into the worlds of a tile, from the lanes that bear a mark."""
    marks = row(work, work.shape[0] - 2)
    for particle in range(x.shape[1]):
        at = row(work, particle)
        for lane in range(lanes_used(tile, x, worlds)):
            if marks[TOO_FAST + lane] == mark:
                world = world_of(tile, lane, x, worlds)
                for k in range(DIM):
                    x[world, particle, k] = at[POSITION + k * LANES + lane]
                    v[world, particle, k] = at[VELOCITY + k * LANES + lane]


@kernel
def aim_pins(x, targets, tile, worlds, work, masses, dt):
    """Give the pins the velocity that brings them to their targets within the control step."""
    pins = masses.pins
    for index in range(pins.shape[0]):
        pin = pins[index]
        for lane in range(LANES):
            world = world_of(tile, lane, x, worlds)
            for k in range(DIM):
                move = targets[world, index, k] - x[world, pin, k]
                work[pin, VELOCITY + k * LANES + lane] = move / dt
    _aim_grabbed(x, targets, tile, worlds, work, masses.grabbable, pins.shape[0], dt)


@kernel
def _aim_grabbed(x, targets, tile, worlds, work, grabbable, pins, dt):
    """Do the same for what is grabbed. Its targets follow those of the pins."""
    if grabbable is None:
        return
    for index in range(grabbable.shape[0]):
        particle = grabbable[index]
        at = row(work, particle)
        for lane in range(LANES):
            world = world_of(tile, lane, x, worlds)
            for k in range(DIM):
                if at[MASS + lane] == 0:
                    move = targets[world, pins + index, k] - x[world, particle, k]
                    at[VELOCITY + k * LANES + lane] = move / dt


@kernel
def move_pins(x, targets, tile, worlds, work, masses, remaining):
    """Interpolate the pins linearly: a jump would bring in energy that grows with substeps^2."""
    pins = masses.pins
    for index in range(pins.shape[0]):
        pin = pins[index]
        for lane in range(LANES):
            world = world_of(tile, lane, x, worlds)
            for k in range(DIM):
                target = targets[world, index, k]
                move = target - x[world, pin, k]
                work[pin, POSITION + k * LANES + lane] = target - move * remaining
    _move_grabbed(x, targets, tile, worlds, work, masses.grabbable, pins.shape[0], remaining)


@kernel
def _move_grabbed(x, targets, tile, worlds, work, grabbable, pins, remaining):
    """Interpolate what is grabbed from where it was at the start of the control step: no snap."""
    if grabbable is None:
        return
    for index in range(grabbable.shape[0]):
        particle = grabbable[index]
        at = row(work, particle)
        for lane in range(LANES):
            world = world_of(tile, lane, x, worlds)
            for k in range(DIM):
                if at[MASS + lane] == 0:
                    target = targets[world, pins + index, k]
                    move = target - x[world, particle, k]
                    at[POSITION + k * LANES + lane] = target - move * remaining

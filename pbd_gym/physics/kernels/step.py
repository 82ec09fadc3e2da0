"""The control step of a tile of worlds: predict, project, read velocity (seed thesis, 5.1)."""

from ..compiling import borrowed, kernel, row
from .chain import (
    limit_strains,
    project_chain_velocities,
    project_chains,
    project_chains_from_start,
)
from .collision import collide_with_self, find_pairs
from .contact import collide_with_walls, read_velocities
from .fallback import (
    has_failed,
    is_too_fast,
    limit_moves,
    limit_velocities,
    return_to_prediction,
    take_up_kept,
)
from .fold import project_folds, project_hinges
from .layout import DIM, LANES, POSITION, START, TOO_FAST, VELOCITY, WIDTH
from .limit import project_limits
from .rod import project_rods
from .rope import finish_ropes, project_ropes
from .sweep import (
    project_bends,
    project_distance_velocities,
    project_distances,
    project_distances_from_start,
)

# Iterations of the first-order solve that replaces a failed one.
_AGAIN = 4

__all__ = ["DIM", "LANES", "WIDTH", "advance"]


@kernel
def advance(x, v, targets, tiles, work, found, model, timing, substeps):
    """Advance the worlds of tiles[0] <= tile < tiles[1] by one control step, in place.

    Args:
        x: Positions (W, N, DIM) [m].
        v: Velocities (W, N, DIM) [m/s].
        targets: Where the pins are at the end of the step, (W, P, DIM) [m].
        tiles: First and last + 1 tile of LANES worlds.
        work: Scratch (N + 1, WIDTH); the last row is zero.
        found: Scratch of self-collision (candidate pairs, their numbers), or None.
        model: The Parameters. A table that is None is known when compiling: each function that
            serves it returns at once, and nothing behind that is compiled.
        timing: The Timing.
        substeps: Number of substeps.
    """
    x, v, targets, work, found, model = borrowed((x, v, targets, work, found, model))
    masses = model.particles
    for tile in range(tiles[0], tiles[1]):
        for attempt in range(2):
            _load(x, v, tile, work)
            _aim_pins(x, targets, tile, work, masses.pins, timing)
            find_pairs(work, masses, model.self_collision, found, timing.dt)
            for substep in range(substeps):
                remaining = x.dtype.type(substeps - 1 - substep) / x.dtype.type(substeps)
                _predict(work, masses, timing, model.second_order)
                _move_pins(x, targets, tile, work, masses.pins, remaining)
                _project(work, model, found, timing, model.iterations, model.second_order)
                _project_again(work, model, found, timing, model.second_order)
                collide_with_walls(work, masses, model.room)
                limit_strains(work, masses, model.chains)
                if attempt > 0:
                    limit_moves(work, masses, timing.speed_limit * timing.h)
                read_velocities(work, masses, model.room, timing.inverse_h, timing.rest_speed)
                _finish(work, model, timing, model.second_order)
                if attempt > 0:
                    limit_velocities(work, masses, timing.speed_limit)
            if attempt == 0:
                failed = is_too_fast(work, masses, timing.speed_limit)
            else:
                # 0 times infinity is no number: pins too are put where they belong
                _aim_pins(x, targets, tile, work, masses.pins, timing)
                _move_pins(x, targets, tile, work, masses.pins, x.dtype.type(0))
            _store(x, v, tile, work, attempt)
            if not failed:
                break


@kernel
def _world(tile, lane, num_worlds):
    """Return the world of a lane; lanes beyond the last world repeat it and are not stored."""
    return min(tile * LANES + lane, num_worlds - 1)


@kernel
def _load(x, v, tile, work):
    for particle in range(x.shape[1]):
        at = row(work, particle)
        for lane in range(LANES):
            world = _world(tile, lane, x.shape[0])
            for k in range(DIM):
                at[POSITION + k * LANES + lane] = x[world, particle, k]
                at[VELOCITY + k * LANES + lane] = v[world, particle, k]


@kernel
def _store(x, v, tile, work, mark):
    """Write the lanes back that bear a mark."""
    marks = row(work, work.shape[0] - 2)
    for particle in range(x.shape[1]):
        at = row(work, particle)
        for lane in range(min(LANES, x.shape[0] - tile * LANES)):
            if marks[TOO_FAST + lane] == mark:
                for k in range(DIM):
                    x[tile * LANES + lane, particle, k] = at[POSITION + k * LANES + lane]
                    v[tile * LANES + lane, particle, k] = at[VELOCITY + k * LANES + lane]


@kernel
def _aim_pins(x, targets, tile, work, pins, timing):
    """Give the pins the velocity that brings them to their targets within the control step."""
    for index in range(pins.shape[0]):
        pin = pins[index]
        for lane in range(LANES):
            world = _world(tile, lane, x.shape[0])
            for k in range(DIM):
                move = targets[world, index, k] - x[world, pin, k]
                work[pin, VELOCITY + k * LANES + lane] = move / timing.dt


@kernel
def _move_pins(x, targets, tile, work, pins, remaining):
    """Interpolate the pins linearly: a jump would bring in energy that grows with substeps^2."""
    for index in range(pins.shape[0]):
        pin = pins[index]
        for lane in range(LANES):
            world = _world(tile, lane, x.shape[0])
            for k in range(DIM):
                target = targets[world, index, k]
                move = target - x[world, pin, k]
                work[pin, POSITION + k * LANES + lane] = target - move * remaining


@kernel
def _predict(work, masses, timing, second_order):
    """Steps 1-3 of the seed: damp, add the acceleration, move. Second order kicks by half here."""
    half = work.dtype.type(0.5)
    h, decay = timing.h, timing.decay
    inverse_mass, gravity = masses.inverse_mass, masses.gravity
    for particle in range(inverse_mass.shape[0]):
        at = row(work, particle)
        free = inverse_mass[particle] > 0
        for k in range(DIM):
            kick = gravity[k] * h
            if second_order is not None:
                kick = kick * half
            for lane in range(k * LANES, (k + 1) * LANES):
                at[START + lane] = at[POSITION + lane]
                if free:
                    # damping before the kick: it must not lighten what hangs at rest
                    at[VELOCITY + lane] = at[VELOCITY + lane] * decay + kick
                    at[POSITION + lane] += at[VELOCITY + lane] * h


@kernel
def _project(work, model, found, timing, iterations, second_order):
    """Step 4: satisfy the constraints. Soft ones first, chains after them, contacts last."""
    masses, inverse_h2 = model.particles, timing.inverse_h2
    for iteration in range(iterations):
        if iteration == 0:
            project_bends(work, masses, model.bends, inverse_h2)
            project_hinges(work, masses, model.hinges, inverse_h2)
            project_folds(work, masses, model.folds, inverse_h2)
            project_rods(work, masses, model.rods, inverse_h2)
            collide_with_self(work, masses, model.self_collision, found, timing.h, timing.gravity)
        if second_order is not None:
            project_distances_from_start(work, masses, model.distances, inverse_h2, iteration)
        else:
            project_distances(work, masses, model.distances, inverse_h2, iteration)
        project_limits(work, masses, model.limits, inverse_h2, iteration)
        if second_order is not None:
            project_chains_from_start(work, masses, model.chains, inverse_h2, iteration)
        else:
            project_chains(work, masses, model.chains, inverse_h2, iteration)
        project_ropes(work, masses, model.ropes, inverse_h2, iteration)
    finish_ropes(work, masses, model.ropes, inverse_h2)


@kernel
def _project_again(work, model, found, timing, second_order):
    """Solve the substep in first order where the second-order solve has failed."""
    if second_order is None:
        return
    if has_failed(work, model.chains, model.distances):
        return_to_prediction(work, model.particles, timing.h)
        _project(work, model, found, timing, max(model.iterations, _AGAIN), None)
        take_up_kept(work, model.particles)


@kernel
def _finish(work, model, timing, second_order):
    """Second order: the other half kick, and no velocity along what is rigid."""
    if second_order is None:
        return
    masses = model.particles
    half = work.dtype.type(0.5)
    inverse_mass, gravity = masses.inverse_mass, masses.gravity
    for particle in range(inverse_mass.shape[0]):
        if inverse_mass[particle] > 0:
            at = row(work, particle)
            for k in range(DIM):
                kick = gravity[k] * timing.h * half
                for lane in range(k * LANES, (k + 1) * LANES):
                    at[VELOCITY + lane] += kick
    project_distance_velocities(work, masses, model.distances)
    project_chain_velocities(work, masses, model.chains)

"""The control step of a tile of worlds: predict, project, read velocity (seed thesis, 5.1)."""

from ..compiling import borrowing, in_place, kernel, row
from ..tickets import are_more, finish, is_done, take
from .attachment import project_attachments
from .chain import project_chain_velocities, project_chains, project_chains_from_start
from .collider import collide_with_shapes
from .collision import collide_with_self, rub_against_self
from .contact import collide_with_walls, read_velocities
from .encounter import collide_with_others, part_from_others, unsettle
from .fallback import (
    add_up_speeds,
    has_failed,
    is_too_fast,
    limit_moves,
    limit_velocities,
    return_to_prediction,
    take_up_kept,
)
from .fold import project_folds, project_hinges
from .forces import forget_forces, keep_forces, store_forces, take_up_kept_forces
from .gain import take_out_gain
from .layout import DIM, LANES, POSITION, START, VELOCITY, WIDTH
from .limit import project_limits
from .masses import inverse_mass_of, is_grabbed
from .matching import match_shapes
from .meeting import list_encounters
from .pairs import find_pairs
from .rod import project_rods
from .rope import finish_ropes, project_ropes
from .sweep import (
    project_bends,
    project_distance_velocities,
    project_distances,
    project_distances_from_start,
)
from .thread import damp_chains, limit_strains
from .tiles import aim_pins, load, move_pins, store
from .volume import project_volumes

# Iterations of the first-order solve that replaces a failed one.
_AGAIN = 4

__all__ = ["DIM", "LANES", "WIDTH", "advance"]


@borrowing
def advance(
    tickets,
    helper,
    x,
    v,
    targets,
    worlds,
    work,
    found,
    listed,
    grabbed,
    forces,
    model,
    timing,
    substeps,
):
    """Advance the worlds of all tiles that this thread gets by one control step, in place.

    Args:
        tickets: Hand out the tiles of LANES worlds.
        helper: Which helper this thread is, -1 if it was asked for the step. A helper looks out for
            more tiles, those of the next step, before it returns.
        x: Positions (W, N, DIM) [m].
        v: Velocities (W, N, DIM) [m/s].
        targets: Where pins and grabbed particles are at the end of the step, (W, P + G, DIM) [m].
        worlds: Those worlds that are advanced, in the order of the lanes, or None for all.
        work: Scratch (N + 3, WIDTH); the last row is zero.
        found: Scratch of self-collision (see `find_pairs`), or None.
        listed: Scratch of encounters (see `list_encounters`), or None.
        grabbed: Which particles are grabbed, (W, G), or None if none can be.
        forces: Scratch for multipliers and where the forces go, or None if nobody asks.
        model: The Parameters. A table that is None is known when compiling: each function that
            serves it returns at once, and nothing behind that is compiled.
        timing: The Timing.
        substeps: Number of substeps.

    Returns:
        Whether all tiles are done.
    """
    while True:
        tile = take(tickets)
        if tile >= 0:
            _advance_tile(
                tile,
                x,
                v,
                targets,
                worlds,
                work,
                found,
                listed,
                grabbed,
                forces,
                model,
                timing,
                substeps,
            )
            finish(tickets)
        elif helper < 0:
            return is_done(tickets)
        elif not are_more(tickets, helper):
            return True


@in_place
def _advance_tile(
    tile, x, v, targets, worlds, work, found, listed, grabbed, forces, model, timing, substeps
):
    """Advance the worlds of a tile by one control step."""
    masses = model.particles
    for attempt in range(2):
        load(x, v, tile, worlds, work, masses, grabbed)
        aim_pins(x, targets, tile, worlds, work, masses, timing.dt)
        find_pairs(work, masses, model.self_collision, found, timing)
        list_encounters(work, model.encounters, listed, timing)
        for substep in range(substeps):
            remaining = x.dtype.type(substeps - 1 - substep) / x.dtype.type(substeps)
            forget_forces(forces)
            _predict(work, masses, timing, model.second_order)
            move_pins(x, targets, tile, worlds, work, masses, remaining)
            _project(work, model, found, timing, model.iterations, model.second_order, forces)
            _project_again(work, model, found, timing, model.second_order, forces)
            _collide_with_others(work, model, model.encounters, listed, timing, forces)
            collide_with_shapes(work, masses, model.colliders, timing, forces)
            collide_with_walls(work, masses, model.room, forces)
            limit_strains(work, masses, model.chains, forces)
            if attempt > 0:
                limit_moves(work, masses, timing.speed_limit * timing.h)
            read_velocities(work, masses, model.room, timing.h, timing.rest_speed, forces)
            _finish(work, model, timing, model.second_order, forces)
            part_from_others(work, masses, model.encounters, listed, timing.h, forces)
            rub_against_self(
                work, masses, model.self_collision, found, timing.h, timing.gravity, forces
            )
            damp_chains(work, masses, model.chains, timing.h)
            if attempt > 0:
                limit_velocities(work, masses, timing.speed_limit)
        if attempt > 0:
            # 0 times infinity is no number: pins too are put where they belong
            aim_pins(x, targets, tile, worlds, work, masses, timing.dt)
            move_pins(x, targets, tile, worlds, work, masses, x.dtype.type(0))
        add_up_speeds(work, masses)
        if attempt == 0:
            failed = is_too_fast(work, timing.speed_limit)
        take_out_gain(x, v, tile, worlds, work, model, timing)
        store(x, v, tile, worlds, work, attempt)
        store_forces(forces, x, tile, worlds, work, timing.inverse_h2, attempt)
        if not failed:
            break


@kernel
def _predict(work, masses, timing, second_order):
    """Steps 1-3 of the seed: damp, add the acceleration, move.

    Damped after the kick, what hangs at rest would be lightened. Second order kicks by half here,
    and has damped in `_finish`, before the other half.
    """
    half, one = work.dtype.type(0.5), work.dtype.type(1)
    h = timing.h
    decay = timing.decay if second_order is None else one
    inverse_mass, gravity = masses.inverse_mass, masses.gravity
    for particle in range(inverse_mass.shape[0]):
        at = row(work, particle)
        free = inverse_mass[particle] > 0
        mass = inverse_mass_of(masses, particle)
        for k in range(DIM):
            kick = gravity[k] * h
            if second_order is not None:
                kick = kick * half
            for lane in range(LANES):
                at_k = k * LANES + lane
                at[START + at_k] = at[POSITION + at_k]
                if free and not is_grabbed(mass, at, lane):
                    at[VELOCITY + at_k] = at[VELOCITY + at_k] * decay + kick
                    at[POSITION + at_k] += at[VELOCITY + at_k] * h


@in_place
def _project(work, model, found, timing, iterations, second_order, forces):
    """Step 4: satisfy the constraints. Soft ones first, chains after them, contacts last."""
    masses, inverse_h2 = model.particles, timing.inverse_h2
    for iteration in range(iterations):
        if iteration == 0:
            project_bends(work, masses, model.bends, inverse_h2, forces)
            project_hinges(work, masses, model.hinges, inverse_h2, forces)
            project_folds(work, masses, model.folds, inverse_h2, forces)
            project_rods(work, masses, model.rods, inverse_h2, forces)
        collide_with_self(work, masses, model.self_collision, found, timing.h, iteration, forces)
        if second_order is not None:
            project_distances_from_start(
                work, masses, model.distances, inverse_h2, iteration, forces
            )
        else:
            project_distances(work, masses, model.distances, inverse_h2, iteration, forces)
        project_limits(work, masses, model.limits, inverse_h2, iteration, forces)
        project_attachments(work, masses, model.attachments, inverse_h2, iteration, forces)
        match_shapes(work, masses, model.shape_matches, inverse_h2, iteration, forces)
        project_volumes(work, masses, model.volumes, inverse_h2, iteration, forces)
        if second_order is not None:
            project_chains_from_start(work, masses, model.chains, inverse_h2, iteration, forces)
        else:
            project_chains(work, masses, model.chains, inverse_h2, iteration, forces)
        project_ropes(work, masses, model.ropes, inverse_h2, iteration, forces)
    finish_ropes(work, masses, model.ropes, inverse_h2, forces)


@in_place
def _project_again(work, model, found, timing, second_order, forces):
    """Solve the substep in first order where the second-order solve has failed."""
    if second_order is None:
        return
    if has_failed(work, model.chains, model.distances):
        return_to_prediction(work, model.particles, timing.h)
        keep_forces(forces)
        _project(work, model, found, timing, max(model.iterations, _AGAIN), None, forces)
        take_up_kept(work, model.particles)
        take_up_kept_forces(forces, work)


@in_place
def _collide_with_others(work, model, encounters, listed, timing, forces):
    """Part what collides and what stands on the ground, in turn, until both are settled."""
    if encounters is None:
        return
    masses = model.particles
    for sweep in range(encounters.sweeps):
        if sweep > 0:
            collide_with_shapes(work, masses, model.colliders, timing, forces)
            collide_with_walls(work, masses, model.room, forces)
        if not collide_with_others(work, masses, encounters, listed, timing, sweep, forces):
            break
    unsettle(work, encounters)


@in_place
def _finish(work, model, timing, second_order, forces):
    """Second order: damping, the other half kick, and no velocity along what is rigid."""
    if second_order is None:
        return
    masses = model.particles
    half = work.dtype.type(0.5)
    inverse_mass, gravity = masses.inverse_mass, masses.gravity
    for particle in range(inverse_mass.shape[0]):
        if inverse_mass[particle] > 0:
            at = row(work, particle)
            mass = inverse_mass_of(masses, particle)
            for k in range(DIM):
                kick = gravity[k] * timing.h * half
                for lane in range(LANES):
                    if not is_grabbed(mass, at, lane):
                        at[VELOCITY + k * LANES + lane] *= timing.decay
                        at[VELOCITY + k * LANES + lane] += kick
    project_distance_velocities(work, masses, model.distances, timing.h, forces)
    project_chain_velocities(work, masses, model.chains, timing.h, forces)

"""What can be read off the state of worlds: energies, momenta, strains, violations, contacts.

Functions of a Model and of positions `x` (W, N, dim) [m] and velocities `v` (W, N, dim) [m/s], of
which they change nothing; they cost nothing where they are not called. They compute in float64,
whatever the state's dtype. Pins have no mass of their own and do not count; a grabbed particle
does. Forces are known only while a step is computed: `World.step(..., record=True)`.

PBD reads velocities off the substep that just ended, so that what is computed from them is half a
substep late: in free flight E + h/2 m g.v is constant and E itself is not.
"""

from __future__ import annotations

import numpy as np

from pbd_gym.physics.model import Model
from pbd_gym.physics.tables import entries_of_links, links_in_rows


def kinetic_energy(model: Model, v: np.ndarray) -> np.ndarray:
    """Return the kinetic energy of each world, (W,) [J]."""
    free, mass = _masses(model)
    speed = v[:, free].astype(np.float64)
    return 0.5 * np.einsum("n,wnk,wnk->w", mass, speed, speed)


def potential_energy(model: Model, x: np.ndarray) -> np.ndarray:
    """Return the potential energy of each world in gravity, (W,) [J]; 0 at the origin."""
    free, mass = _masses(model)
    return -np.einsum("n,wnk,k->w", mass, x[:, free].astype(np.float64), model.gravity)


def elastic_energy(model: Model, x: np.ndarray) -> np.ndarray:
    """Return the energy stored in compliant chains, distances and bends, (W,) [J].

    C^2 / (2 alpha) of each; rigid constraints store none.
    """
    pairs, rest = links_in_rows(model.chains)
    stored = (
        (_lengths(x, pairs) - rest, model.chains.compliance[entries_of_links(model.chains)]),
        (distance_violations(model, x), model.distances.compliance),
        (bend_violations(model, x), model.bends.compliance),
    )
    total = np.zeros(len(x))
    for violations, compliance in stored:
        soft = compliance > 0.0
        total += 0.5 * np.sum(violations[:, soft] ** 2 / compliance[soft], axis=1)
    return total


def linear_momentum(model: Model, v: np.ndarray) -> np.ndarray:
    """Return the momentum of each world, (W, dim) [kg m/s]."""
    free, mass = _masses(model)
    return np.einsum("n,wnk->wk", mass, v[:, free].astype(np.float64))


def angular_momentum(model: Model, x: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the angular momentum of each world about the origin [kg m2/s].

    (W,) counterclockwise in 2D, (W, 3) in 3D.
    """
    free, mass = _masses(model)
    r, p = x[:, free].astype(np.float64), mass[:, None] * v[:, free].astype(np.float64)
    if model.dim == 2:
        return np.sum(r[:, :, 0] * p[:, :, 1] - r[:, :, 1] * p[:, :, 0], axis=1)
    return np.sum(np.cross(r, p), axis=1)


def link_strains(model: Model, x: np.ndarray) -> np.ndarray:
    """Return the relative change of length of each link of `Model.links`, (W, links)."""
    pairs, rest = model.links()
    return _lengths(x, pairs) / rest - 1.0


def link_violations(model: Model, x: np.ndarray) -> np.ndarray:
    """Return length - rest length of each link of `Model.links`, (W, links) [m]."""
    pairs, rest = model.links()
    return _lengths(x, pairs) - rest


def distance_strains(model: Model, x: np.ndarray) -> np.ndarray:
    """Return the relative change of each distance, (W, E)."""
    return _lengths(x, model.distances.pairs) / model.distances.rest - 1.0


def distance_violations(model: Model, x: np.ndarray) -> np.ndarray:
    """Return length - rest length of each distance, (W, E) [m]."""
    return _lengths(x, model.distances.pairs) - model.distances.rest


def bend_violations(model: Model, x: np.ndarray) -> np.ndarray:
    """Return |x_a - 2 x_b + x_c| of each bend, (W, B) [m]."""
    a, b, c = (x[:, part].astype(np.float64) for part in model.bends.triples.T)
    return np.sqrt(np.sum((a - 2.0 * b + c) ** 2, axis=2))


def touches_wall(model: Model, x: np.ndarray) -> np.ndarray:
    """Return which particles lie on a wall of the room or behind it, (W, N) bool."""
    room = model.room
    # as the kernels compute where particles are stopped: in the dtype of the state
    lower, upper = (wall.astype(x.dtype) for wall in (room.lower, room.upper))
    radius = x.dtype.type(room.radius)
    return ((x <= lower + radius) | (x >= upper - radius)).any(axis=2)


def touches_particle(model: Model, x: np.ndarray, slack: float = 1e-3) -> np.ndarray:
    """Return which particles touch another one they may not come closer to, (W, N) bool.

    Args:
        model: Of the worlds.
        x: Positions (W, N, dim) [m].
        slack: Share of the collision distance by which touching particles may be apart.
    """
    touches = np.zeros(x.shape[:2], dtype=bool)
    _mark_self_collisions(model, x, 1.0 + slack, touches)
    _mark_encounters(model, x, 1.0 + slack, touches)
    return touches


def _mark_self_collisions(model: Model, x: np.ndarray, share: float, touches: np.ndarray) -> None:
    table = model.self_collision
    if table is None:
        return
    particles, reach = table.particles, table.distance * share
    rest = model.positions[particles]
    # neighbours in the body are held apart by its own constraints (kernels/collision.py)
    distant = _square_distances(rest) >= (3.0 * table.distance) ** 2
    for world, points in enumerate(x[:, particles].astype(np.float64)):
        near = distant & (_square_distances(points) <= reach**2)
        touches[world, particles] |= near.any(axis=1)


def _mark_encounters(model: Model, x: np.ndarray, share: float, touches: np.ndarray) -> None:
    table = model.encounters
    if table is None:
        return
    for world, points in enumerate(x.astype(np.float64)):
        c, (a, b) = points[table.particles], (points[ends] for ends in table.links.T)
        length = np.sum((b - a) ** 2, axis=1)
        along = np.sum((c - a) * (b - a), axis=1) / np.where(length > 0.0, length, 1.0)
        apart = c - a - np.clip(along, 0.0, 1.0)[:, None] * (b - a)
        near = np.sqrt(np.sum(apart**2, axis=1)) <= table.distance * share
        touches[world, table.particles[near]] = True
        touches[world, table.links[near]] = True


def _masses(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Return the particles that are no pins and their masses [kg]."""
    free = np.flatnonzero(model.inverse_mass)
    return free, 1.0 / model.inverse_mass[free]


def _lengths(x: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return the distance of each pair, (W, pairs) [m]."""
    delta = x[:, pairs[:, 0]].astype(np.float64) - x[:, pairs[:, 1]]
    return np.sqrt(np.sum(delta**2, axis=2))


def _square_distances(points: np.ndarray) -> np.ndarray:
    """Return the squared distances of n points from each other, (n, n) [m2]."""
    return np.sum((points[:, None] - points[None]) ** 2, axis=2)

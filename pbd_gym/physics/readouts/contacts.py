"""Which particles touch what."""

from __future__ import annotations

import numpy as np

from pbd_gym.physics.model import Model

# kinds of shapes, as in the table; the third is a capsule
_PLANE, _BOX = 0, 1


def touches_wall(model: Model, x: np.ndarray) -> np.ndarray:
    """Return which particles lie on a wall of the room or behind it, (W, N) bool."""
    room = model.room
    # as the kernels compute where particles are stopped: in the dtype of the state
    lower, upper = (wall.astype(x.dtype) for wall in (room.lower, room.upper))
    radius = x.dtype.type(room.radius)
    return ((x <= lower + radius) | (x >= upper - radius)).any(axis=2)


def touches_shape(model: Model, x: np.ndarray, slack: float = 1e-6) -> np.ndarray:
    """Return which particles touch a solid shape or are inside one, (W, N) bool.

    Args:
        model: Of the worlds.
        x: Positions (W, N, dim) [m].
        slack: By which touching particles may be apart [m].
    """
    return (shape_gaps(model, x) <= slack) & (model.inverse_mass > 0.0)


def shape_gaps(model: Model, x: np.ndarray) -> np.ndarray:
    """Return the distance of each particle from the nearest solid shape, (W, N) [m].

    Less the shape's margin; negative inside, +inf without shapes.
    """
    x = x.astype(np.float64)
    gaps = np.full(x.shape[:2], np.inf)
    table = model.colliders
    if table is None:
        return gaps
    for shape, kind in enumerate(table.kinds):
        # static shapes are carried by no pin: their places are those of the world
        carried = [x[:, pin] if pin >= 0 else 0.0 * x[:, 0] for pin in table.pins[shape]]
        start, end = carried[0] + table.starts[shape], carried[1] + table.ends[shape]
        axes = table.axes[shape].reshape(model.dim, model.dim)
        if kind == _PLANE:
            gap = (x - start[:, None]) @ axes[0]
        elif kind == _BOX:
            excess = np.abs((x - start[:, None]) @ axes.T) - table.sizes[shape]
            outside = np.linalg.norm(np.maximum(excess, 0.0), axis=2)
            gap = outside + np.minimum(excess.max(axis=2), 0.0)
        else:
            gap = _from_segment(x, start[:, None], end[:, None]) - table.sizes[shape, 0]
        gaps = np.minimum(gaps, gap - table.margin[shape])
    return gaps


def _from_segment(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the distances of points (..., dim) from segments [m]."""
    axis = end - start
    square = np.sum(axis**2, axis=-1)
    along = np.sum((points - start) * axis, axis=-1) / np.where(square > 0.0, square, 1.0)
    nearest = start + np.clip(along, 0.0, 1.0)[..., None] * axis
    return np.linalg.norm(points - nearest, axis=-1)


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
        near = _from_segment(c, a, b) <= table.distance * share
        touches[world, table.particles[near]] = True
        touches[world, table.links[near]] = True


def _square_distances(points: np.ndarray) -> np.ndarray:
    """Return the squared distances of n points from each other, (n, n) [m2]."""
    return np.sum((points[:, None] - points[None]) ** 2, axis=2)

"""Where the bodies and shapes of a model cast their shadows on the floor."""

from __future__ import annotations

import numpy as np

from pbd_gym.physics.bodies import Balls, Body, Linkage, Mesh, Net, Sheet, Strand
from pbd_gym.physics.model import Model
from pbd_gym.rendering.canvas import ribbon
from pbd_gym.rendering.colliders import cast
from pbd_gym.rendering.curves import finite_spans
from pbd_gym.rendering.scene import bob_radius, particles_of


def shadow_patches(model: Model, x: np.ndarray, light: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the shadows that a lamp far away casts on the floor.

    Args:
        model: Whose bodies cast them; its floor must be finite.
        x: Positions (N, 3) [m]; what is not finite casts none.
        light: Unit vector towards the lamp (3,).

    Returns:
        Quadrilaterals on the floor (Q, 4, 3) [m], and how high above the floor each was cast from
        (Q,) [m].
    """
    floor = float(model.room.lower[2])
    dropped, height = _drop(x, light, floor)
    solid, above = _drop(cast(model, x, light), light, floor)
    patches, heights = [solid], [above.mean(axis=1)]
    for body in model.bodies:
        for corners, high in _casters(model, body, dropped, height):
            patches.append(corners)
            heights.append(high)
    corners, high = np.concatenate(patches), np.concatenate(heights)
    seen = np.isfinite(corners).all(axis=(1, 2))
    return corners[seen], high[seen]


def _drop(points: np.ndarray, light: np.ndarray, floor: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the shadows of points (..., 3) on the floor and how high they are above it [m]."""
    height = np.maximum(points[..., 2] - floor, 0.0)
    dropped = points - height[..., None] / light[2] * light
    dropped[..., 2] = floor
    return dropped, height


def _casters(
    model: Model, body: Body, dropped: np.ndarray, height: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return patches and heights of one body, given each particle's shadow and height."""
    if isinstance(body, Net):
        return [
            caster
            for thread in body.threads
            for caster in _casters(model, Strand(thread, body.radius), dropped, height)
        ]
    particles = particles_of(body)
    if isinstance(body, Sheet):
        cells = np.stack(
            [particles[:-1, :-1], particles[:-1, 1:], particles[1:, 1:], particles[1:, :-1]], axis=2
        ).reshape(-1, 4)
        holes = [row * (particles.shape[1] - 1) + column for row, column in body.holes]
        cells = np.delete(cells, holes, axis=0)
        return [(dropped[cells], height[cells].mean(axis=1))]
    if isinstance(body, Mesh):
        corners = np.array(body.triangles)[:, [0, 1, 2, 2]]
        return [(dropped[corners], height[corners].mean(axis=1))]
    if isinstance(body, Balls):
        radii = np.full(len(particles), body.radius)
        return [_under_balls(dropped[particles], height[particles], radii)]
    casters = []
    line = np.column_stack([dropped[particles], height[particles]])
    for run in (line[span] for span in finite_spans(line)):
        flat = ribbon(run[:, :2], 2.0 * body.radius)
        floor = np.broadcast_to(run[0, 2], (*flat.shape[:2], 1))
        high = (run[1:, 3] + run[:-1, 3]) / 2.0
        casters.append((np.concatenate([flat, floor], axis=2), high))
    if isinstance(body, Linkage):
        radii = bob_radius(model, body)
        casters.append(_under_balls(dropped[particles], height[particles], radii))
    return casters


def _under_balls(
    dropped: np.ndarray, height: np.ndarray, radii: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return two crossed squares under each ball, which pass for a disc once they are blurred."""
    angles = np.radians([[0, 90, 180, 270], [45, 135, 225, 315]])
    rim = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=2)
    squares = dropped[:, None, None] + radii[:, None, None, None] * rim
    return squares.reshape(-1, 4, 3), np.repeat(height, 2)

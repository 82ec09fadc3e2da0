"""The solid shapes of a model: outlines in the plane, patches in space."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from pbd_gym.physics.model import Model
from pbd_gym.rendering.weave import quads

_PLANE, _BOX, CAPSULE = 0, 1, 2
_RIM = 48  # corners around a disc
_RINGS, _MERIDIANS = 14, 28  # patches of a ball
_TILES = 8  # patches along an edge of a box or a plane


class Shape(NamedTuple):
    """One shape where its pins are.

    Attributes:
        kind: 0 plane, 1 box, 2 capsule.
        start: Point of a plane, centre of a box, end of a capsule, (dim,) [m].
        end: Other end of a capsule, (dim,) [m].
        axes: Axes of a box, (dim, dim); the first is the normal of a plane.
        size: Half extents of a box, the radius of a capsule, (dim,) [m].
    """

    kind: int
    start: np.ndarray
    end: np.ndarray
    axes: np.ndarray
    size: np.ndarray


def placed(model: Model, x: np.ndarray) -> Iterator[Shape]:
    """Yield the shapes at positions (N, dim) [m]; without those whose pins are not finite."""
    table = model.colliders
    if table is None:
        return
    carried = np.concatenate([x, np.zeros((1, model.dim))])  # nothing carries a static shape
    starts = table.starts + carried[table.pins[:, 0]]
    ends = table.ends + carried[table.pins[:, 1]]
    axes = table.axes.reshape(-1, model.dim, model.dim)
    for row in zip(table.kinds, starts, ends, axes, table.sizes, strict=True):
        shape = Shape(*row)
        if np.isfinite(shape.start).all() and np.isfinite(shape.end).all():
            yield shape


def outline(shape: Shape, centre: np.ndarray, reach: float) -> np.ndarray:
    """Return the corners (M, 2) [m] of a planar shape.

    Args:
        shape: The shape.
        centre: Of the picture, (2,) [m].
        reach: How far from the centre a half plane is drawn [m].
    """
    if shape.kind == _PLANE:
        normal = shape.axes[0]
        foot = centre + normal * ((shape.start - centre) @ normal)
        along = reach * np.array([normal[1], -normal[0]])
        deep = 2.0 * reach * normal
        return np.stack([foot - along, foot + along, foot + along - deep, foot - along - deep])
    if shape.kind == _BOX:
        signs = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        return shape.start + (signs * shape.size) @ shape.axes
    along = shape.end - shape.start
    turn = np.arctan2(along[1], along[0]) - np.pi / 2.0
    angles = turn + np.linspace(0.0, 2.0 * np.pi, _RIM, endpoint=False)
    rim = shape.size[0] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    near_end = (np.arange(_RIM) <= _RIM // 2)[:, None]
    return np.where(near_end, shape.end, shape.start) + rim


def patches(shape: Shape, centre: np.ndarray, reach: float) -> np.ndarray:
    """Return the surface of a spatial shape as quadrilaterals (Q, 4, 3) [m], seen anticlockwise.

    Args:
        shape: The shape.
        centre: Around which a plane is drawn, (3,) [m].
        reach: How far from there [m].
    """
    if shape.kind == _PLANE:
        normal = shape.axes[0]
        across = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
        across /= np.linalg.norm(across)
        foot = centre + normal * ((shape.start - centre) @ normal)
        return foot + reach * _square(np.stack([across, np.cross(normal, across)]))
    if shape.kind == _BOX:
        edges = shape.size[:, None] * shape.axes
        if np.linalg.det(shape.axes) < 0.0:
            edges = edges[[1, 0, 2]]
        faces = []
        for axis in range(3):
            face = _square(edges[[(axis + 1) % 3, (axis + 2) % 3]])
            faces += [shape.start + edges[axis] + face, shape.start - edges[axis] + face[:, ::-1]]
        return np.concatenate(faces)
    return _round(shape)


def cast(model: Model, x: np.ndarray, light: np.ndarray) -> np.ndarray:
    """Return the lit patches (Q, 4, 3) [m] of all spatial shapes but planes, which cast shadows."""
    found = [np.zeros((0, 4, 3))]
    for shape in placed(model, x):
        if shape.kind != _PLANE:
            corners = patches(shape, shape.start, 0.0)
            found.append(corners[_normals(corners) @ light > 0.0])
    return np.concatenate(found)


def _normals(corners: np.ndarray) -> np.ndarray:
    """Return the unit normals (Q, 3) of patches (Q, 4, 3)."""
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)


def _square(edges: np.ndarray) -> np.ndarray:
    """Return the patches of a square from -edges to +edges (2, 3), anticlockwise."""
    steps = np.linspace(-1.0, 1.0, _TILES + 1)
    return quads(steps[:, None, None] * edges[1] + steps[:, None] * edges[0])


def _round(shape: Shape) -> np.ndarray:
    """Return the patches of a capsule: a ball whose upper half is moved to the other end."""
    along = shape.end - shape.start
    length = np.linalg.norm(along)
    pole = along / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
    across = np.cross(np.eye(3)[np.argmin(np.abs(pole))], pole)
    across /= np.linalg.norm(across)
    frame = np.stack([across, np.cross(pole, across), pole])
    latitude = np.linspace(-np.pi / 2.0, np.pi / 2.0, _RINGS + 1)
    longitude = np.linspace(0.0, 2.0 * np.pi, _MERIDIANS + 1)
    ring = np.stack([np.cos(longitude), np.sin(longitude), np.zeros_like(longitude)], axis=1)
    height = np.sin(latitude)[:, None, None] * np.array([0.0, 0.0, 1.0])
    points = shape.size[0] * (np.cos(latitude)[:, None, None] * ring + height) @ frame
    equator = _RINGS // 2
    lower, upper = shape.start + points[: equator + 1], shape.end + points[equator:]
    rods = [] if length == 0.0 else [_tube(lower[-1], upper[0])]
    return np.concatenate([quads(lower), *rods, quads(upper)])


def _tube(lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Return the patches between two rings of points (M, 3), about as long as they are wide."""
    width = float(np.linalg.norm(lower[1] - lower[0]))
    pieces = int(np.clip(np.linalg.norm(upper[0] - lower[0]) / width, 1.0, 40.0))
    share = np.linspace(0.0, 1.0, pieces + 1)[:, None, None]
    return quads(lower + share * (upper - lower))

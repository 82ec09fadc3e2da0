"""Soft and rigid bodies: functions that add one to a ModelBuilder; found in `shapes`."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

from pbd_gym.physics.bodies import Mesh, Polygon
from pbd_gym.physics.builder import ModelBuilder

# The outline of a hexagonal mesh of springs k has the membrane stiffness 2k/sqrt(3).
_SPRING_OF_MEMBRANE = 3.0**0.5 / 2.0


def soft_body_2d(
    builder: ModelBuilder,
    outline: Any,
    *,
    mass: float,
    stretch_stiffness: float = 10.0,
    area_modulus: float = np.inf,
    shape_stiffness: float = 0.0,
    pressure: float = 1.0,
    collision_radius: float = 0.0,
    collision_friction: float = 0.0,
    radius: float = 0.005,
) -> np.ndarray:
    """Add a soft body of the plane: an elastic outline that encloses an area; nothing is pinned.

    Args:
        builder: Takes the body.
        outline: (n, 2) corners, once around [m]; the more evenly spaced, the better.
        mass: Of the whole body [kg], spread evenly along the outline.
        stretch_stiffness: EA of the outline [N]; +inf is inextensible.
        area_modulus: K = -A dp/dA [N/m]; +inf keeps the area.
        shape_stiffness: k [N/m] with which the body is drawn to its shape, see
            `ModelBuilder.add_shape_match`; 0 for a bag that any outline of its length may enclose,
            +inf for a rigid body.
        pressure: Rest area as a multiple of the area as placed.
        collision_radius: Of the outline, with which it collides with other bodies [m]; 0 for not.
        collision_friction: Coulomb coefficient of that.
        radius: Half the drawn width of the outline [m].

    Returns:
        The particles' indices, in the order of the outline.

    Raises:
        ValueError: If there are fewer than 3 corners, or a stiffness is not positive.
    """
    corners = np.asarray(outline, dtype=np.float64)
    if corners.ndim != 2 or len(corners) < 3:
        raise ValueError(f"outline has shape {corners.shape}; expected (3 or more, 2)")
    lengths = np.sqrt(np.sum((np.roll(corners, -1, axis=0) - corners) ** 2, axis=1))
    shares = (lengths + np.roll(lengths, 1)) / (2.0 * np.sum(lengths))
    indices = np.concatenate(
        [builder.add_particles(at, mass * part) for at, part in zip(corners, shares, strict=True)]
    )
    stretch = _compliance("stretch_stiffness", stretch_stiffness)
    # every other edge, then those between: solved once around, the body would roll by itself
    count = len(indices)
    for i in (*range(0, count, 2), *range(1, count, 2)):
        j = (i + 1) % count
        builder.add_distance(indices[i], indices[j], compliance=lengths[i] * stretch)
    area_compliance = _compliance("area_modulus", area_modulus)
    builder.add_area(indices, pressure=pressure, compliance=area_compliance)
    if shape_stiffness != 0.0:
        compliance = _compliance("shape_stiffness", shape_stiffness)
        builder.add_shape_match(indices, compliance=compliance)
    if collision_radius > 0.0:
        links = np.stack([indices, np.roll(indices, -1)], axis=1)
        builder.add_collision(indices, collision_radius, links=links, friction=collision_friction)
    builder.add_body(Polygon(tuple(map(int, indices)), radius))
    return indices


def soft_ball(
    builder: ModelBuilder,
    centre: Any,
    size: float,
    *,
    mass: float,
    subdivisions: int = 2,
    membrane_stiffness: float = 100.0,
    bulk_modulus: float = np.inf,
    shape_stiffness: float = 0.0,
    pressure: float = 1.0,
) -> np.ndarray:
    """Add a soft ball: an elastic skin that encloses a volume; nothing is pinned.

    Args:
        builder: Takes the ball.
        centre: (3,) [m].
        size: Radius [m].
        mass: Of the whole ball [kg], in its skin.
        subdivisions: Of an icosahedron's triangles: 0, 1, 2, 3 for 12, 42, 162, 642 particles.
        membrane_stiffness: Young's modulus times thickness of the skin [N/m]; +inf is inextensible.
        bulk_modulus: K = -V dp/dV [Pa]; +inf keeps the volume.
        shape_stiffness: k [N/m] with which the body is drawn to its shape, see
            `ModelBuilder.add_shape_match`; 0 for none, +inf for a rigid body.
        pressure: Rest volume as a multiple of the volume as placed.

    Returns:
        The particles' indices.

    Raises:
        ValueError: If the subdivisions are not 0 to 4, or a stiffness is not positive.
    """
    if subdivisions not in range(5):
        raise ValueError(f"subdivisions is {subdivisions!r}; allowed: 0 to 4")
    directions, triangles = icosphere(subdivisions)
    points = np.asarray(centre, dtype=np.float64) + size * directions
    indices = builder.add_particles(points, mass / len(points))
    facets = indices[triangles]
    compliance = _compliance("membrane_stiffness", membrane_stiffness) / _SPRING_OF_MEMBRANE
    edges = facets[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    for i, j in edges[edges[:, 0] < edges[:, 1]]:  # the other triangle has it the other way round
        builder.add_distance(int(i), int(j), compliance=compliance)
    bulk_compliance = _compliance("bulk_modulus", bulk_modulus)
    builder.add_volume(facets, pressure=pressure, compliance=bulk_compliance)
    if shape_stiffness != 0.0:
        compliance = _compliance("shape_stiffness", shape_stiffness)
        builder.add_shape_match(indices, compliance=compliance)
    builder.add_body(Mesh(_as_triangles(facets)))
    return indices


def rigid_box(
    builder: ModelBuilder,
    centre: Any,
    size: Any,
    *,
    mass: float,
    counts: Any = 2,
) -> np.ndarray:
    """Add a rigid box, upright as placed: a lattice of particles held by shape matching.

    n particles along an edge l have (n + 1)/(n - 1) times the moment l^2/12 of a solid box, three
    times for the corners alone.

    Args:
        builder: Takes the box.
        centre: (dim,) [m].
        size: (dim,) lengths of its edges [m].
        mass: Of the whole box [kg].
        counts: Particles along each edge, at least 2; one number or (dim,).

    Returns:
        The particles' indices, (*counts).

    Raises:
        ValueError: If a count is below 2 or a length is not positive.
    """
    dim = builder.dim
    numbers = tuple(int(n) for n in np.broadcast_to(counts, (dim,)))
    edges = np.asarray(size, dtype=np.float64)
    if edges.shape != (dim,) or not (edges > 0.0).all():
        raise ValueError(f"size is {size}; expected {dim} positive lengths [m]")
    if min(numbers) < 2:
        raise ValueError(f"counts is {counts}; a box has at least 2 particles along each edge")
    axes = [np.linspace(-0.5, 0.5, n) * edge for n, edge in zip(numbers, edges, strict=True)]
    points = np.asarray(centre, dtype=np.float64) + np.array(list(product(*axes)))
    indices = builder.add_particles(points, mass / len(points))
    builder.add_shape_match(indices)
    grid = indices.reshape(numbers)
    ends = [0, -1]
    if dim == 2:
        corners = [grid[0, 0], grid[-1, 0], grid[-1, -1], grid[0, -1]]
        builder.add_body(Polygon(tuple(map(int, corners)), 0.0, smooth=False))
    else:
        builder.add_body(Mesh(_as_triangles(_box_triangles(grid[np.ix_(ends, ends, ends)]))))
    return grid


def icosphere(subdivisions: int) -> tuple[np.ndarray, np.ndarray]:
    """Return unit vectors (n, 3) and triangles (20 * 4^subdivisions, 3) of a divided icosahedron.

    The triangles are oriented anticlockwise seen from outside.
    """
    golden = (1.0 + 5.0**0.5) / 2.0
    points = [
        np.roll([0.0, a, b * golden], axis) for axis in range(3) for a in (1, -1) for b in (1, -1)
    ]
    points = [point / np.sqrt(point @ point) for point in points]
    # neighbours of an icosahedron's corner are 63 degrees away, the next ones 117
    triangles = [
        (i, j, k) if np.linalg.det([points[i], points[j], points[k]]) > 0.0 else (i, k, j)
        for i, j, k in product(range(12), repeat=3)
        if i < j < k and min(points[a] @ points[b] for a, b in ((i, j), (j, k), (k, i))) > 0.0
    ]
    for _ in range(subdivisions):
        middle: dict[tuple[int, int], int] = {}
        for triangle in triangles:
            for i, j in zip(triangle, np.roll(triangle, -1).tolist(), strict=True):
                if (j, i) not in middle:
                    point = points[i] + points[j]
                    middle[i, j] = middle[j, i] = len(points)
                    points.append(point / np.sqrt(point @ point))
        divided = []
        for i, j, k in triangles:
            a, b, c = middle[i, j], middle[j, k], middle[k, i]
            divided += [(i, a, c), (j, b, a), (k, c, b), (a, b, c)]
        triangles = divided
    return np.array(points), np.array(triangles)


def _box_triangles(corners: np.ndarray) -> np.ndarray:
    """Return the 12 triangles of a box (2, 2, 2), anticlockwise seen from outside."""
    triangles = []
    for axis, side in product(range(3), (0, 1)):
        face = np.moveaxis(corners, (axis, (axis + 1) % 3, (axis + 2) % 3), (0, 1, 2))[side]
        ring = [face[0, 0], face[1, 0], face[1, 1], face[0, 1]][:: 1 if side else -1]
        triangles += [ring[:3], [ring[2], ring[3], ring[0]]]
    return np.array(triangles)


def _as_triangles(facets: np.ndarray) -> tuple[tuple[int, int, int], ...]:
    return tuple((int(i), int(j), int(k)) for i, j, k in facets)


def _compliance(name: str, stiffness: float) -> float:
    if not stiffness > 0.0:
        raise ValueError(f"{name} is {stiffness}; it must be positive")
    return 1.0 / stiffness

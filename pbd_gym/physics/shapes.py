"""Ropes, pendulums, cloths, soft and rigid bodies: functions that add one to a ModelBuilder."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from pbd_gym.physics.bodies import Linkage, Sheet, Strand
from pbd_gym.physics.builder import ModelBuilder
from pbd_gym.physics.solid_shapes import rigid_box, soft_ball, soft_body_2d

__all__ = [
    "bend_sheet",
    "chain",
    "cloth",
    "pendulum",
    "rigid_box",
    "rope",
    "soft_ball",
    "soft_body_2d",
]


def rope(
    builder: ModelBuilder,
    start: Any,
    end: Any,
    particles: int,
    *,
    mass: float,
    compliance: float = 0.0,
    bending_stiffness: float = 0.0,
    curvature: float = 0.0,
    payload: float = 0.0,
    slack: bool = False,
    implicit: bool = False,
    collision_radius: float = 0.0,
    collision_friction: float = 0.0,
    radius: float = 0.01,
) -> np.ndarray:
    """Add a straight rope whose links and bending are solved directly; nothing is pinned.

    Args:
        builder: Takes the rope.
        start: (dim,) of the first particle [m].
        end: (dim,) of the last particle [m].
        particles: Number of particles, at least 2.
        mass: Of the whole rope [kg].
        compliance: Of a link [m/N]; l/(EA) for links of length l and an axial stiffness EA [N].
        bending_stiffness: EI [N m2]; 0 bends freely.
        curvature: Towards which the bending draws it, 1/radius [1/m]; see `add_rod`.
        payload: Mass that its last particle carries besides [kg].
        slack: Let links be shorter than their rest: they pull but do not push.
        implicit: Stay stable with many short links and heavy masses; see `add_chain`.
        collision_radius: With which it collides with other bodies and with itself [m]; 0 for not.
        collision_friction: Coulomb coefficient of that.
        radius: Drawn [m].

    Returns:
        The particles' indices, from start to end.

    Raises:
        ValueError: If there are fewer than 2 particles.
    """
    if particles < 2:
        raise ValueError(f"particles is {particles}; a rope has at least 2")
    share = np.linspace(0.0, 1.0, particles)[:, None]
    first, last = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    masses = np.full(particles, mass / particles)
    masses[-1] += payload
    indices = chain(
        builder,
        first + share * (last - first),
        masses,
        compliance=compliance,
        slack=slack,
        implicit=implicit,
        radius=radius,
    )
    if bending_stiffness > 0.0:
        builder.add_rod(indices, bending_stiffness=bending_stiffness, curvature=curvature)
    if collision_radius > 0.0:
        links = np.stack([indices[:-1], indices[1:]], axis=1)
        builder.add_collision(
            indices, collision_radius, links=links, within=True, friction=collision_friction
        )
    return indices


def chain(
    builder: ModelBuilder,
    points: Any,
    masses: Any,
    *,
    compliance: float = 0.0,
    slack: bool = False,
    implicit: bool = False,
    radius: float = 0.01,
) -> np.ndarray:
    """Add a chain through points, with a mass at each; nothing is pinned.

    Args:
        builder: Takes the chain.
        points: (n, dim) [m], at least 2.
        masses: Of the particles [kg], one or one each.
        compliance: Of a link [m/N].
        slack: Let links be shorter than their rest: they pull but do not push.
        implicit: Stay stable with many short links and heavy masses; see `add_chain`.
        radius: Drawn [m].

    Returns:
        The particles' indices, in the order of the points.
    """
    points = np.asarray(points, dtype=np.float64)
    shares = np.broadcast_to(np.asarray(masses, dtype=np.float64), (len(points),))
    indices = np.concatenate(
        [builder.add_particles(at, mass) for at, mass in zip(points, shares, strict=True)]
    )
    builder.add_chain(indices, compliance=compliance, slack=slack, implicit=implicit)
    builder.add_body(Strand(tuple(map(int, indices)), radius))
    return indices


def pendulum(
    builder: ModelBuilder,
    pivot: Any,
    lengths: Any,
    masses: Any,
    *,
    radius: float = 0.01,
) -> np.ndarray:
    """Add an n-link pendulum that hangs down from a pinned pivot.

    Args:
        builder: Takes the pendulum.
        pivot: (dim,) of the pivot [m].
        lengths: (n,) of the links [m].
        masses: (n,) of the bobs [kg].
        radius: Of the drawn rods [m].

    Returns:
        The particles' indices: the pivot, then the bobs from top to bottom.

    Raises:
        ValueError: If there is not one mass per link.
    """
    if len(lengths) != len(masses):
        raise ValueError(f"{len(lengths)} lengths and {len(masses)} masses; expected one each")
    at = np.array(pivot, dtype=np.float64)
    indices = [builder.add_particles(at, 1.0, pinned=True)[0]]
    for length, mass in zip(lengths, masses, strict=True):
        at[-1] -= length
        indices.append(builder.add_particles(at, mass)[0])
    builder.add_chain(indices, rest=lengths)
    builder.add_body(Linkage(tuple(map(int, indices)), radius))
    return np.array(indices)


def cloth(
    builder: ModelBuilder,
    corner: Any,
    along_rows: Any,
    along_columns: Any,
    shape: tuple[int, int],
    *,
    mass: float,
    stretch_compliance: float = 1e-6,
    strain_limit: float = 0.02,
    shear_compliance: float = 1e-3,
    bending_compliance: float = 10.0,
    bending_friction: float = 0.0,
    thread_damping: float = 0.0,
    collision_distance: float = 0.0,
    collision_friction: float = 0.0,
    pinned: Iterable[tuple[int, int]] = (),
    radius: float = 0.002,
) -> np.ndarray:
    """Add a flat rectangular cloth woven of threads.

    Each row and each column is a thread, solved directly as a chain. Shear (both diagonals of each
    cell) and bending (along the threads) are soft.

    Args:
        builder: Takes the cloth.
        corner: (3,) of particle (0, 0) [m].
        along_rows: (3,) from row 0 to the last row [m].
        along_columns: (3,) from column 0 to the last column [m].
        shape: Rows and columns, at least 2 each.
        mass: Of the whole cloth [kg].
        stretch_compliance: Of a link under tension [m/N].
        strain_limit: Strain beyond which a link is cut short whatever pulls on it.
        shear_compliance: Of a diagonal [m/N].
        bending_compliance: l^3/EI [m/N].
        bending_friction: Force up to which dry friction holds each bend as it is [N].
        thread_damping: Rate at which the velocities of linked particles approach each other [1/s].
        collision_distance: That the particles keep from each other [m]; 0 for none.
        collision_friction: Coulomb coefficient between particles.
        pinned: (row, column) of the particles that are held; negative ones count from the end.
        radius: Half the drawn thickness [m].

    Returns:
        The particles' indices, (rows, columns).

    Raises:
        ValueError: If the cloth has fewer than 2 rows or columns.
    """
    rows, columns = shape
    if rows < 2 or columns < 2:
        raise ValueError(f"shape is {shape}; a cloth has at least 2 rows and 2 columns")
    down = np.linspace(0.0, 1.0, rows)[:, None, None] * np.asarray(along_rows, dtype=np.float64)
    across = np.linspace(0.0, 1.0, columns)[:, None] * np.asarray(along_columns, dtype=np.float64)
    points = np.asarray(corner, dtype=np.float64) + down + across
    indices = builder.add_particles(points.reshape(-1, 3), mass / (rows * columns))
    grid = indices.reshape(rows, columns)
    builder.pin([grid[place] for place in pinned])
    _shear(builder, grid, shear_compliance)
    for thread in (*grid, *grid.T):
        for a, b, c in zip(thread, thread[1:], thread[2:], strict=False):
            builder.add_bend(a, b, c, compliance=bending_compliance, friction=bending_friction)
        builder.add_chain(
            thread,
            compliance=stretch_compliance,
            strain_limit=strain_limit,
            damping=thread_damping,
        )
    if collision_distance > 0.0:
        builder.set_self_collision(indices, collision_distance, friction=collision_friction)
    builder.add_body(Sheet(tuple(tuple(map(int, row)) for row in grid), radius))
    return grid


def _shear(builder: ModelBuilder, grid: np.ndarray, compliance: float) -> None:
    """Hold both diagonals of every cell."""
    for a, b in ((grid[:-1, :-1], grid[1:, 1:]), (grid[:-1, 1:], grid[1:, :-1])):
        for i, j in zip(a.ravel(), b.ravel(), strict=True):
            builder.add_distance(int(i), int(j), compliance=compliance)


def bend_sheet(
    builder: ModelBuilder, triangles: Any, *, bending_stiffness: float, creased: bool = False
) -> None:
    """Let the triangles of a sheet resist bending across every edge that two of them share.

    Args:
        builder: Has the sheet's particles, and takes its bending.
        triangles: (t, 3) particles, all wound the same way.
        bending_stiffness: B of the sheet [N m].
        creased: Take the angles as placed for the rest (hinges); else flat (folds).

    Raises:
        ValueError: If an edge has more than two triangles, or two that are wound differently.
    """
    wings: dict[tuple[int, int], int] = {}
    for a, b, c in np.asarray(triangles).tolist():
        for start, end, wing in ((a, b, c), (b, c, a), (c, a, b)):
            if (start, end) in wings:
                raise ValueError(f"two triangles run along their edge from {start} to {end}")
            wings[start, end] = wing
    add = builder.add_hinge if creased else builder.add_fold
    for (start, end), wing in wings.items():
        if start < end and (end, start) in wings:
            pair = (wing, wings[end, start])
            add((start, end), pair, bending_stiffness=bending_stiffness)

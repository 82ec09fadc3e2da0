"""What holds bodies in shape: areas, volumes, shape matching, attachments."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from pbd_gym.physics.building.particles import ParticleBuilder, as_indices
from pbd_gym.physics.checks import (
    check_compliance,
    check_different,
    check_duplicates,
    check_indices,
    refuse_if,
)
from pbd_gym.physics.tables import Attachments, ShapeMatches, Volumes

# Contents below this share of a body's extent to the power of dim are rounding.
_FLAT = 1e-9
# A gradient whose square is below this share of the one as placed is that of a collapsed body.
_COLLAPSED = 0.01
# Stands for the mass of a body that is all pins [kg].
_LEAST_MASS = 1e-12


class SolidBuilder(ParticleBuilder):
    """Collects areas, volumes, shape matching and attachments."""

    def __init__(self, dim: int) -> None:
        super().__init__(dim)
        self._volumes: list[tuple[np.ndarray, float, float]] = []
        self._shape_matches: list[tuple[np.ndarray, float]] = []
        self._attachments: list[tuple[int, int, Any, float]] = []

    def add_area(
        self,
        particles: Sequence[int] | np.ndarray,
        *,
        pressure: float = 1.0,
        compliance: float = 0.0,
    ) -> None:
        """Keep the area of a triangle or any closed polygon (2D).

        The area A is signed by the order of the particles, so that a body turned inside out turns
        back (Mueller et al. 2007, section 4.4, in the plane).

        Args:
            particles: Corners, three or more, once around.
            pressure: Rest area A_0 as a multiple of the area as placed; above 1 inflates.
            compliance: 1/K [m/N] of the area modulus K = -A_0 dp/dA [N/m], p the force per length
                with which the outline is pressed; 0 keeps the area.

        Raises:
            ValueError: In three dimensions.
        """
        if self.dim != 2:
            raise ValueError("an area is kept in 2 dimensions; this model has 3: use add_volume")
        corners = as_indices(particles)
        edges = np.stack([corners, np.roll(corners, -1)], axis=1)
        self._volumes.append((edges, float(pressure), float(compliance)))

    def add_volume(self, triangles: Any, *, pressure: float = 1.0, compliance: float = 0.0) -> None:
        """Keep the volume within a closed surface (3D; Mueller et al. 2007, eq. 14-15).

        The volume V is signed by the triangles' orientation, so that a body turned inside out turns
        back.

        Args:
            triangles: (n, 3) particles, anticlockwise seen from outside.
            pressure: Rest volume V_0 as a multiple of the volume as placed; above 1 inflates.
            compliance: 1/K [1/Pa] of the bulk modulus K = -V_0 dp/dV [Pa]; 0 keeps the volume.

        Raises:
            ValueError: In two dimensions, or if the triangles do not have three corners each.
        """
        if self.dim != 3:
            raise ValueError("a volume is kept in 3 dimensions; this model has 2: use add_area")
        facets = _as_groups(triangles, 3, "triangles")
        self._volumes.append((facets, float(pressure), float(compliance)))

    def add_tetrahedra(self, corners: Any, *, compliance: float = 0.0) -> None:
        """Keep the volume of every tetrahedron (3D).

        Args:
            corners: (n, 4) particles.
            compliance: 1/K [1/Pa] of the bulk modulus K; 0 keeps the volumes.

        Raises:
            ValueError: In two dimensions, or if there are not four corners each.
        """
        for a, b, c, d in _as_groups(corners, 4, "tetrahedra"):
            facets = [(a, c, b), (a, b, d), (b, c, d), (c, a, d)]
            self.add_volume(facets, compliance=compliance)

    def add_shape_match(
        self, particles: Sequence[int] | np.ndarray, *, compliance: float = 0.0
    ) -> None:
        """Draw particles to the shape in which they are placed, moved and turned to fit best.

        Args:
            particles: Two or more particles, each once.
            compliance: 1/k [m/N]; the body as a whole is drawn to its shape with the stiffness k,
                energy k/2 sum (m_i/M) |x_i - g_i|^2, so that it vibrates at sqrt(k/M) whatever its
                number of particles. 0 is a rigid body.
        """
        self._shape_matches.append((as_indices(particles), float(compliance)))

    def add_attachment(
        self, particle: int, anchor: int, *, offset: Any = None, compliance: float = 0.0
    ) -> None:
        """Hold a particle at a fixed offset from another, for example from a moving pin.

        The offset does not turn; for a frame that turns see `frame_targets`. At an offset of 0 it
        is a joint, which keeps angular momentum too.

        Args:
            particle: Particle that is held.
            anchor: Particle that holds it.
            offset: x_particle - x_anchor, (dim,) [m]; as placed where None.
            compliance: Inverse of the spring stiffness [m/N]; 0 is rigid.
        """
        self._attachments.append((int(particle), int(anchor), offset, float(compliance)))

    def _solid_tables(self, always: bool) -> dict[str, Any]:
        """Return all tables of solids, or None for each: so kernels exist with and without solids.

        A kernel for each combination of kinds would be compiled anew.
        """
        kinds = ("volumes", "shape_matches", "attachments")
        if not (always or self._volumes or self._shape_matches or self._attachments):
            return dict.fromkeys(kinds)
        tables = self._volume_table(), self._shape_match_table(), self._attachment_table()
        return dict(zip(kinds, tables, strict=True))

    def _volume_table(self) -> Volumes:
        positions, inverse_mass = np.array(self._positions), self._inverse_masses()
        pressure = np.array([row[1] for row in self._volumes])
        compliance = np.array([row[2] for row in self._volumes])
        _check_volumes([facets for facets, *_ in self._volumes], pressure, compliance, self._count)
        groups = [np.unique(facets) for facets, *_ in self._volumes]
        check_duplicates(groups, "volume")
        placed, least = np.zeros(len(groups)), np.zeros(len(groups))
        for index, (facets, *_) in enumerate(self._volumes):
            placed[index], gradient = _content(positions, facets)
            least[index] = _COLLAPSED * (inverse_mass @ np.sum(gradient**2, axis=1))
            extent = np.max(np.ptp(positions[groups[index]], axis=0))
            if abs(placed[index]) <= _FLAT * extent**self.dim:
                raise ValueError(
                    f"volume {index} is {placed[index]} as placed; it must not be flat"
                )
        return Volumes(
            offsets=_offsets(groups),
            particles=_joined(groups),
            facet_offsets=_offsets([facets for facets, *_ in self._volumes]),
            facets=_joined([facets.reshape(-1) for facets, *_ in self._volumes]).reshape(
                -1, self.dim
            ),
            rest=placed * pressure,
            compliance=compliance * np.abs(placed * pressure),
            least=least,
        )

    def _shape_match_table(self) -> ShapeMatches:
        groups = [particles for particles, _ in self._shape_matches]
        compliance = np.array([compliance for _, compliance in self._shape_matches])
        for index, group in enumerate(groups):
            check_indices(group, self._count, f"particle of shape match {index}:")
            if len(group) < 2 or len(np.unique(group)) != len(group):
                raise ValueError(
                    f"shape match {index} is {group}; it needs 2 or more different particles"
                )
        check_compliance(compliance, "shape match")
        check_duplicates(groups, "shape match")
        particles = _joined(groups)
        points = np.array(self._positions)[particles]
        # what a pin weighs depends on who else is one at the time: the kernel says
        mass = np.where(self._pinned, 0.0, self._masses)[particles]
        total, weight = np.zeros(len(groups)), np.zeros(len(mass))
        for index, (first, last) in enumerate(pairwise(_offsets(groups))):
            total[index] = np.sum(mass[first:last])
            weight[first:last] = mass[first:last] / max(total[index], _LEAST_MASS)
            points[first:last] -= np.mean(points[first:last], axis=0)
            if not np.any(points[first:last]):
                raise ValueError(
                    f"shape match {index} has all its {last - first} particles on one spot"
                )
        return ShapeMatches(_offsets(groups), particles, weight, points, compliance * total)

    def _attachment_table(self) -> Attachments:
        pairs = np.array([row[:2] for row in self._attachments], dtype=np.int64).reshape(-1, 2)
        compliance = np.array([row[3] for row in self._attachments])
        check_indices(pairs, self._count, "particles of attachment")
        check_different(pairs, "attachment")
        check_duplicates(pairs, "attachment")
        check_compliance(compliance, "attachment")
        offsets = np.zeros((len(pairs), self.dim))
        for index, (i, j, offset, _) in enumerate(self._attachments):
            placed = self._positions[i] - self._positions[j]
            vector = placed if offset is None else np.array(offset, dtype=np.float64)
            if vector.shape != (self.dim,) or not np.isfinite(vector).all():
                raise ValueError(
                    f"offset of attachment {index} is {offset}; expected {self.dim} finite numbers"
                )
            offsets[index] = vector
        return Attachments(pairs, offsets, compliance)

    def _inverse_masses(self) -> np.ndarray:
        return 1.0 / np.where(self._pinned, np.inf, self._masses)


def _check_volumes(
    groups: list[np.ndarray], pressure: np.ndarray, compliance: np.ndarray, count: int
) -> None:
    for index, facets in enumerate(groups):
        what = f"{'edge' if facets.shape[1] == 2 else 'triangle'} of volume {index}:"
        check_indices(facets, count, what)
        check_different(facets, what)
        _check_closed(facets, index)
    wrong = ~(np.isfinite(pressure) & (pressure > 0.0))
    refuse_if(wrong, "pressure of volume", pressure, "it must be positive and finite")
    wrong = ~(np.isfinite(compliance) & (compliance >= 0.0))
    refuse_if(wrong, "compliance of volume", compliance, "it must be finite and at least 0")


def _content(positions: np.ndarray, facets: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the signed area or volume within closed facets, and its gradient (N, dim)."""
    dim = positions.shape[1]
    p = positions - positions[facets[0, 0]]
    gradient = np.zeros_like(p)
    if dim == 2:
        i, j = facets.T
        np.add.at(gradient, i, 0.5 * np.stack([p[j, 1], -p[j, 0]], axis=1))
        np.add.at(gradient, j, 0.5 * np.stack([-p[i, 1], p[i, 0]], axis=1))
    else:
        for i, j, k in (facets.T, np.roll(facets, 1, axis=1).T, np.roll(facets, 2, axis=1).T):
            np.add.at(gradient, i, np.cross(p[j], p[k]) / 6.0)
    # a content of degree dim: Euler's theorem on homogeneous functions
    return float(np.sum(p * gradient)) / dim, gradient


def _check_closed(facets: np.ndarray, index: int) -> None:
    """Refuse facets that leave a hole, meet in more than two, or do not all face outwards."""
    if facets.shape[1] == 2:
        starts = np.unique(facets[:, 0])
        if len(facets) < 3 or len(starts) != len(facets):
            raise ValueError(
                f"area {index} is {facets[:, 0]}; it needs 3 or more different particles"
            )
        return
    edges = {(int(t[k]), int(t[(k + 1) % 3])) for t in facets for k in range(3)}
    if len(edges) != 3 * len(facets):
        raise ValueError(f"volume {index} has an edge that two triangles run through the same way")
    for a, b in sorted(edges):
        if (b, a) not in edges:
            raise ValueError(
                f"the surface of volume {index} is not closed at the edge from {a} to {b}"
            )


def _as_groups(values: Any, size: int, what: str) -> np.ndarray:
    array = np.asarray(values)
    if array.ndim != 2 or array.shape[1] != size or not len(array):
        raise ValueError(f"{what} have shape {array.shape}; expected (n, {size})")
    return as_indices(array).reshape(-1, size)


def _joined(groups: Sequence[np.ndarray]) -> np.ndarray:
    return np.concatenate([np.zeros(0, dtype=np.int64), *groups])


def _offsets(groups: Sequence[np.ndarray]) -> np.ndarray:
    return np.concatenate([[0], np.cumsum([len(group) for group in groups])]).astype(np.int64)

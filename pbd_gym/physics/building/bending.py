"""What resists bending: bends and rods along lines, hinges and folds between triangles."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from pbd_gym.physics import portable
from pbd_gym.physics.building.links import joined
from pbd_gym.physics.building.particles import ParticleBuilder, as_indices
from pbd_gym.physics.checks import (
    check_compliance,
    check_different,
    check_duplicates,
    check_indices,
    refuse_if,
)
from pbd_gym.physics.tables import Bends, Folds, Hinges, Rods

# Particles of a rod may be spaced unevenly by this share of their mean spacing.
_EVEN = 1e-3
# A triangle is degenerate below this share of its edge (squared); the kernel skips flatter ones.
_FLATTEST = 1e-8


class _Rod(NamedTuple):
    particles: np.ndarray
    spacing: float
    stiffness: float
    curvature: Any


class BendBuilder(ParticleBuilder):
    """Collects bends, rods, hinges and folds."""

    def __init__(self, dim: int) -> None:
        super().__init__(dim)
        self._bends: list[tuple[int, int, int, float, float]] = []
        self._rods: list[_Rod] = []
        self._hinges: list[tuple[np.ndarray, float, float | None]] = []
        self._folds: list[tuple[np.ndarray, float]] = []

    def add_bend(self, a: int, b: int, c: int, *, compliance: float, friction: float = 0.0) -> None:
        """Resist bending at b: the vector x_a - 2 x_b + x_c is drawn to zero (straight rest).

        Args:
            a: Neighbour of b.
            b: Particle in the middle.
            c: Other neighbour of b.
            compliance: l^3 / EI [m/N] for neighbours l apart and a bending stiffness EI [N m2].
            friction: Force up to which dry friction holds the bend as it is [N].
        """
        self._bends.append((int(a), int(b), int(c), float(compliance), float(friction)))

    def add_rod(
        self,
        particles: Sequence[int] | np.ndarray,
        *,
        bending_stiffness: float,
        curvature: Any = 0.0,
        spacing: float | None = None,
    ) -> None:
        """Resist bending along a row of evenly spaced particles, all joints solved together.

        Bends that are solved one after another are the softer, the longer the row: 20 links sag
        three times too far at default settings. A rod has its stiffness at any length. What keeps
        its particles apart is a chain, added besides.

        A rest that is curved turns with the rod, by its state at the start of each projection. In
        2D it has a side. In 3D a row of points has no twist: the curvature has a size at rest, and
        bends the rod in the plane in which it happens to be bent (a straight one stays straight).

        Args:
            particles: Three or more particle indices, in order.
            bending_stiffness: EI [N m2].
            curvature: At rest, 1/radius [1/m], one or one for each particle but the first and last.
                In 2D positive where the row turns left; in 3D at least 0.
            spacing: Rest distance of neighbours [m]; as placed where None.
        """
        entries = as_indices(particles)
        if spacing is None:
            spacing = self._spacing(entries)
        self._rods.append(_Rod(entries, float(spacing), float(bending_stiffness), curvature))

    def add_hinge(
        self,
        edge: Sequence[int] | np.ndarray,
        wings: Sequence[int] | np.ndarray,
        *,
        bending_stiffness: float,
        angle: float | None = None,
    ) -> None:
        """Resist bending across the edge of two triangles, from a rest that may be creased (3D).

        The torque is 2 k sin((phi - rest)/2) for an angle phi, with k = stiffness edge^2 / (area
        of both triangles), which bends a sheet of right triangles with the stiffness asked for.

        Args:
            edge: The two particles that both triangles share.
            wings: The third particle of either triangle.
            bending_stiffness: B of the sheet [N m].
            angle: Rest angle in (-pi, pi) [rad], 0 for flat; as placed where None. Positive where
                the wings bend away from the side to which edge x (first wing) points.

        Raises:
            ValueError: If the model has two axes.
        """
        self._need_three_axes("hinge")
        corners = as_indices([*edge, *wings])
        self._hinges.append((corners, float(bending_stiffness), angle))

    def add_fold(
        self,
        edge: Sequence[int] | np.ndarray,
        wings: Sequence[int] | np.ndarray,
        *,
        bending_stiffness: float,
    ) -> None:
        """Resist bending across the edge of two triangles that are flat at rest (3D).

        The isometric bending of Bergou et al. 2006: a sum of the corners with constant weights,
        cheaper than a hinge and linear. It takes the triangles to keep their shape.

        Args:
            edge: The two particles that both triangles share.
            wings: The third particle of either triangle.
            bending_stiffness: B of the sheet [N m].

        Raises:
            ValueError: If the model has two axes.
        """
        self._need_three_axes("fold")
        self._folds.append((as_indices([*edge, *wings]), float(bending_stiffness)))

    def _need_three_axes(self, what: str) -> None:
        if self.dim != 3:
            raise ValueError(f"a {what} needs 3 axes; this model has {self.dim}")

    def _spacing(self, entries: np.ndarray) -> float:
        """Return the mean distance of neighbours as placed [m]; NaN where it is not even."""
        lengths = np.array([self._length(int(i), int(j)) for i, j in pairwise(entries)])
        even = len(lengths) and np.ptp(lengths) <= _EVEN * lengths.mean()
        return float(lengths.mean()) if even else np.nan

    def _bend_table(self) -> Bends:
        bends = Bends(
            triples=np.array([row[:3] for row in self._bends], dtype=np.int64).reshape(-1, 3),
            compliance=np.array([row[3] for row in self._bends], dtype=np.float64),
            friction=np.array([row[4] for row in self._bends], dtype=np.float64),
        )
        check_indices(bends.triples, self._count, "particles of bend")
        check_different(bends.triples, "bend")
        check_compliance(bends.compliance, "bend")
        wrong = ~(np.isfinite(bends.friction) & (bends.friction >= 0.0))
        refuse_if(wrong, "friction of bend", bends.friction, "finite and at least 0 [N]")
        check_duplicates(bends.triples, "bend")
        return bends

    def _rod_table(self) -> Rods | None:
        if not self._rods:
            return None
        self._check_rods()
        rest, compliance = [], []
        for rod in self._rods:
            inner = len(rod.particles) - 2
            curvature = np.broadcast_to(np.asarray(rod.curvature, dtype=np.float64), (inner,))
            turn = curvature * rod.spacing  # 2 sin(phi/2) for an angle phi of the joint
            rest.append(np.pad(turn * rod.spacing, 1))
            # the vector of a bent joint has the size 2 spacing sin(phi/2), which grows with
            # spacing cos(phi/2) per angle
            soft = rod.spacing**3 / rod.stiffness * (1.0 - 0.25 * turn * turn)
            compliance.append(np.pad(soft, 1))
        sizes = [len(rod.particles) for rod in self._rods]
        return Rods(
            offsets=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
            particles=joined([rod.particles for rod in self._rods], np.int64),
            rest=joined(rest, np.float64),
            compliance=joined(compliance, np.float64),
            curved=np.array([bool(np.any(turns)) for turns in rest], dtype=np.int64),
        )

    def _check_rods(self) -> None:
        for index, rod in enumerate(self._rods):
            name, count = f"rod {index}", len(rod.particles)
            if count < 3:
                raise ValueError(f"number of particles in {name} is {count}; a rod has at least 3")
            check_indices(rod.particles, self._count, f"particle of {name}, entry")
            check_different(rod.particles[None], name)
            if not (np.isfinite(rod.spacing) and rod.spacing > 0.0):
                raise ValueError(
                    f"spacing of {name} is {rod.spacing}; it must be positive [m], and particles "
                    "must be placed evenly where it is not given"
                )
            if not (np.isfinite(rod.stiffness) and rod.stiffness > 0.0):
                raise ValueError(
                    f"bending stiffness of {name} is {rod.stiffness}; it must be positive [N m2]"
                )
            curvature = np.asarray(rod.curvature, dtype=np.float64)
            if curvature.shape not in ((), (1,), (count - 2,)):
                raise ValueError(
                    f"curvature of {name} has shape {curvature.shape}; expected one number or one "
                    f"for each of {count - 2} joints"
                )
            least = -1.0 if self.dim == 2 else 0.0
            if not ((curvature * rod.spacing >= least) & (curvature * rod.spacing <= 1.0)).all():
                raise ValueError(
                    f"curvature of {name} is {rod.curvature}; allowed: from {least / rod.spacing} "
                    f"to {1.0 / rod.spacing} [1/m] with particles {rod.spacing} m apart"
                )

    def _hinge_table(self) -> Hinges | None:
        if not self._hinges:
            return None
        corners = np.array([corners for corners, *_ in self._hinges], dtype=np.int64)
        stiffness = np.array([stiffness for _, stiffness, _ in self._hinges])
        x = self._corner_positions(corners, stiffness, "hinge")
        cosine, sine = _half_angles(x)
        for index, (_, _, angle) in enumerate(self._hinges):
            if angle is not None:
                if not -np.pi < angle < np.pi:
                    raise ValueError(
                        f"rest angle of hinge {index} is {angle}; allowed: -pi to pi [rad]"
                    )
                cosine[index], sine[index] = portable.cos_sin(0.5 * angle)
        edge = x[:, 1] - x[:, 0]
        compliance = _areas(x) / (stiffness * np.sum(edge * edge, axis=1))
        check_duplicates(corners, "hinge")
        return Hinges(corners, cosine, sine, compliance)

    def _fold_table(self) -> Folds | None:
        if not self._folds:
            return None
        corners = np.array([corners for corners, _ in self._folds], dtype=np.int64)
        stiffness = np.array([stiffness for _, stiffness in self._folds])
        x = self._corner_positions(corners, stiffness, "fold")
        check_duplicates(corners, "fold")
        return Folds(corners, _isometric_weights(x), _areas(x) / stiffness)

    def _corner_positions(self, corners: np.ndarray, stiffness: np.ndarray, what: str) -> Any:
        """Return where the corners of hinges or folds are placed, (n, 4, 3) [m]; check them."""
        check_indices(corners, self._count, f"particles of {what}")
        check_different(corners, what)
        wrong = ~(np.isfinite(stiffness) & (stiffness > 0.0))
        refuse_if(wrong, f"bending stiffness of {what}", stiffness, "it must be positive [N m]")
        x = np.array(self._positions)[corners]
        edge = np.sum((x[:, 1] - x[:, 0]) ** 2, axis=1)
        for wing in (2, 3):
            normal = np.cross(x[:, 1] - x[:, 0], x[:, wing] - x[:, 0])
            wrong = ~(np.sum(normal * normal, axis=1) > _FLATTEST * edge * edge)
            refuse_if(wrong, f"a triangle of {what}", corners, "its area must be positive")
        return x


def _areas(x: np.ndarray) -> np.ndarray:
    """Return the area of both triangles together [m2] of corners (n, 4, 3)."""
    edge = x[:, 1] - x[:, 0]
    up, down = np.cross(edge, x[:, 2] - x[:, 0]), np.cross(edge, x[:, 3] - x[:, 0])
    return 0.5 * (np.sqrt(np.sum(up * up, axis=1)) + np.sqrt(np.sum(down * down, axis=1)))


def _half_angles(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return cosine and sine of half the angle between the triangles, each (n,)."""
    edge = x[:, 1] - x[:, 0]
    up, down = np.cross(edge, x[:, 2] - x[:, 0]), np.cross(x[:, 3] - x[:, 0], edge)
    scale = np.sqrt(np.sum(up * up, axis=1) * np.sum(down * down, axis=1))
    cosine = np.clip(np.sum(up * down, axis=1) / scale, -1.0, 1.0)
    side = np.where(np.sum(np.cross(up, down) * edge, axis=1) < 0.0, -1.0, 1.0)
    return np.sqrt(0.5 + 0.5 * cosine), side * np.sqrt(0.5 - 0.5 * cosine)


def _isometric_weights(x: np.ndarray) -> np.ndarray:
    """Return the weights of Bergou et al. 2006 (n, 4): sums of cotangents along the edge."""
    edge = x[:, 1] - x[:, 0]
    at_start = [_cotangent(edge, x[:, wing] - x[:, 0]) for wing in (2, 3)]
    at_end = [_cotangent(-edge, x[:, wing] - x[:, 1]) for wing in (2, 3)]
    return np.stack(
        [sum(at_end), sum(at_start), -at_start[0] - at_end[0], -at_start[1] - at_end[1]], axis=1
    )


def _cotangent(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    normal = np.cross(u, v)
    return np.sum(u * v, axis=1) / np.sqrt(np.sum(normal * normal, axis=1))

"""Particles of a ModelBuilder: where they are, what they weigh, which are pinned."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from pbd_gym.physics.bodies import Body
from pbd_gym.physics.checks import refuse_if
from pbd_gym.physics.tables import Particles

# Beyond this a mass or its inverse would leave the range of float32 in the solver [kg].
_LEAST_MASS = 1e-12


class ParticleBuilder:
    """Collects particles.

    Args:
        dim: Number of space axes, 2 or 3. The last axis points up.
    """

    def __init__(self, dim: int) -> None:
        if dim not in (2, 3):
            raise ValueError(f"dim is {dim!r}; a model has 2 or 3 axes")
        self.dim = dim
        self._positions: list[np.ndarray] = []
        self._masses: list[float] = []
        self._pinned: list[bool] = []
        self._grabbable: dict[int, None] = {}  # in the order in which they were named
        self._bodies: list[Body] = []

    def add_particles(self, positions: Any, mass: float, *, pinned: bool = False) -> np.ndarray:
        """Add particles of one mass and return their indices.

        Args:
            positions: (n, dim), or (dim,) for a single particle [m].
            mass: Of each particle [kg].
            pinned: Hold them: they move only by targets. The mass has no effect then.

        Raises:
            ValueError: If the positions do not have `dim` coordinates.
        """
        points = np.atleast_2d(np.array(positions, dtype=np.float64))
        if points.ndim != 2 or points.shape[1] != self.dim:
            raise ValueError(
                f"positions have shape {np.shape(positions)}; expected (n, {self.dim})"
            )
        first = len(self._masses)
        self._positions.extend(points)
        self._masses.extend([float(mass)] * len(points))
        self._pinned.extend([pinned] * len(points))
        return np.arange(first, first + len(points))

    def pin(self, particles: int | Iterable[int]) -> None:
        """Pin particles that were added before: from now on only targets move them.

        Raises:
            ValueError: If a particle does not exist.
        """
        for particle in np.atleast_1d(np.asarray(particles)):
            if not 0 <= particle < len(self._pinned):
                raise ValueError(f"cannot pin particle {particle}: there are {len(self._pinned)}")
            self._pinned[particle] = True

    def make_grabbable(self, particles: int | Iterable[int]) -> None:
        """Allow particles to be grabbed and released while time runs (`World.grabbed`).

        A grabbed particle is a pin: it moves only by its target. Released, it keeps the pin's
        velocity. Particles are grabbed and released in each world by itself.

        Raises:
            ValueError: If a particle does not exist or was made grabbable before.
        """
        for particle in as_indices(np.atleast_1d(np.asarray(particles))):
            if not 0 <= particle < len(self._pinned):
                raise ValueError(f"cannot grab particle {particle}: there are {len(self._pinned)}")
            if particle in self._grabbable:
                raise ValueError(f"particle {particle} is grabbable already")
            self._grabbable[int(particle)] = None

    def add_body(self, body: Body) -> None:
        """Tell a renderer what to draw."""
        self._bodies.append(body)

    @property
    def _count(self) -> int:
        """Number of particles so far."""
        return len(self._positions)

    def _particle_table(self, gravity: np.ndarray, always_grabs: bool) -> Particles:
        positions = np.array(self._positions, dtype=np.float64).reshape(-1, self.dim)
        masses = np.array(self._masses, dtype=np.float64)
        pinned = np.array(self._pinned, dtype=bool)
        if not len(positions):
            raise ValueError("the model has 0 particles; add at least one")
        wrong = ~np.isfinite(positions).all(axis=1)
        refuse_if(wrong, "position of particle", positions, "coordinates must be finite [m]")
        most = 1.0 / _LEAST_MASS
        wrong = ~((masses >= _LEAST_MASS) & (masses <= most)) & ~pinned
        allowed = f"a mass must be positive and finite, from {_LEAST_MASS} to {most} [kg]"
        refuse_if(wrong, "mass of particle", masses, allowed)
        if gravity.shape != (self.dim,) or not np.isfinite(gravity).all():
            raise ValueError(f"gravity is {gravity}; expected {self.dim} finite numbers [m/s2]")
        inverse_mass = 1.0 / np.where(pinned, np.inf, masses)
        grabbable = self._grabbable_table(pinned)
        grabs = grabbable if always_grabs or len(grabbable) else None
        return Particles(positions, inverse_mass, np.flatnonzero(pinned), grabs, gravity)

    def _grabbable_table(self, pinned: np.ndarray) -> np.ndarray:
        grabbable = np.array(list(self._grabbable), dtype=np.int64)
        refuse_if(pinned[grabbable], "grabbable particle", grabbable, "it is pinned for good")
        return grabbable

    def _length(self, i: int, j: int) -> float:
        """Distance of two particles as placed [m]; NaN where one does not exist (build refuses)."""
        if not (0 <= i < self._count and 0 <= j < self._count):
            return float("nan")
        return float(np.sqrt(np.sum((self._positions[i] - self._positions[j]) ** 2)))


def as_indices(particles: Any) -> np.ndarray:
    """Return particle indices as int64.

    Raises:
        TypeError: For other numbers: a float index is a mistake, not a number to round.
    """
    indices = np.asarray(particles).reshape(-1)
    if indices.dtype.kind not in "iu" and indices.size:
        raise TypeError(f"particles are {particles!r}; expected whole numbers")
    return indices.astype(np.int64)

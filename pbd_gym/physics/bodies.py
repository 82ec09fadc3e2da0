"""What a renderer draws of a model: which particles form a rope, a pendulum, a cloth, a body."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Strand:
    """A rope or chain, drawn as one line: particle indices in order and its radius [m]."""

    particles: tuple[int, ...]
    radius: float


@dataclass(frozen=True)
class Linkage:
    """Rods with a bob at every free end: a pendulum. Particle indices in order, rod radius [m]."""

    particles: tuple[int, ...]
    radius: float


@dataclass(frozen=True)
class Sheet:
    """A rectangular cloth: rows x columns of particle indices, and its half thickness [m].

    Cells in `holes` (row and column of the particle at which they begin) are missing.
    """

    particles: tuple[tuple[int, ...], ...]
    radius: float
    holes: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True)
class Polygon:
    """A body seen by its closed outline: particle indices once around.

    The outline is drawn as a smooth curve of a radius [m], or from corner to corner.
    """

    particles: tuple[int, ...]
    radius: float
    smooth: bool = True


@dataclass(frozen=True)
class Mesh:
    """A body seen by its surface: triangles of particle indices, anticlockwise from outside."""

    triangles: tuple[tuple[int, int, int], ...]

    @property
    def particles(self) -> tuple[int, ...]:
        """Particle indices of the surface, each once."""
        return tuple(sorted({particle for triangle in self.triangles for particle in triangle}))


@dataclass(frozen=True)
class Net:
    """Thin straight lines: a fabric of the plane, a truss, what is left of a cut cloth.

    Particle indices of each line in order, and its radius [m].
    """

    threads: tuple[tuple[int, ...], ...]
    radius: float

    @property
    def particles(self) -> tuple[int, ...]:
        """Particle indices of the lines, each once."""
        return tuple(sorted({particle for thread in self.threads for particle in thread}))


@dataclass(frozen=True)
class Balls:
    """Separate balls of one radius [m]: particle indices."""

    particles: tuple[int, ...]
    radius: float


Body = Strand | Linkage | Sheet | Polygon | Mesh | Net | Balls

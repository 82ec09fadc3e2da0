"""What a scene is made of: particles, links, soft bodies, obstacles and settings. Immutable."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

LOOKS = ("rope", "rods", "thread", "woven")
INTEGRATORS = ("pbd", "rattle", "both")
OBSTACLES = ("ball", "box")

# What the sliders may say: least and greatest value, and the unit.
RANGES = {
    "gravity": (0.0, 20.0, "m/s²"),
    "damping": (0.0, 5.0, "1/s"),
    "stiffness": (0.0, 4.0, "log N"),
    "substeps": (1, 40, ""),
    "restitution": (0.0, 1.0, ""),
    "friction": (0.0, 1.5, ""),
}
RIGID = 4.0  # stiffness from which links do not stretch


@dataclass(frozen=True)
class Settings:
    """What holds for the whole scene.

    Attributes:
        gravity: Downwards [m/s2].
        damping: Rate at which velocities decay [1/s].
        stiffness: Decimal logarithm of the links' EA [N]; `RIGID` for links that do not stretch.
        substeps: In 1/60 s.
        restitution: Of walls, obstacles and collisions.
        friction: Of walls, obstacles and collisions.
        integrator: "pbd" (the seed's), "rattle" (second order), or "both" side by side.
    """

    gravity: float = 9.81
    damping: float = 0.2
    stiffness: float = RIGID
    substeps: int = 10
    restitution: float = 0.2
    friction: float = 0.3
    integrator: str = "pbd"

    def __post_init__(self) -> None:
        for name, (low, high, unit) in RANGES.items():
            value = getattr(self, name)
            if not (_is_number(value) and low <= value <= high):
                raise ValueError(f"{name} is {value!r}; allowed: {low} to {high} {unit}".rstrip())
        if self.substeps != int(self.substeps):
            raise ValueError(f"substeps is {self.substeps!r}; expected a whole number")
        if self.integrator not in INTEGRATORS:
            allowed = ", ".join(INTEGRATORS)
            raise ValueError(f"integrator is {self.integrator!r}; allowed: {allowed}")


@dataclass(frozen=True)
class Particle:
    """A point mass.

    Attributes:
        position: At rest, (dim,) [m].
        mass: [kg].
        pinned: Whether only the mouse moves it.
    """

    position: tuple[float, ...]
    mass: float = 0.01
    pinned: bool = False

    def __post_init__(self) -> None:
        if not all(_is_number(value) for value in self.position):
            raise ValueError(f"position is {self.position!r}; coordinates must be finite [m]")
        if not (_is_number(self.mass) and self.mass > 0.0):
            raise ValueError(f"mass is {self.mass!r}; it must be positive [kg]")


@dataclass(frozen=True)
class Thread:
    """Links in a row, solved together.

    Attributes:
        particles: Two or more, each once.
        rest: Length of each link [m].
        look: "rope", "rods" with bobs, "thread" of a net, or "woven" into a fabric.
        radius: Drawn [m].
    """

    particles: tuple[int, ...]
    rest: tuple[float, ...]
    look: str = "rope"
    radius: float = 0.012

    def __post_init__(self) -> None:
        if len(self.rest) != len(self.particles) - 1 or not self.rest:
            raise ValueError(
                f"a thread has {len(self.particles)} particles and {len(self.rest)} lengths; "
                "expected 2 or more particles and a length for each link"
            )
        if self.look not in LOOKS:
            raise ValueError(f"look is {self.look!r}; allowed: {', '.join(LOOKS)}")


@dataclass(frozen=True)
class Strut:
    """A link by itself, an elastic one where it has a compliance [m/N]."""

    particles: tuple[int, int]
    rest: float
    compliance: float = 0.0
    shown: bool = True


@dataclass(frozen=True)
class Outline:
    """A soft body of the plane: an elastic closed line that keeps its area and draws to its shape.

    Attributes:
        particles: Once around.
        shape_stiffness: With which it is drawn to its shape [N/m].
        radius: With which it collides [m].
    """

    particles: tuple[int, ...]
    shape_stiffness: float = 60.0
    radius: float = 0.012


@dataclass(frozen=True)
class Skin:
    """A soft body of space: an elastic closed surface that keeps its volume.

    Attributes:
        triangles: Anticlockwise from outside.
        shape_stiffness: With which it is drawn to its shape [N/m].
    """

    triangles: tuple[tuple[int, int, int], ...]
    shape_stiffness: float = 20.0


@dataclass(frozen=True)
class Fabric:
    """A cloth to be drawn as a surface: rows of particles; its threads are among the scene's."""

    rows: tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class Balls:
    """Separate balls of one radius [m] that collide."""

    particles: tuple[int, ...]
    radius: float


@dataclass(frozen=True)
class Obstacle:
    """A solid that does not move: a "ball" of a radius or a "box" of half its edges [m]."""

    kind: str
    centre: tuple[float, ...]
    size: tuple[float, ...]

    def __post_init__(self) -> None:
        if self.kind not in OBSTACLES:
            raise ValueError(f"obstacle is {self.kind!r}; allowed: {', '.join(OBSTACLES)}")


@dataclass(frozen=True)
class Drawing:
    """A whole scene.

    Attributes:
        name: For the window's title.
        dim: 2 or 3; the last axis points up.
        view: Corners of the box that is shown, (dim,) each [m].
        walls: Whether all sides of that box are walls, or the floor alone.
        settings: What holds for all of it.
        particles: Point masses; all else refers to them by index.
    """

    name: str
    dim: int
    view: tuple[tuple[float, ...], tuple[float, ...]]
    particles: tuple[Particle, ...]
    walls: bool = False
    settings: Settings = field(default_factory=Settings)
    threads: tuple[Thread, ...] = ()
    struts: tuple[Strut, ...] = ()
    outlines: tuple[Outline, ...] = ()
    skins: tuple[Skin, ...] = ()
    fabrics: tuple[Fabric, ...] = ()
    balls: tuple[Balls, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()

    def __post_init__(self) -> None:
        if self.dim not in (2, 3):
            raise ValueError(f"dim is {self.dim!r}; a scene has 2 or 3 axes")
        if not self.particles:
            raise ValueError("the scene has no particles; it needs at least one")
        self._check_parts()
        if self.outlines and self.dim == 3:
            raise ValueError("an outline lies in the plane; this scene has 3 axes")
        if (self.skins or self.fabrics) and self.dim == 2:
            raise ValueError("skins and fabrics lie in space; this scene has 2 axes")

    def _check_parts(self) -> None:
        points = [particle.position for particle in self.particles]
        points += [*self.view, *(obstacle.centre for obstacle in self.obstacles)]
        for point in points:
            if len(point) != self.dim:
                raise ValueError(f"point {point} does not have the scene's {self.dim} coordinates")
        for index in self._indices():
            if not (isinstance(index, int) and 0 <= index < len(self.particles)):
                raise ValueError(f"particle {index!r} does not exist; {len(self.particles)} do")

    def _indices(self) -> Iterable[int]:
        for part in (*self.threads, *self.struts, *self.outlines, *self.balls):
            yield from part.particles
        for row in (row for fabric in self.fabrics for row in fabric.rows):
            yield from row
        for triangle in (triangle for skin in self.skins for triangle in skin.triangles):
            yield from triangle


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return math.isfinite(value)

"""Solid shapes that particles may not enter: planes, boxes, spheres, capsules."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict

import numpy as np

from pbd_gym.physics.building.particles import ParticleBuilder, as_indices
from pbd_gym.physics.checks import check_indices, refuse_if
from pbd_gym.physics.tables import Colliders

if TYPE_CHECKING:
    from typing_extensions import Unpack

_PLANE, _BOX, _CAPSULE = 0, 1, 2
# How far the axes of a box may be from unit vectors at right angles.
_ROUNDING = 1e-6


class SurfaceKeywords(TypedDict, total=False):
    """Keywords of every shape; described at `ColliderBuilder`."""

    margin: float
    restitution: float
    friction: float
    kinetic_friction: float | None


class _Surface(NamedTuple):
    """How particles touch a shape; described at `ColliderBuilder`."""

    margin: float
    restitution: float
    friction: float
    kinetic_friction: float


class _Shape(NamedTuple):
    """A row of the table of shapes, its points in the world and not yet from the pins."""

    kind: int
    pins: tuple[int | None, int | None]
    start: Any
    end: Any
    axes: Any
    size: Any
    surface: _Surface


class ColliderBuilder(ParticleBuilder):
    """Collects solid shapes.

    A shape is static, or pins carry it: it keeps its place relative to its pin as both were placed
    and never turns. All shapes take the same keywords:

    * margin: distance that particles keep from the surface [m];
    * restitution: in [0, 1]; 0 stops, 1 returns the whole normal velocity;
    * friction: Coulomb coefficient of what sticks;
    * kinetic_friction: of what slides, at most `friction`; the same where None.

    Contacts are found where particles are at the end of a substep of h seconds. A particle faster
    than half of a shape's thickness (margins included) per h can come out on the other side: at
    1/480 s a capsule of 1 cm radius stops what meets it at up to 4.8 m/s. A particle that begins
    inside is let out at 1 m/s and keeps no speed along the normal.
    """

    def __init__(self, dim: int) -> None:
        super().__init__(dim)
        self._shapes: list[_Shape] = []

    def add_plane(
        self, point: Any, normal: Any, *, pin: int | None = None, **surface: Unpack[SurfaceKeywords]
    ) -> None:
        """Fill the half space behind a plane.

        Args:
            point: (dim,) on the plane [m].
            normal: (dim,) out of the solid, of any length.
            pin: Pin that carries the plane; None for a static one.
            surface: margin, restitution, friction, kinetic_friction.

        Raises:
            ValueError: If the point or the normal does not have `dim` coordinates.
        """
        axes = np.zeros((self.dim, self.dim))
        with np.errstate(invalid="ignore"):  # a normal of length 0 is refused by build
            axes[0] = self._point("normal", normal) / np.linalg.norm(normal)
        at = self._point("point", point)
        self._add_shape(_PLANE, (pin, pin), at, at, axes, np.zeros(self.dim), surface)

    def add_box(
        self,
        centre: Any,
        half_extents: Any,
        *,
        axes: Any = None,
        pin: int | None = None,
        **surface: Unpack[SurfaceKeywords],
    ) -> None:
        """Add a solid box.

        Args:
            centre: (dim,) [m].
            half_extents: (dim,) half the length of the edges [m].
            axes: (dim, dim) directions of the edges, one in each row: unit vectors at right angles.
                The world's axes where None.
            pin: Pin that carries the box; None for a static one.
            surface: margin, restitution, friction, kinetic_friction.

        Raises:
            ValueError: If an argument does not have the shape given above.
        """
        rows = np.eye(self.dim) if axes is None else np.array(axes, dtype=np.float64)
        if rows.shape != (self.dim, self.dim):
            raise ValueError(f"axes have shape {rows.shape}; expected {(self.dim, self.dim)}")
        at, half = self._point("centre", centre), self._point("half_extents", half_extents)
        self._add_shape(_BOX, (pin, pin), at, at, rows, half, surface)

    def add_sphere(
        self,
        centre: Any,
        radius: float,
        *,
        pin: int | None = None,
        **surface: Unpack[SurfaceKeywords],
    ) -> None:
        """Add a ball (a disc in the plane).

        Args:
            centre: (dim,) [m].
            radius: [m].
            pin: Pin that carries the ball; None for a static one.
            surface: margin, restitution, friction, kinetic_friction.

        Raises:
            ValueError: If the centre does not have `dim` coordinates.
        """
        self.add_capsule(centre, centre, radius, pins=(pin, pin), **surface)

    def add_capsule(
        self,
        start: Any,
        end: Any,
        radius: float,
        *,
        pins: tuple[int | None, int | None] = (None, None),
        **surface: Unpack[SurfaceKeywords],
    ) -> None:
        """Add a rod with round ends: all within a radius of the line from start to end.

        Args:
            start: (dim,) [m].
            end: (dim,) [m].
            radius: [m].
            pins: Pins that carry the start and the end; with two different ones the rod turns and
                stretches as they move. None for a static end.
            surface: margin, restitution, friction, kinetic_friction.

        Raises:
            ValueError: If an end does not have `dim` coordinates.
        """
        size = np.full(self.dim, float(radius))
        ends = self._point("start", start), self._point("end", end)
        axes = np.zeros((self.dim, self.dim))
        self._add_shape(_CAPSULE, pins, *ends, axes, size, surface)

    def _add_shape(
        self,
        kind: int,
        pins: tuple[int | None, int | None],
        start: np.ndarray,
        end: np.ndarray,
        axes: np.ndarray,
        size: np.ndarray,
        surface: SurfaceKeywords,
    ) -> None:
        self._shapes.append(_Shape(kind, pins, start, end, axes, size, _surface(**surface)))

    def _point(self, name: str, value: Any) -> np.ndarray:
        point = np.array(value, dtype=np.float64)
        if point.shape != (self.dim,):
            raise ValueError(f"{name} has shape {point.shape}; expected {(self.dim,)}")
        return point

    def _collider_table(self, always: bool) -> Colliders | None:
        shapes = self._shapes
        if not shapes and not always:
            return None
        row = (len(shapes), self.dim)
        pins = self._carriers()
        offsets = np.array([*self._positions, np.zeros(self.dim)])  # the last of what is static
        surfaces = np.array([shape.surface for shape in shapes]).reshape(-1, len(_Surface._fields))
        table = Colliders(
            kinds=np.array([shape.kind for shape in shapes], dtype=np.int64),
            pins=pins,
            starts=np.reshape([shape.start for shape in shapes], row) - offsets[pins[:, 0]],
            ends=np.reshape([shape.end for shape in shapes], row) - offsets[pins[:, 1]],
            axes=np.reshape([shape.axes for shape in shapes], (len(shapes), self.dim**2)).astype(
                float
            ),
            sizes=np.reshape([shape.size for shape in shapes], row).astype(float),
            margin=surfaces[:, 0].copy(),
            restitution=surfaces[:, 1].copy(),
            friction=surfaces[:, 2].copy(),
            kinetic_friction=surfaces[:, 3].copy(),
        )
        _check_colliders(table, self.dim)
        return table

    def _carriers(self) -> np.ndarray:
        """Return the pins that carry the shapes, (C, 2); -1 for none."""
        named = [pin for shape in self._shapes for pin in shape.pins if pin is not None]
        pins = as_indices(named)
        check_indices(pins, self._count, "pin of colliders")
        wrong = ~np.array(self._pinned, dtype=bool)[pins]
        refuse_if(wrong, "pin of colliders", pins, "a particle that carries one must be pinned")
        carriers = [[-1 if pin is None else pin for pin in shape.pins] for shape in self._shapes]
        return np.array(carriers, dtype=np.int64).reshape(-1, 2)


def _surface(
    *,
    margin: float = 0.0,
    restitution: float = 0.0,
    friction: float = 0.0,
    kinetic_friction: float | None = None,
) -> _Surface:
    kinetic = friction if kinetic_friction is None else kinetic_friction
    return _Surface(float(margin), float(restitution), float(friction), float(kinetic))


def _check_colliders(table: Colliders, dim: int) -> None:
    points = np.concatenate([table.starts, table.ends], axis=1)
    wrong = ~np.isfinite(points).all(axis=1)
    refuse_if(wrong, "place of collider", points, "coordinates must be finite [m]")
    axes = table.axes.reshape(-1, dim, dim)
    wrong = (table.kinds == _PLANE) & ~np.isfinite(axes).all(axis=(1, 2))
    refuse_if(wrong, "normal of collider", axes[:, 0], "its length must be positive and finite")
    square = axes @ axes.transpose(0, 2, 1)
    wrong = (table.kinds == _BOX) & ~(np.abs(square - np.eye(dim)) < _ROUNDING).all(axis=(1, 2))
    refuse_if(wrong, "axes of collider", axes, "they must be unit vectors at right angles")
    wrong = (table.kinds != _PLANE) & ~(np.isfinite(table.sizes) & (table.sizes > 0.0)).all(axis=1)
    refuse_if(wrong, "size of collider", table.sizes, "it must be positive and finite [m]")
    limits = {"margin": np.inf, "restitution": 1.0, "friction": np.inf}
    for name, most in limits.items():
        values = getattr(table, name)
        wrong = ~(np.isfinite(values) & (values >= 0.0) & (values <= most))
        refuse_if(wrong, f"{name} of collider", values, f"allowed: finite, from 0.0 to {most}")
    kinetic = table.kinetic_friction
    wrong = ~((kinetic >= 0.0) & (kinetic <= table.friction))
    refuse_if(wrong, "kinetic friction of collider", kinetic, "from 0.0 to the friction of rest")

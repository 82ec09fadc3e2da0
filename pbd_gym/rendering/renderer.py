"""The Renderer: a Model and positions in, a picture out."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from pbd_gym.physics.model import Model
from pbd_gym.rendering.canvas import Canvas
from pbd_gym.rendering.planar import PlanarPainter
from pbd_gym.rendering.scene import Segment
from pbd_gym.rendering.spatial import SpatialPainter

if TYPE_CHECKING:
    import pygame

MIN_SIZE = 32  # [pixels]; nothing can be told apart on less


class Renderer:
    """Draws a model in any state, without a display and without knowing the task.

    Planar models are seen from the front, x to the right and y up. Spatial models, with z up, are
    seen in perspective from a fixed place. pygame is imported at the first `draw`. The same state
    gives the same bytes.

    Args:
        model: What is drawn.
        view: Lower and upper corner of the box to frame, (dim,) each [m].
        size: Width and height of the picture [pixels], even numbers of at least 32.
        rails: Pairs of points (dim,) [m] between which pins are guided, drawn as rails.

    Raises:
        ValueError: If the size, the view or a rail cannot be drawn.
    """

    def __init__(
        self,
        model: Model,
        view: tuple[Any, Any],
        *,
        size: tuple[int, int] = (512, 512),
        rails: Sequence[Segment] = (),
    ) -> None:
        self.model = model
        self.size = check_size(size)
        self._view = _check_view(view, model.dim)
        self._rails = tuple(_check_rail(rail, model.dim) for rail in rails)
        self._canvas: Canvas | None = None
        self._painter: PlanarPainter | SpatialPainter | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        # Surfaces cannot be pickled or copied; they are painted anew when first needed.
        make = partial(Renderer, size=self.size, rails=self._rails)
        return make, (self.model, self._view)

    def draw(self, x: Any, goal: Any = None, goal_radius: float = 0.0) -> np.ndarray:
        """Draw one state.

        Args:
            x: Positions (N, dim) [m]. A particle that is not finite is left out.
            goal: Where particles shall go, (N, dim) [m], NaN for those that may go anywhere. A body
                with a goal for each of its particles is drawn translucent there, other goals as
                translucent discs.
            goal_radius: How near to its goal a particle counts as arrived [m].

        Returns:
            A fresh C-contiguous array (height, width, 3) of uint8.

        Raises:
            ValueError: If a shape does not fit the model or the radius is negative or not finite.
        """
        return self._paint(x, goal, goal_radius).frame()

    def draw_on(self, surface: pygame.Surface, x: Any) -> None:
        """Draw one state on a pygame surface of the renderer's size: faster than `draw`.

        Args:
            surface: Of any format.
            x: Positions (N, dim) [m].

        Raises:
            ValueError: If a shape does not fit.
        """
        if surface.get_size() != self.size:
            raise ValueError(f"surface has size {surface.get_size()}; the picture has {self.size}")
        self._paint(x, None, 0.0).show_on(surface)

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return where points (M, dim) [m] are seen: pixels (M, 2), and their depths (M,) [m]."""
        canvas, painter = self._ready()
        pixels, depths = painter.camera.project(points)
        return pixels * (self.size[0] / canvas.size[0]), depths

    def unproject(self, pixels: np.ndarray, depths: np.ndarray) -> np.ndarray:
        """Return the points (M, dim) [m] that are seen at pixels (M, 2), at depths (M,) [m]."""
        canvas, painter = self._ready()
        return painter.camera.unproject(pixels * (canvas.size[0] / self.size[0]), depths)

    def _paint(self, x: Any, goal: Any, goal_radius: float) -> Canvas:
        """Draw one state on the canvas."""
        points = self._visible("x", x)
        targets = None if goal is None else self._visible("goal", goal)
        if not (np.isfinite(goal_radius) and goal_radius >= 0.0):
            raise ValueError(f"goal_radius is {goal_radius!r}; it must be finite and at least 0")
        canvas, painter = self._ready()
        canvas.clear()
        painter.paint(points, targets, float(goal_radius))
        return canvas

    def _ready(self) -> tuple[Canvas, PlanarPainter | SpatialPainter]:
        """Return canvas and painter, made when first needed."""
        if self._canvas is None or self._painter is None:
            self._canvas = Canvas(self.size)
            painter = PlanarPainter if self.model.dim == 2 else SpatialPainter
            self._painter = painter(self.model, self._view, self._canvas, self._rails)
        return self._canvas, self._painter

    def _visible(self, name: str, points: Any) -> np.ndarray:
        """Return points as float64, NaN for those that no picture can show."""
        array = np.array(points, dtype=np.float64)
        shape = (len(self.model.inverse_mass), self.model.dim)
        if array.shape != shape:
            raise ValueError(f"{name} has shape {array.shape}; the model needs {shape}")
        # Pixel coordinates of particles that flew off must still fit pygame's integers.
        lower, upper = self._view
        reach = 10.0 * float(np.max(upper - lower))
        near = (array > lower - reach) & (array < upper + reach)
        array[~near.all(axis=1)] = np.nan
        return array


def check_size(size: Any) -> tuple[int, int]:
    """Return a picture's width and height as integers.

    Raises:
        ValueError: If it is not a pair of integers, or a side is odd or too small.
    """
    try:
        width, height = (operator.index(side) for side in size)
    except (TypeError, ValueError):
        raise ValueError(f"size is {size!r}; it must be two integers, width and height") from None
    for side in (width, height):
        if side % 2 or side < MIN_SIZE:
            raise ValueError(f"size is {size!r}; sides must be even and at least {MIN_SIZE} pixels")
    return width, height


def _check_view(view: Any, dim: int) -> tuple[np.ndarray, np.ndarray]:
    corners = np.array(view, dtype=np.float64)
    if corners.shape != (2, dim) or not np.isfinite(corners).all():
        raise ValueError(f"view is {view!r}; it must be two finite corners of {dim} axes each")
    if not (corners[0] < corners[1]).all():
        raise ValueError(f"view is {view!r}; the lower corner must lie below the upper")
    return corners[0], corners[1]


def _check_rail(rail: Any, dim: int) -> Segment:
    ends = np.array(rail, dtype=np.float64)
    if ends.shape != (2, dim) or not np.isfinite(ends).all():
        raise ValueError(f"rail is {rail!r}; it must be two finite points of {dim} axes each")
    return ends[0].tolist(), ends[1].tolist()

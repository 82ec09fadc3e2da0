"""The Renderer: a Model and positions in, a picture out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from pbd_gym.physics.model import Model
from pbd_gym.rendering.canvas import Canvas
from pbd_gym.rendering.look import Look, Viewpoint
from pbd_gym.rendering.marks import paint_clock
from pbd_gym.rendering.planar import PlanarPainter
from pbd_gym.rendering.scene import Segment, tips
from pbd_gym.rendering.spatial import SpatialPainter
from pbd_gym.rendering.strain import Strains, paint_legend

if TYPE_CHECKING:
    import pygame


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
        camera: "default", "front", "side", "top" or a `Viewpoint`.
        color: "material", or "strain": how much longer or shorter every link is than it shall be,
            from blue to red, with a legend in percent.
        theme: "light" or "dark".
        show: Any of "scale", "clock" and "trail"; the last two are drawn if `draw` is told them.

    Raises:
        ValueError: For anything that cannot be drawn.

    Attributes:
        model: As given.
        look: Size, camera, colours and what is shown.
        tips: Free ends of ropes and pendulums and free corners of cloths, (K,): whose trail is
            worth showing.
    """

    def __init__(
        self,
        model: Model,
        view: tuple[Any, Any],
        *,
        size: tuple[int, int] = (512, 512),
        rails: Sequence[Segment] = (),
        camera: str | Viewpoint = "default",
        color: str = "material",
        theme: str = "light",
        show: Sequence[str] = ("scale",),
    ) -> None:
        self.model = model
        self.look = Look(size, camera, color, theme, show)
        self.size = self.look.size
        self.tips = tips(model)
        self._view = _check_view(view, model.dim)
        self._rails = tuple(_check_rail(rail, model.dim) for rail in rails)
        self._strains = Strains(model, theme) if color == "strain" else None
        self._canvas: Canvas | None = None
        self._painter: PlanarPainter | SpatialPainter | None = None
        self._goal: tuple[bytes, float] = (b"", 0.0)
        self._with_goal = np.zeros((0, 0, 3), dtype=np.uint8)

    def __reduce__(self) -> tuple[Any, ...]:
        # Pictures need not be pickled or copied; they are painted anew when first needed.
        look = {spec.name: getattr(self.look, spec.name) for spec in fields(self.look)}
        make = partial(Renderer, rails=self._rails, **look)
        return make, (self.model, self._view)

    def draw(
        self,
        x: Any,
        goal: Any = None,
        goal_radius: float = 0.0,
        *,
        time: float | None = None,
        trail: Any = None,
    ) -> np.ndarray:
        """Draw one state.

        Args:
            x: Positions (N, dim) [m]. A particle that is not finite is left out.
            goal: Where particles shall go, (N, dim) [m], NaN for those that may go anywhere. A body
                with a goal for each of its particles is drawn translucent there, other goals as
                translucent discs.
            goal_radius: How near to its goal a particle counts as arrived [m].
            time: On the clock, if one is shown [s].
            trail: Where some points were, (T, K, dim) [m] from the oldest on, NaN where the trail
                is broken; drawn if trails are shown.

        Returns:
            A fresh C-contiguous array (height, width, 3) of uint8.

        Raises:
            ValueError: If a shape does not fit the model or the radius is negative or not finite.
        """
        return self._paint(x, goal, goal_radius, time, trail).frame()

    def draw_on(
        self,
        surface: pygame.Surface,
        x: Any,
        goal: Any = None,
        goal_radius: float = 0.0,
        *,
        time: float | None = None,
        trail: Any = None,
    ) -> None:
        """Draw one state on a pygame surface of the renderer's size and of any format.

        The other arguments are those of `draw`.

        Raises:
            ValueError: If a shape does not fit.
        """
        if surface.get_size() != self.size:
            raise ValueError(f"surface has size {surface.get_size()}; the picture has {self.size}")
        self._paint(x, goal, goal_radius, time, trail).show_on(surface)

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return where points (M, dim) [m] are seen: pixels (M, 2), and their depths (M,) [m]."""
        return self._ready()[1].camera.project(points)

    def unproject(self, pixels: np.ndarray, depths: np.ndarray) -> np.ndarray:
        """Return the points (M, dim) [m] that are seen at pixels (M, 2), at depths (M,) [m]."""
        return self._ready()[1].camera.unproject(pixels, depths)

    def _paint(
        self, x: Any, goal: Any, goal_radius: float, time: float | None, trail: Any
    ) -> Canvas:
        """Draw one state on the canvas."""
        points = self._visible("x", x)
        targets = None if goal is None else self._visible("goal", goal)
        if not (np.isfinite(goal_radius) and goal_radius >= 0.0):
            raise ValueError(f"goal_radius is {goal_radius!r}; it must be finite and at least 0")
        canvas, painter = self._ready()
        self._begin(canvas, painter, targets, float(goal_radius))
        shown = self.look.show
        past = self._past(trail) if "trail" in shown and trail is not None else None
        painter.paint(points, targets, past)
        if self._strains is not None:
            paint_legend(canvas, self._strains, self.look.colours)
        if "clock" in shown and time is not None:
            paint_clock(canvas, time, self.look.colours)
        return canvas

    def _ready(self) -> tuple[Canvas, PlanarPainter | SpatialPainter]:
        """Return canvas and painter, made when first needed."""
        if self._canvas is None or self._painter is None:
            self._canvas = Canvas(self.size)
            painter = PlanarPainter if self.model.dim == 2 else SpatialPainter
            self._painter = painter(
                self.model, self._view, self._canvas, self._rails, self.look, self._strains
            )
        return self._canvas, self._painter

    def _begin(
        self,
        canvas: Canvas,
        painter: PlanarPainter | SpatialPainter,
        goal: np.ndarray | None,
        goal_radius: float,
    ) -> None:
        """Start a picture with the goal, which seldom changes: the last one is kept."""
        if goal is None:
            canvas.clear()
            return
        if (goal.tobytes(), goal_radius) != self._goal:
            canvas.clear()
            painter.paint_goal(goal, goal_radius)
            self._goal, self._with_goal = (goal.tobytes(), goal_radius), canvas.frame()
        canvas.paste(self._with_goal)

    def _visible(self, name: str, points: Any) -> np.ndarray:
        """Return points as float64, NaN for those that no picture can show."""
        array = np.array(points, dtype=np.float64)
        shape = (len(self.model.inverse_mass), self.model.dim)
        if array.shape != shape:
            raise ValueError(f"{name} has shape {array.shape}; the model needs {shape}")
        return self._near(array)

    def _past(self, trail: Any) -> np.ndarray:
        """Return a trail as float64."""
        array = np.array(trail, dtype=np.float64)
        if array.ndim != 3 or array.shape[2] != self.model.dim:
            raise ValueError(f"trail has shape {array.shape}; expected (T, K, {self.model.dim})")
        return self._near(array.reshape(-1, self.model.dim)).reshape(array.shape)

    def _near(self, points: np.ndarray) -> np.ndarray:
        """Put NaN for points (M, dim) that flew off, whose pixels no picture counts."""
        lower, upper = self._view
        reach = 10.0 * float(np.max(upper - lower))
        near = (points > lower - reach) & (points < upper + reach)
        points[~near.all(axis=1)] = np.nan
        return points


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

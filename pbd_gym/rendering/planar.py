"""Pictures of the plane: x to the right, y up, on squared paper."""

from __future__ import annotations

import numpy as np

from pbd_gym.physics.bodies import Balls, Body, Linkage, Mesh, Net, Polygon, Sheet, Strand
from pbd_gym.physics.model import Model
from pbd_gym.rendering import palette
from pbd_gym.rendering.camera import OrthographicCamera
from pbd_gym.rendering.canvas import Canvas
from pbd_gym.rendering.colliders import outline, placed
from pbd_gym.rendering.curves import finite_rows, finite_runs, smooth_line, smooth_loop
from pbd_gym.rendering.marks import (
    BEAD,
    GHOST,
    paint_bead,
    paint_beads,
    paint_cart,
    paint_gripper,
    paint_target,
)
from pbd_gym.rendering.palette import Colour
from pbd_gym.rendering.scene import (
    Segment,
    bob_radius,
    grippers,
    loose_particles,
    particles_of,
    round_length,
    split_goals,
    threads_of,
)

_MARGIN = 0.05
_INSIDE = 0.55  # how much paler a body is than its outline


class PlanarPainter:
    """Draws a model of two dimensions.

    Args:
        model: What is drawn.
        view: Two corners (2,) of the box to frame [m].
        canvas: On which it is drawn.
        rails: Segments along which pins are guided [m].
    """

    def __init__(
        self,
        model: Model,
        view: tuple[np.ndarray, np.ndarray],
        canvas: Canvas,
        rails: tuple[Segment, ...],
    ) -> None:
        self._model = model
        self._canvas = canvas
        self.camera = OrthographicCamera.framing(*view, canvas.size, _MARGIN)
        self._loose, self._pins = loose_particles(model), grippers(model)
        self._riders = {i for b in model.bodies if isinstance(b, Linkage) for i in b.particles}
        self._paint_background(rails)

    def paint(self, x: np.ndarray, goal: np.ndarray | None, goal_radius: float) -> None:
        """Draw positions (N, 2) and goals (N, 2) [m]; what is not finite is left out."""
        model, canvas = self._model, self._canvas
        bodies, singles = split_goals(model, goal)
        if goal is not None:
            self._paint_goals(bodies, singles, self._project(goal), goal_radius)
        pixels = self._project(x)
        self._paint_colliders(x)
        for body in model.bodies:
            self._paint_body(body, pixels, palette.BLUE, palette.DARK_BLUE)
        visible = finite_rows(pixels)
        loose = pixels[self._loose[visible[self._loose]]]
        paint_beads(canvas, loose, BEAD * canvas.unit, palette.BLUE, palette.DARK_BLUE)
        for pixel in pixels[singles[visible[singles]]]:
            paint_bead(canvas, pixel, BEAD * canvas.unit, palette.ORANGE, palette.DARK_ORANGE)
        for pin in self._pins[visible[self._pins]]:
            paint_pin = paint_cart if int(pin) in self._riders else paint_gripper
            paint_pin(canvas, pixels[pin])

    def _paint_colliders(self, x: np.ndarray) -> None:
        reach = 2.0 * max(self._canvas.size) / self.camera.pixels_per_metre
        for shape in placed(self._model, x):
            corners = self._project(outline(shape, self.camera.centre, reach))
            self._canvas.polygon(corners, palette.WALL)
            rim = np.concatenate([corners, corners[:1]])
            self._canvas.stroke(rim, 2.0 * self._canvas.unit, palette.WALL_EDGE)

    def _paint_goals(
        self, bodies: list[Body], singles: np.ndarray, targets: np.ndarray, goal_radius: float
    ) -> None:
        """Draw translucent bodies and discs where bodies and single particles shall go."""
        for body in bodies:
            reach = self._reach(body)
            with self._canvas.translucent(GHOST, targets[particles_of(body).ravel()], reach):
                self._paint_body(body, targets, palette.ORANGE, palette.DARK_ORANGE)
        for target in targets[singles]:
            paint_target(self._canvas, target, goal_radius * self.camera.pixels_per_metre)

    def _project(self, points: np.ndarray) -> np.ndarray:
        pixels, _ = self.camera.project(points)
        return pixels

    def _width(self, radius: float) -> float:
        """Width of a line that shows a radius [m], never too thin to see [canvas pixels]."""
        return max(2.0 * radius * self.camera.pixels_per_metre, 5.0 * self._canvas.unit)

    def _reach(self, body: Body) -> float:
        """How far from its particles a body is drawn [canvas pixels]."""
        bobs = bob_radius(self._model, body).max() if isinstance(body, Linkage) else 0.0
        radius = 0.0 if isinstance(body, Mesh) else body.radius
        size = max(self._width(radius), bobs * self.camera.pixels_per_metre)
        # A smooth curve bulges out between particles, by less than a tenth of the view.
        return size + 50.0 * self._canvas.unit

    def _paint_body(self, body: Body, pixels: np.ndarray, fill: Colour, edge: Colour) -> None:
        if isinstance(body, Linkage):
            self._paint_linkage(body, pixels, fill, edge)
        elif isinstance(body, Net):
            runs = [run for t in threads_of(body) for run in finite_runs(pixels[t])]
            width = max(2.0 * body.radius * self.camera.pixels_per_metre, self._canvas.unit)
            self._canvas.polylines([run for run in runs if len(run) > 1], width, edge)
        elif isinstance(body, Balls):
            points = pixels[particles_of(body)]
            radius = max(body.radius * self.camera.pixels_per_metre, self._canvas.unit)
            paint_beads(self._canvas, points[finite_rows(points)], radius, fill, edge)
        elif isinstance(body, Polygon):
            self._paint_polygon(body, pixels, fill, edge)
        elif isinstance(body, Mesh):
            for triangle in body.triangles:
                outline = Polygon(triangle, 0.0, smooth=False)
                self._paint_polygon(outline, pixels, fill, edge)
        else:
            self._paint_lines(body, pixels, fill, edge)

    def _paint_lines(
        self, body: Strand | Sheet, pixels: np.ndarray, fill: Colour, edge: Colour
    ) -> None:
        particles = particles_of(body)
        width = self._width(body.radius)
        # A planar sheet is seen edge-on by nobody: its threads are drawn.
        threads = [*particles, *particles.T] if isinstance(body, Sheet) else [particles]
        lines = [smooth_line(run, 3) for t in threads for run in finite_runs(pixels[t])]
        for line in lines:
            self._canvas.stroke(line, width + 1.6 * self._canvas.unit, edge)
        for line in lines:
            self._canvas.stroke(line, width - 0.8 * self._canvas.unit, fill)

    def _paint_polygon(
        self, polygon: Polygon, pixels: np.ndarray, fill: Colour, edge: Colour
    ) -> None:
        """Fill the inside and draw the outline; nothing if a corner is not finite."""
        corners = pixels[particles_of(polygon)]
        if not np.isfinite(corners).all():
            return
        outline = smooth_loop(corners, 3) if polygon.smooth else corners
        closed = np.concatenate([outline, outline[:1]])
        width = self._width(polygon.radius)
        self._canvas.stroke(closed, width + 1.6 * self._canvas.unit, edge)
        self._canvas.polygon(outline, palette.mix(fill, palette.PAPER, _INSIDE))
        self._canvas.stroke(closed, width - 0.8 * self._canvas.unit, fill)

    def _paint_linkage(
        self, linkage: Linkage, pixels: np.ndarray, fill: Colour, edge: Colour
    ) -> None:
        canvas = self._canvas
        points = pixels[particles_of(linkage)]
        for run in finite_runs(points):
            canvas.stroke(run, self._width(linkage.radius), palette.STEEL)
        radii = bob_radius(self._model, linkage) * self.camera.pixels_per_metre
        for point, radius in zip(points, radii, strict=True):
            if radius > 0.0 and np.isfinite(point).all():
                paint_bead(canvas, point, max(radius, 4.0 * canvas.unit), fill, edge)

    def _paint_background(self, rails: tuple[Segment, ...]) -> None:
        canvas = self._canvas
        canvas.surface.fill(palette.PAPER)
        cell = round_length(80.0 * canvas.unit / self.camera.pixels_per_metre)
        self._paint_grid(cell)
        self._paint_walls()
        for rail in rails:
            ends = self._project(np.array(rail, dtype=np.float64))
            canvas.stroke(ends, 4.0 * canvas.unit, palette.LIGHT_STEEL)
            for end in ends:
                canvas.disc(end, 5.0 * canvas.unit, palette.STEEL)
        self._paint_scale(cell)
        canvas.keep_as_background()

    def _paint_grid(self, cell: float) -> None:
        canvas = self._canvas
        corners = self.camera.unproject(np.array([[0.0, canvas.size[1]], [canvas.size[0], 0.0]]))
        for axis in (0, 1):
            first, last = np.ceil(corners[0, axis] / cell), np.floor(corners[1, axis] / cell)
            for line in np.arange(first, last + 1.0):
                ends = corners.copy()
                ends[:, axis] = line * cell
                colour = palette.GRID if line else palette.AXIS
                canvas.stroke(self._project(ends), (1.0 if line else 1.6) * canvas.unit, colour)

    def _paint_walls(self) -> None:
        canvas = self._canvas
        far = np.array(canvas.size) * 2.0
        for axis in (0, 1):
            for wall, outside in ((self._model.room.lower, -1), (self._model.room.upper, 1)):
                if not np.isfinite(wall[axis]):
                    continue
                place = np.where(np.arange(2) == axis, wall[axis], self.camera.centre)
                pixel = self._project(place[None])[0][axis]
                # Pixels count downwards, so what is outside below has the larger numbers.
                beyond = pixel + far[axis] * outside * (1 if axis == 0 else -1)
                self._paint_half(axis, pixel, beyond)

    def _paint_half(self, axis: int, pixel: float, beyond: float) -> None:
        """Fill the solid between a wall's surface and far beyond it."""
        canvas = self._canvas
        span = (-10.0, max(canvas.size) + 10.0)
        edge = pixel + np.sign(beyond - pixel) * 2.0 * canvas.unit
        for until, colour in ((beyond, palette.WALL), (edge, palette.WALL_EDGE)):
            ends = ((pixel, span[0]), (until, span[1]))
            (a, b), (c, d) = ends
            canvas.bar(*(((a, b), (c, d)) if axis == 0 else ((b, a), (d, c))), colour)

    def _paint_scale(self, cell: float) -> None:
        canvas, u = self._canvas, self._canvas.unit
        left, bottom = 14.0 * u, canvas.size[1] - 14.0 * u
        right = left + cell * self.camera.pixels_per_metre
        canvas.stroke(np.array([[left, bottom], [right, bottom]]), 1.6 * u, palette.INK)
        for end in (left, right):
            canvas.stroke(np.array([[end, bottom - 4 * u], [end, bottom]]), 1.6 * u, palette.INK)
        middle = ((left + right) / 2.0, bottom - 11.0 * u)
        canvas.text(f"{cell:g} m", middle, 19.0 * u, palette.INK)

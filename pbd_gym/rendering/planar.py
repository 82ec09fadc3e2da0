"""Pictures of the plane: x to the right, y up, on squared paper."""

from __future__ import annotations

import numpy as np

from pbd_gym.physics.bodies import Balls, Body, Linkage, Mesh, Net, Polygon, Sheet, Strand
from pbd_gym.physics.model import Model
from pbd_gym.rendering.backdrop import paint_backdrop
from pbd_gym.rendering.camera import OrthographicCamera
from pbd_gym.rendering.canvas import Canvas
from pbd_gym.rendering.colliders import outline, placed
from pbd_gym.rendering.curves import finite_rows, finite_spans, smooth_line, smooth_loop
from pbd_gym.rendering.look import Look
from pbd_gym.rendering.marks import (
    BEAD,
    GHOST,
    paint_beads,
    paint_cart,
    paint_gripper,
    paint_rods,
    paint_target,
    paint_trail,
    paler,
)
from pbd_gym.rendering.palette import Colour
from pbd_gym.rendering.scene import (
    Segment,
    ball_radius,
    bob_radius,
    grippers,
    loose_links,
    loose_particles,
    particles_of,
    payload_radius,
    split_goals,
    threads_of,
)
from pbd_gym.rendering.strain import Strains

_MARGIN = 0.05
_PIECES = 3  # of the curve between two particles


class PlanarPainter:
    """Draws a model of two dimensions.

    Args:
        model: What is drawn.
        view: Two corners (2,) of the box to frame [m].
        canvas: On which it is drawn.
        rails: Segments along which pins are guided [m].
        look: How it looks.
        strains: Colours of strains, or None where bodies have the colours of their material.
    """

    def __init__(
        self,
        model: Model,
        view: tuple[np.ndarray, np.ndarray],
        canvas: Canvas,
        rails: tuple[Segment, ...],
        look: Look,
        strains: Strains | None,
    ) -> None:
        self._model = model
        self._canvas = canvas
        self._theme = look.colours
        self._strains = strains
        self._x = model.positions
        zoom = look.viewpoint.zoom
        self.camera = OrthographicCamera.framing(*view, canvas.size, _MARGIN, zoom)
        self._riders = {i for b in model.bodies if isinstance(b, Linkage) for i in b.particles}
        self._loose, self._links = loose_particles(model), loose_links(model)
        self._pins = grippers(model)
        paint_backdrop(canvas, self.camera, model.room, rails, look)

    def paint_goal(self, goal: np.ndarray, goal_radius: float) -> None:
        """Draw goals (N, 2) [m]: translucent bodies, and discs where single particles shall go."""
        canvas, targets = self._canvas, self._project(goal)
        bodies, singles = split_goals(self._model, goal)
        for body in bodies:
            with canvas.translucent(GHOST, targets[particles_of(body).ravel()], self._reach(body)):
                self._paint_body(body, targets, self._theme.goal, solid=False)
        for target in targets[singles]:
            paint_target(canvas, target, goal_radius * self.camera.pixels_per_metre, self._theme)

    def paint(self, x: np.ndarray, goal: np.ndarray | None, trail: np.ndarray | None) -> None:
        """Draw positions (N, 2) and trails (T, K, 2) [m]; what is not finite is left out.

        Single particles with a goal (N, 2) have its colour.
        """
        model, canvas, theme = self._model, self._canvas, self._theme
        self._x = x
        _, singles = split_goals(model, goal)
        pixels = self._project(x)
        self._paint_colliders(x)
        for points in () if trail is None else trail.swapaxes(0, 1):
            paint_trail(canvas, self._project(points), theme)
        self._paint_links(self._links, pixels, 3.5 * canvas.unit, theme.steel, solid=True)
        for body in model.bodies:
            self._paint_body(body, pixels, theme.body, solid=True)
        self._paint_particles(self._loose, pixels, theme.body)
        self._paint_particles(singles, pixels, theme.goal)
        visible = finite_rows(pixels)
        for pin in self._pins:
            if visible[pin]:
                paint_pin = paint_cart if int(pin) in self._riders else paint_gripper
                paint_pin(canvas, pixels[pin], theme)

    def _paint_particles(self, particles: np.ndarray, pixels: np.ndarray, colour: Colour) -> None:
        """Draw balls as large as their masses, never too small to see."""
        seen = particles[finite_rows(pixels[particles])]
        radii = ball_radius(self._model, seen) * self.camera.pixels_per_metre
        radii = np.maximum(radii, BEAD * self._canvas.unit)
        fills = np.broadcast_to(np.array(colour, dtype=np.float64), (len(seen), 3))
        paint_beads(self._canvas, pixels[seen], radii, fills, self._theme)

    def _paint_links(
        self, links: np.ndarray, pixels: np.ndarray, width: float, fill: Colour, *, solid: bool
    ) -> None:
        """Draw straight lines between particles (M, 2) of a width [pixels]."""
        ends = pixels[links]
        seen = np.isfinite(ends).all(axis=(1, 2))
        colours: Colour | np.ndarray = fill
        if self._strains is not None and solid:
            colours = self._strains.colours(self._strains.of_pairs(links, self._x))[seen]
        self._canvas.strokes(ends[seen], width, colours)

    def _paint_colliders(self, x: np.ndarray) -> None:
        reach = 2.0 * max(self._canvas.size) / self.camera.pixels_per_metre
        for shape in placed(self._model, x):
            corners = self._project(outline(shape, self.camera.centre, reach))
            self._canvas.polygon(corners, self._theme.wall)
            rim = np.concatenate([corners, corners[:1]])
            self._canvas.stroke(rim, max(2.0 * self._canvas.unit, 1.0), self._theme.wall_edge)

    def _project(self, points: np.ndarray) -> np.ndarray:
        pixels, _ = self.camera.project(points)
        return pixels

    def _width(self, radius: float) -> float:
        """Width of a line that shows a radius [m], never too thin to see [pixels]."""
        return max(2.0 * radius * self.camera.pixels_per_metre, 5.0 * self._canvas.unit)

    def _reach(self, body: Body) -> float:
        """How far from its particles a body is drawn [pixels]."""
        bobs = bob_radius(self._model, body).max() if isinstance(body, Linkage) else 0.0
        radius = 0.0 if isinstance(body, Mesh) else body.radius
        size = max(self._width(radius), bobs * self.camera.pixels_per_metre)
        # A smooth curve bulges out between particles, by less than a tenth of the view.
        return size + 50.0 * self._canvas.unit

    def _paint_body(self, body: Body, pixels: np.ndarray, fill: Colour, *, solid: bool) -> None:
        """Draw a body, or (not solid) the ghost that shows where it shall go."""
        if isinstance(body, Polygon):
            self._paint_polygon(body, pixels, fill, solid=solid)
        elif isinstance(body, Mesh):
            for triangle in body.triangles:
                outline = Polygon(triangle, 0.0, smooth=False)
                self._paint_polygon(outline, pixels, fill, solid=solid)
        elif isinstance(body, Net):
            width = max(2.0 * body.radius * self.camera.pixels_per_metre, self._canvas.unit)
            self._paint_links(threads_of(body), pixels, width, fill, solid=solid)
        elif isinstance(body, Balls):
            particles = particles_of(body)
            radii = np.full(len(particles), body.radius)
            self._paint_bobs(particles, radii, pixels, fill, least=1.0)
        else:
            self._paint_lines(body, pixels, fill, solid=solid)

    def _paint_lines(
        self, body: Strand | Sheet | Linkage, pixels: np.ndarray, fill: Colour, *, solid: bool
    ) -> None:
        if isinstance(body, Sheet):
            # A planar sheet is seen edge-on by nobody: its threads are drawn.
            particles = particles_of(body)
            self._paint_rows([*particles, *particles.T], body.radius, pixels, fill, solid=solid)
        elif isinstance(body, Strand):
            self._paint_rows([particles_of(body)], body.radius, pixels, fill, solid=solid)
            radius = payload_radius(self._model, body)
            if radius > 0.0:
                self._paint_bobs(np.array(body.particles[-1:]), np.array([radius]), pixels, fill)
        else:
            self._paint_linkage(body, pixels, fill, solid=solid)

    def _paint_rows(
        self,
        rows: list[np.ndarray],
        radius: float,
        pixels: np.ndarray,
        fill: Colour,
        *,
        solid: bool,
    ) -> None:
        """Draw smooth lines through particles in rows."""
        ends, colours = [], []
        for row in rows:
            for span in finite_spans(pixels[row]):
                line = smooth_line(pixels[row[span]], _PIECES)
                ends.append(np.stack([line[:-1], line[1:]], axis=1))
                colours.append(self._colours(row[span], len(line) - 1, fill, solid=solid))
        if ends:
            width = self._width(radius)
            paint_rods(self._canvas, np.concatenate(ends), width, np.concatenate(colours))

    def _colours(self, row: np.ndarray, pieces: int, fill: Colour, *, solid: bool) -> np.ndarray:
        """Return the colours (pieces, 3) of a line through particles (M,) in a row."""
        if self._strains is None or not solid or len(row) < 2:
            return np.broadcast_to(np.array(fill, dtype=np.float64), (pieces, 3))
        return np.repeat(self._strains.of_row(row, self._x), pieces // (len(row) - 1), axis=0)

    def _paint_polygon(
        self, polygon: Polygon, pixels: np.ndarray, fill: Colour, *, solid: bool
    ) -> None:
        """Fill the inside and draw the outline; nothing if a corner is not finite."""
        particles = particles_of(polygon)
        corners = pixels[particles]
        if not np.isfinite(corners).all():
            return
        outline = smooth_loop(corners, _PIECES) if polygon.smooth else corners
        closed = np.concatenate([outline, outline[:1]])
        around = np.concatenate([particles, particles[:1]])
        colours = self._colours(around, len(outline), fill, solid=solid)
        ends = np.stack([closed[:-1], closed[1:]], axis=1)
        width = self._width(polygon.radius)
        self._canvas.strokes(ends, width + 1.6 * self._canvas.unit, colours * 0.55)
        inside = self._strains.of_content(particles, self._x) if self._strains and solid else None
        if self._strains is not None and inside is not None:
            red, green, blue = self._strains.colours(np.array(inside))
            fill = (round(red), round(green), round(blue))
        self._canvas.polygon(outline, paler(fill, self._theme))
        self._canvas.strokes(ends, width - 0.8 * self._canvas.unit, colours)

    def _paint_linkage(
        self, linkage: Linkage, pixels: np.ndarray, fill: Colour, *, solid: bool
    ) -> None:
        particles = particles_of(linkage)
        for span in finite_spans(pixels[particles]):
            row = particles[span]
            colours = self._colours(row, len(row) - 1, self._theme.steel, solid=solid)
            width = self._width(linkage.radius)
            if self._strains is None or not solid:
                self._canvas.stroke(pixels[row], width, colours)
            else:  # what is not strained is as pale as the paper: its edge shows it
                ends = np.stack([pixels[row[:-1]], pixels[row[1:]]], axis=1)
                paint_rods(self._canvas, ends, width, colours)
        radii = bob_radius(self._model, linkage)
        self._paint_bobs(particles[radii > 0.0], radii[radii > 0.0], pixels, fill)

    def _paint_bobs(
        self,
        particles: np.ndarray,
        radii: np.ndarray,
        pixels: np.ndarray,
        fill: Colour,
        least: float = 4.0,
    ) -> None:
        """Draw balls of radii (M,) [m], none smaller than `least` [units]."""
        seen = finite_rows(pixels[particles])
        sizes = np.maximum(radii * self.camera.pixels_per_metre, least * self._canvas.unit)[seen]
        fills = np.broadcast_to(np.array(fill, dtype=np.float64), (len(sizes), 3))
        paint_beads(self._canvas, pixels[particles[seen]], sizes, fills, self._theme)

"""Pictures of space: z up, in perspective, over a tiled floor with soft shadows."""

from __future__ import annotations

import numpy as np

from pbd_gym.physics.bodies import Balls, Body, Linkage, Mesh, Net, Polygon, Sheet, Strand
from pbd_gym.physics.model import Model
from pbd_gym.rendering.camera import PerspectiveCamera
from pbd_gym.rendering.canvas import Canvas
from pbd_gym.rendering.colliders import CAPSULE, patches, placed
from pbd_gym.rendering.curves import finite_rows, finite_spans, smooth_line
from pbd_gym.rendering.depths import Depths
from pbd_gym.rendering.floor import paint_floor
from pbd_gym.rendering.look import Look
from pbd_gym.rendering.marks import BEAD, GHOST, gripper_lines, paint_target, paint_trail
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
from pbd_gym.rendering.shadow import shadow_patches
from pbd_gym.rendering.strain import Strains
from pbd_gym.rendering.weave import shade, weave

_MARGIN = 0.03
_LIGHT = np.array([-0.45, -0.35, 1.0]) / np.linalg.norm([-0.45, -0.35, 1.0])  # towards the lamp
_PATCHES = 33  # a cloth is drawn with about this many patches along each side
_PIECES = 3  # of the curve between two particles
_CREASE = 0.8  # cosine of the angle to its facets from which on a corner is smooth


class SpatialPainter:
    """Draws a model of three dimensions.

    Args:
        model: What is drawn.
        view: Two corners (3,) of the box to frame [m].
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
        self._extent = float(np.max(view[1] - view[0]))
        self._centre = (view[0] + view[1]) / 2.0
        stand = look.viewpoint
        azimuth, elevation = np.radians(stand.azimuth), np.radians(stand.elevation)
        self.camera = PerspectiveCamera.framing(
            *view, canvas.size, _MARGIN, azimuth, elevation, stand.zoom
        )
        self._scene = Depths(canvas, self.camera, _LIGHT)
        self._loose, self._links = loose_particles(model), loose_links(model)
        paint_floor(canvas, self.camera, view, model.room, rails, look)

    def paint_goal(self, goal: np.ndarray, goal_radius: float) -> None:
        """Draw goals (N, 3) [m]: translucent bodies, and discs where single particles shall go."""
        bodies, singles = split_goals(self._model, goal)
        for body in bodies:
            self._add_body(body, goal, solid=False)
        self._scene.lay(GHOST)
        for body in bodies:
            if isinstance(body, Sheet):
                self._paint_rim(body, goal)
        for centre in goal[singles]:
            self._paint_goal(centre, goal_radius)

    def paint(self, x: np.ndarray, goal: np.ndarray | None, trail: np.ndarray | None) -> None:
        """Draw positions (N, 3) and trails (T, K, 3) [m]; what is not finite is left out.

        What covers the goal (N, 3) of a cloth lets its rim shine through.
        """
        model = self._model
        bodies, singles = split_goals(model, goal)
        if np.isfinite(model.room.lower[2]):
            self._paint_shadows(x)
        for points in () if trail is None else trail.swapaxes(0, 1):
            paint_trail(self._canvas, self.camera.project(points)[0], self._theme)
        self._add_everything(x, singles)
        self._scene.lay()
        if goal is not None:
            for sheet in (body for body in bodies if isinstance(body, Sheet)):
                pixels, _ = self.camera.project(goal[particles_of(sheet).ravel()])
                with self._canvas.translucent(0.4, pixels, 4.0 * self._canvas.unit):
                    self._paint_rim(sheet, goal)

    def _add_everything(self, x: np.ndarray, with_goal: np.ndarray) -> None:
        theme, scene = self._theme, self._scene
        self._add_colliders(x)
        for body in self._model.bodies:
            self._add_body(body, x, solid=True)
        self._add_links(self._links, 0.0, x, theme.steel, solid=True)
        for particles, colour in ((self._loose, theme.body), (with_goal, theme.goal)):
            scene.add_balls(x[particles], ball_radius(self._model, particles), colour, BEAD)
        for point in x[grippers(self._model)]:
            scene.add_marks(point, *gripper_lines(self._canvas.unit, theme))

    def _add_colliders(self, x: np.ndarray) -> None:
        colour = np.array(self._theme.light_steel, dtype=np.float64)
        for shape in placed(self._model, x):
            # What lies upon a shape is drawn between its particles, where it may reach below it.
            if shape.kind == CAPSULE:
                radius = float(shape.size[0])
                ends = np.stack([shape.start, shape.end])[None]
                self._scene.add_lines(ends, radius, colour, behind=0.08 * radius)
                continue
            corners = patches(shape, self._centre, 0.5 * self._extent)
            edge = float(np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1).max())
            normals = _facets(corners)[:, None]
            lit = shade(corners, normals, self.camera.eye, _LIGHT, (colour, colour))
            self._scene.add_mesh(corners, np.broadcast_to(lit, corners.shape), 0.5 * edge)

    def _add_body(self, body: Body, x: np.ndarray, *, solid: bool) -> None:
        """Add a body at positions (N, 3) [m], or (not solid) the ghost of where it shall go."""
        theme = self._theme
        fill = theme.body if solid else theme.goal
        if isinstance(body, Sheet):
            self._add_sheet(body, x, solid=solid)
        elif isinstance(body, Mesh):
            self._add_surface(body, x, fill, solid=solid)
        elif isinstance(body, Net):
            self._add_links(threads_of(body), body.radius, x, fill, solid=solid)
        elif isinstance(body, Balls):
            particles = particles_of(body)
            radii = np.full(len(particles), body.radius)
            self._scene.add_balls(x[particles], radii, fill, 1.0)
        elif isinstance(body, Linkage):
            particles, radii = particles_of(body), bob_radius(self._model, body)
            self._add_row(particles, body.radius, x, theme.steel, 1, solid=solid)
            bobs = radii > 0.0
            self._scene.add_balls(x[particles[bobs]], radii[bobs], fill, 4.0)
        else:
            particles = particles_of(body)
            around = particles[:1] if isinstance(body, Polygon) else particles[:0]
            row = np.concatenate([particles, around])
            self._add_row(row, body.radius, x, fill, _PIECES, solid=solid)
            load = payload_radius(self._model, body) if isinstance(body, Strand) else 0.0
            if load > 0.0:
                self._scene.add_balls(x[particles[-1:]], np.array([load]), fill, 4.0)

    def _add_links(
        self, links: np.ndarray, radius: float, x: np.ndarray, fill: Colour, *, solid: bool
    ) -> None:
        """Add straight round lines between particles (M, 2)."""
        colours: Colour | np.ndarray = fill
        if self._strains is not None and solid:
            colours = self._strains.colours(self._strains.of_pairs(links, x))
        self._scene.add_lines(x[links], radius, colours)

    def _add_row(
        self,
        row: np.ndarray,
        radius: float,
        x: np.ndarray,
        fill: Colour,
        pieces: int,
        *,
        solid: bool,
    ) -> None:
        """Add a round line through particles (M,) in a row."""
        for span in finite_spans(x[row]):
            line = smooth_line(x[row[span]], pieces)
            colours = np.broadcast_to(np.array(fill, dtype=np.float64), (len(line) - 1, 3))
            links = max(span.stop - span.start - 1, 1)
            if self._strains is not None and solid:
                strained = self._strains.of_row(row[span], x)
                colours = np.repeat(strained, (len(line) - 1) // links, axis=0)
            self._scene.add_lines(np.stack([line[:-1], line[1:]], axis=1), radius, colours)

    def _add_sheet(self, sheet: Sheet, x: np.ndarray, *, solid: bool) -> None:
        points = x[particles_of(sheet)]
        pieces = max(1, round(_PATCHES / max(points.shape[:2]))) if solid else 1
        if not solid:
            front = back = np.array(self._theme.goal, dtype=np.float64)
        elif self._strains is not None:
            strain = self._strains.of_grid(particles_of(sheet), x)
            front = back = self._strains.colours(strain)
        else:
            front, back = (np.array(side, float) for side in (self._theme.front, self._theme.back))
        eye, sides = self.camera.eye, (front, back)
        self._scene.add_mesh(*weave(points, pieces, eye, _LIGHT, sides, sheet.holes))

    def _add_surface(self, body: Mesh, x: np.ndarray, fill: Colour, *, solid: bool) -> None:
        """Add the triangles of a body, rounded where they meet at a small angle."""
        triangles = np.array(body.triangles)
        triangles = triangles[np.isfinite(x[triangles]).all(axis=(1, 2))]
        corners = x[triangles]
        facet = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        around = np.zeros_like(x)
        np.add.at(around, triangles, facet[:, None])
        around /= np.maximum(np.linalg.norm(around, axis=1, keepdims=True), 1e-12)
        facet /= np.maximum(np.linalg.norm(facet, axis=1, keepdims=True), 1e-12)
        smooth = around[triangles]
        flat = np.einsum("tkd,td->tk", smooth, facet)[:, :, None] < _CREASE
        normals = np.where(flat, facet[:, None], smooth)
        colour = np.array(fill, dtype=np.float64)
        if self._strains is not None and solid:
            colour = self._strains.colours(self._strains.of_particles(x)[triangles])
        colours = shade(corners, normals, self.camera.eye, _LIGHT, (colour, colour))
        quads = [0, 1, 2, 2]
        self._scene.add_mesh(corners[:, quads], colours[:, quads])

    def _paint_rim(self, sheet: Sheet, goal: np.ndarray) -> None:
        """Draw the rim of a cloth's goal."""
        grid = particles_of(sheet)
        rim = np.concatenate([grid[0], grid[1:, -1], grid[-1, -2::-1], grid[-2::-1, 0]])
        pixels, _ = self.camera.project(goal[rim])
        for span in finite_spans(pixels):
            width = max(1.6 * self._canvas.unit, 1.0)
            self._canvas.stroke(pixels[span], width, self._theme.goal_edge)

    def _paint_goal(self, centre: np.ndarray, goal_radius: float) -> None:
        """Draw where a single particle shall go: the ball around it, seen from anywhere a disc."""
        pixels, depths = self.camera.project(centre[None])
        if finite_rows(pixels).all():
            radius = goal_radius * self.camera.scale(float(depths[0]))
            paint_target(self._canvas, pixels[0], radius, self._theme)

    def _paint_shadows(self, x: np.ndarray) -> None:
        corners, height = shadow_patches(self._model, x, _LIGHT)
        pixels, _ = self.camera.project(corners.reshape(-1, 3))
        quads = pixels.reshape(-1, 4, 2)
        seen = np.isfinite(quads).all(axis=(1, 2))
        darkness = self._theme.shade / (1.0 + height[seen] / (0.5 * self._extent))
        self._canvas.shadow(quads[seen], darkness, self._theme.shadow)


def _facets(corners: np.ndarray) -> np.ndarray:
    """Return the normals (Q, 3) of patches (Q, 4, 3)."""
    return np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])

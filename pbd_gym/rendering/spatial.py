"""Pictures of space: z up, in perspective, over a tiled floor with soft shadows."""

from __future__ import annotations

import numpy as np

from pbd_gym.physics.bodies import Balls, Body, Linkage, Mesh, Net, Polygon, Sheet, Strand
from pbd_gym.physics.model import Model
from pbd_gym.rendering import palette
from pbd_gym.rendering.camera import PerspectiveCamera
from pbd_gym.rendering.canvas import Canvas
from pbd_gym.rendering.colliders import lit, patches, placed
from pbd_gym.rendering.curves import finite_runs, smooth_line
from pbd_gym.rendering.display_list import DisplayList
from pbd_gym.rendering.floor import floor_pixels
from pbd_gym.rendering.marks import GHOST, paint_target
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
from pbd_gym.rendering.shadow import shadow_patches
from pbd_gym.rendering.weave import shade, weave

Tones = tuple[Colour, Colour]  # of a body and of its edge or inside

_MARGIN = 0.03
_AZIMUTH, _ELEVATION = float(np.radians(-62.0)), float(np.radians(32.0))
_LIGHT = np.array([-0.45, -0.35, 1.0]) / np.linalg.norm([-0.45, -0.35, 1.0])  # towards the lamp
_SOLID = (palette.BLUE, palette.DARK_BLUE)  # fill and edge of what is there
_GHOSTLY = (palette.ORANGE, palette.DARK_ORANGE)  # and of what shall be there
_DARKEST = 0.42  # opacity of a shadow that its body touches
_PATCHES = 24  # a cloth is drawn with about this many patches along each side


class SpatialPainter:
    """Draws a model of three dimensions.

    Args:
        model: What is drawn.
        view: Two corners (3,) of the box to frame [m].
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
        self._extent = float(np.max(view[1] - view[0]))
        self._centre = (view[0] + view[1]) / 2.0
        self.camera = PerspectiveCamera.framing(*view, canvas.size, _MARGIN, _AZIMUTH, _ELEVATION)
        self._paint_background(view, rails)

    def paint(self, x: np.ndarray, goal: np.ndarray | None, goal_radius: float) -> None:
        """Draw positions (N, 3) and goals (N, 3) [m]; what is not finite is left out."""
        model = self._model
        bodies, singles = split_goals(model, goal)
        sheets = [body for body in bodies if isinstance(body, Sheet)]
        if goal is not None:
            for body in bodies:
                self._paint_ghost(body, goal)
            for sheet in sheets:
                self._paint_rim(sheet, goal)
            for centre in goal[singles]:
                self._paint_goal(centre, goal_radius)
        if np.isfinite(model.room.lower[2]):
            self._paint_shadows(x)
        self._paint_bodies(x, singles)
        if goal is not None:
            for sheet in sheets:
                pixels, _ = self.camera.project(goal[particles_of(sheet).ravel()])
                with self._canvas.translucent(0.4, pixels, 4.0 * self._canvas.unit):
                    self._paint_rim(sheet, goal)

    def _paint_bodies(self, x: np.ndarray, with_goal: np.ndarray) -> None:
        scene = DisplayList(self._canvas, self.camera)
        for shape in placed(self._model, x):
            corners = patches(shape, self._centre, 0.5 * self._extent)
            # what lies upon a shape may be drawn in patches that reach below it
            edge = float(np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1).max())
            scene.add_mesh(*lit(corners, self.camera.eye, _LIGHT, palette.LIGHT_STEEL), edge)
        for body in self._model.bodies:
            self._add_body(scene, body, x, ghost=False)
        for point in x[loose_particles(self._model)]:
            scene.add_ball(point, 0.0, *_SOLID)
        for point in x[with_goal]:
            scene.add_ball(point, 0.0, *_GHOSTLY)
        for point in x[grippers(self._model)]:
            scene.add_gripper(point)
        scene.draw()

    def _add_body(self, scene: DisplayList, body: Body, x: np.ndarray, *, ghost: bool) -> None:
        """Add a body at positions (N, 3) [m], or the ghost that shows where it shall go."""
        fill, edge = _GHOSTLY if ghost else _SOLID
        if isinstance(body, Sheet):
            points = x[particles_of(body)]
            pieces = 1 if ghost else max(1, round(_PATCHES / max(points.shape[:2])))
            sides = (fill, fill) if ghost else (palette.PALE_BLUE, palette.CLOTH_BLUE)
            scene.add_mesh(*weave(points, pieces, self.camera.eye, _LIGHT, sides, body.holes))
        elif isinstance(body, Mesh):
            self._add_surface(scene, body, x, (fill, edge))
        elif isinstance(body, Linkage):
            self._add_linkage(scene, body, x, (fill, edge))
        elif isinstance(body, Balls):
            for point in x[particles_of(body)]:
                scene.add_ball(point, body.radius, fill, edge)
        else:
            self._add_lines(scene, body, x, (fill, edge))

    def _add_lines(
        self, scene: DisplayList, body: Strand | Polygon | Net, x: np.ndarray, tones: Tones
    ) -> None:
        """Add lines through particles; those of a net are straight."""
        if isinstance(body, Net):
            runs = [run for thread in threads_of(body) for run in finite_runs(x[thread])]
        else:
            points = x[particles_of(body)]
            closed = points[:1] if isinstance(body, Polygon) else points[:0]
            around = finite_runs(np.concatenate([points, closed]))
            runs = [smooth_line(run, 3) for run in around]
        for run in runs:
            scene.add_line(run, body.radius, *tones)

    def _add_linkage(self, scene: DisplayList, body: Linkage, x: np.ndarray, tones: Tones) -> None:
        """Add rods and the bobs between them."""
        points = x[particles_of(body)]
        for run in finite_runs(points):
            scene.add_line(run, body.radius, palette.STEEL, palette.DARK_STEEL)
        for point, radius in zip(points, bob_radius(self._model, body), strict=True):
            if radius > 0.0:
                scene.add_ball(point, radius, *tones)

    def _add_surface(self, scene: DisplayList, body: Mesh, x: np.ndarray, sides: Tones) -> None:
        """Add the triangles of a body; its inside, where one looks in, has the second colour."""
        corners = x[np.array(body.triangles)]
        corners = corners[np.isfinite(corners).all(axis=(1, 2))]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        tone = np.ones(len(corners))
        scene.add_mesh(corners, shade(corners, normal, tone, self.camera.eye, _LIGHT, sides))

    def _paint_ghost(self, body: Body, goal: np.ndarray) -> None:
        """Draw a body where all its particles shall go."""
        scene = DisplayList(self._canvas, self.camera)
        self._add_body(scene, body, goal, ghost=True)
        pixels, depth = self.camera.project(goal[particles_of(body).ravel()])
        bob = float(bob_radius(self._model, body).max()) if isinstance(body, Linkage) else 0.0
        pad = 20.0 * self._canvas.unit + bob * self.camera.scale(float(depth.min()))
        with self._canvas.translucent(GHOST, pixels, pad):
            scene.draw()

    def _paint_rim(self, sheet: Sheet, goal: np.ndarray) -> None:
        """Draw the rim of a cloth's goal; over the cloth it makes what is covered shine through."""
        grid = particles_of(sheet)
        rim = np.concatenate([grid[0], grid[1:, -1], grid[-1, -2::-1], grid[-2::-1, 0]])
        pixels, _ = self.camera.project(goal[rim])
        for run in finite_runs(pixels):
            self._canvas.stroke(run, 1.6 * self._canvas.unit, palette.DARK_ORANGE)

    def _paint_goal(self, centre: np.ndarray, goal_radius: float) -> None:
        """Draw where a single particle shall go: the ball around it, seen from anywhere a disc."""
        pixels, depths = self.camera.project(centre[None])
        if np.isfinite(pixels).all():
            radius = goal_radius * self.camera.scale(float(depths[0]))
            paint_target(self._canvas, pixels[0], radius)

    def _paint_shadows(self, x: np.ndarray) -> None:
        patches, height = shadow_patches(self._model, x, _LIGHT)
        pixels, _ = self.camera.project(patches.reshape(-1, 3))
        corners = pixels.reshape(-1, 4, 2)
        seen = np.isfinite(corners).all(axis=(1, 2))
        darkness = _DARKEST / (1.0 + height[seen] / (0.5 * self._extent))
        self._canvas.shadow(corners[seen], darkness, palette.SHADOW)

    def _paint_background(
        self, view: tuple[np.ndarray, np.ndarray], rails: tuple[Segment, ...]
    ) -> None:
        canvas, model = self._canvas, self._model
        tile = round_length(self._extent / 6.0)
        room = (model.room.lower, model.room.upper)
        canvas.paste(floor_pixels(self.camera, canvas.size, view, room, tile))
        for rail in rails:
            ends, _ = self.camera.project(np.array(rail, dtype=np.float64))
            canvas.stroke(ends, 4.0 * canvas.unit, palette.LIGHT_STEEL)
        if np.isfinite(model.room.lower[2]):
            place = (48.0 * canvas.unit, canvas.size[1] - 16.0 * canvas.unit)
            canvas.text(f"tile {tile:g} m", place, 19.0 * canvas.unit, palette.INK)
        canvas.keep_as_background()

"""What one picture of space shows, drawn from the far to the near."""

from __future__ import annotations

from collections.abc import Callable
from operator import itemgetter
from typing import Any

import numpy as np

from pbd_gym.rendering.camera import PerspectiveCamera
from pbd_gym.rendering.canvas import Canvas, ribbon
from pbd_gym.rendering.marks import BEAD, paint_bead, paint_gripper
from pbd_gym.rendering.palette import Colour

_EDGE = 1.2  # width of the dark edge of a line [units]


class DisplayList:
    """Collects shapes in space and draws them so that near ones hide far ones.

    Points that are not finite or behind the camera are left out.

    Args:
        canvas: On which is drawn.
        camera: From where is looked.
    """

    def __init__(self, canvas: Canvas, camera: PerspectiveCamera) -> None:
        self._canvas = canvas
        self._camera = camera
        # Depth [m], function and arguments.
        self._items: list[tuple[float, Callable[..., Any], tuple[Any, ...]]] = []

    def add_mesh(self, patches: np.ndarray, colours: np.ndarray, behind: float = 0.0) -> None:
        """Add polygons with K corners each (Q, K, 3) [m], in colours (Q, 3).

        They hide only what lies deeper by more than `behind` [m].
        """
        pixels, depth = self._camera.project(patches.reshape(-1, 3))
        corners = pixels.reshape(*patches.shape[:2], 2)
        depth = depth.reshape(patches.shape[:2]).mean(axis=1)
        seen = np.isfinite(corners).all(axis=(1, 2))
        self._add_polygons(corners[seen], depth[seen] + behind, colours[seen])

    def add_line(self, points: np.ndarray, radius: float, fill: Colour, edge: Colour) -> None:
        """Add a round line through points (M, 3) [m] of a radius [m], with a dark edge."""
        pixels, depth = self._camera.project(points)
        if not np.isfinite(pixels).all():
            return
        between = (depth[1:] + depth[:-1]) / 2.0
        thick = self._canvas.unit * _EDGE
        # The edge lies so far behind that it hides nothing of the neighbouring pieces.
        behind = 2.0 * radius + float(np.abs(np.diff(depth)).max(initial=0.0))
        for colour, extra, back in ((edge, thick, behind), (fill, -thick, 0.0)):
            widths = np.array([2.0 * self._pixel_radius(radius, d) + extra for d in depth])
            quads = ribbon(pixels, widths[1:])
            colours = np.broadcast_to(np.array(colour), (len(quads), 3))
            self._add_polygons(quads, between + back, colours)
            for pixel, width, d in zip(pixels, widths, depth, strict=True):
                self._add(d + back, self._canvas.disc, (pixel, width / 2.0, colour))

    def add_ball(self, centre: np.ndarray, radius: float, fill: Colour, edge: Colour) -> None:
        """Add a ball (3,) [m] with a highlight, of a radius [m] and never too small to see."""
        pixels, depths = self._camera.project(centre[None])
        pixel, depth = pixels[0], float(depths[0])
        if not np.isfinite(pixel).all():
            return
        size = max(radius * self._camera.scale(depth), BEAD * self._canvas.unit)
        self._add(depth - radius, paint_bead, (self._canvas, pixel, size, fill, edge))

    def add_gripper(self, point: np.ndarray) -> None:
        """Add a gripper that holds a point (3,) [m]."""
        pixels, depths = self._camera.project(point[None])
        depth = float(depths[0])
        if np.isfinite(pixels).all():
            # Its fingers stand in front of what they hold.
            nearer = 12.0 * self._canvas.unit / self._camera.scale(depth)
            self._add(depth - nearer, paint_gripper, (self._canvas, pixels[0]))

    def draw(self) -> None:
        """Draw everything, the far first; of two equally far the one that was added first."""
        for _, function, arguments in sorted(self._items, key=itemgetter(0), reverse=True):
            function(*arguments)

    def _add(self, depth: float, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        self._items.append((float(depth), function, arguments))

    def _add_polygons(self, corners: np.ndarray, depth: np.ndarray, colours: np.ndarray) -> None:
        canvas = self._canvas
        canvas.touch(canvas.around(corners.reshape(-1, 2), 2.0))
        whole = np.rint(corners).astype(int).tolist()
        tones = np.rint(colours).astype(int).tolist()
        for polygon, tone, d in zip(whole, tones, depth.tolist(), strict=True):
            self._items.append((d, canvas.fill_polygon, (polygon, tone)))

    def _pixel_radius(self, radius: float, depth: float) -> float:
        return max(radius * self._camera.scale(depth), 2.2 * self._canvas.unit)

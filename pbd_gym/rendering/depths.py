"""What one picture of space shows: surfaces and lines that hide what is behind them."""

from __future__ import annotations

import numpy as np

from pbd_gym.rendering.camera import PerspectiveCamera
from pbd_gym.rendering.canvas import Canvas
from pbd_gym.rendering.palette import Colour
from pbd_gym.rendering.raster import space

_THINNEST = 2.0  # radius of a line [units]


class Depths:
    """Samples, several to a pixel, that shapes are drawn into; near ones hide far ones.

    Points that are not finite or behind the camera are left out.

    Args:
        canvas: On which is drawn.
        camera: From where is looked.
        light: Unit vector towards the lamp (3,).
    """

    def __init__(self, canvas: Canvas, camera: PerspectiveCamera, light: np.ndarray) -> None:
        self._canvas = canvas
        self._camera = camera
        right, up, forward = camera.axes @ light
        self._light = np.array([right, -up, -forward])
        # Large pictures need less smoothing and would pay most for it.
        self._times = times = min(max(round(1536 / max(canvas.size)), 2), 4)
        width, height = canvas.size
        self._image = np.zeros((height * times, width * times, 3), dtype=np.uint8)
        self._nearest = np.zeros((height * times, width * times), dtype=np.float32)
        self._touched = np.zeros((0, 2))

    def add_mesh(self, patches: np.ndarray, colours: np.ndarray, behind: float = 0.0) -> None:
        """Add patches (Q, 4, 3) [m], in a colour for each (Q, 3) or for each corner (Q, 4, 3).

        They hide only what lies deeper by more than `behind` [m].
        """
        pixels, depth = self._camera.project(patches.reshape(-1, 3))
        corners = pixels.reshape(-1, 4, 2)
        seen = np.isfinite(corners).all(axis=(1, 2))
        if colours.ndim == 2:
            colours = np.repeat(colours[:, None], 4, axis=1)
        corners, colours = corners[seen], np.clip(colours[seen], 0.0, 255.0)
        nearness = 1.0 / (depth.reshape(-1, 4)[seen] + behind)
        halves = [[0, 1, 2], [0, 2, 3]]
        space.draw_triangles(
            corners[:, halves].reshape(-1, 3, 2) * self._times,
            nearness[:, halves].reshape(-1, 3),
            colours[:, halves].reshape(-1, 3, 3),
            self._image,
            self._nearest,
        )
        self._touch(corners.reshape(-1, 2), 1.0)

    def add_lines(
        self, ends: np.ndarray, radius: float, colours: Colour | np.ndarray, behind: float = 0.0
    ) -> None:
        """Add round lines between ends (M, 2, 3) [m] of a radius [m], never too thin to see.

        The colour is one for all, or (M, 3): one for each line. They hide only what lies deeper
        by more than `behind` [m].
        """
        self._add_capsules(ends, np.full(len(ends), radius), colours, _THINNEST, behind)

    def add_balls(
        self, centres: np.ndarray, radii: np.ndarray, colours: Colour | np.ndarray, least: float
    ) -> None:
        """Add balls around (M, 3) of radii (M,) [m], none smaller than `least` [units]."""
        self._add_capsules(np.stack([centres, centres], axis=1), radii, colours, least, 0.0)

    def add_marks(
        self, point: np.ndarray, ends: np.ndarray, widths: np.ndarray, colours: np.ndarray
    ) -> None:
        """Add lines that always face the eye, in front of a point (3,) [m].

        Args:
            point: To which they belong.
            ends: (M, 2, 2) from the point [pixels].
            widths: (M,) [pixels].
            colours: (M, 3).
        """
        pixels, depths = self._camera.project(point[None])
        if not np.isfinite(pixels).all():
            return
        nearer = depths[0] - 12.0 * self._canvas.unit / self._camera.scale(float(depths[0]))
        # of two equally near ones the first would count, but the last shall lie on top
        order = nearer - 1e-4 * np.arange(len(ends))
        placed = pixels[0] + ends
        radii = np.stack([widths, widths], axis=1) / 2.0
        depth = np.stack([order, order], axis=1)
        self._draw(placed, radii, depth, np.zeros(len(ends)), colours)

    def lay(self, opacity: float = 1.0) -> None:
        """Lay everything over the canvas, and be empty again."""
        box = self._canvas.around(self._touched, 0.0)
        times = self._times
        parts = box.of(self._image, times), box.of(self._nearest, times)
        space.resolve(*parts, times, opacity, box.of(self._canvas.picture))
        self._touched = np.zeros((0, 2))

    def _add_capsules(
        self,
        ends: np.ndarray,
        radii: np.ndarray,
        colours: Colour | np.ndarray,
        least: float,
        behind: float,
    ) -> None:
        pixels, depths = self._camera.project(ends.reshape(-1, 3))
        pixels, depths = pixels.reshape(-1, 2, 2), depths.reshape(-1, 2)
        seen = np.isfinite(pixels).all(axis=(1, 2))
        colours = np.broadcast_to(np.asarray(colours, dtype=np.float64), (len(ends), 3))[seen]
        pixels, depths, radii = pixels[seen], depths[seen], radii[seen]
        scale = self._camera.focal_length / np.maximum(depths, self._camera.nearest)
        apparent = np.maximum(radii[:, None] * scale, least * self._canvas.unit)
        thickness = (apparent / scale).min(axis=1, initial=np.inf)
        self._draw(pixels, apparent, depths + behind, thickness, colours)

    def _draw(
        self,
        ends: np.ndarray,
        radii: np.ndarray,
        depths: np.ndarray,
        thickness: np.ndarray,
        colours: np.ndarray,
    ) -> None:
        """Draw capsules between ends (M, 2, 2) of radii (M, 2) [pixels] at depths (M, 2) [m]."""
        if not len(ends):
            return
        space.draw_capsules(
            ends * self._times,
            radii * self._times,
            depths,
            thickness,
            np.ascontiguousarray(colours, dtype=np.float64),
            self._light,
            self._image,
            self._nearest,
        )
        self._touch(ends.reshape(-1, 2), float(radii.max()) + 1.0)

    def _touch(self, points: np.ndarray, pad: float) -> None:
        box = self._canvas.around(points, pad)
        corners = np.array([[box.left, box.top], [box.right, box.bottom]], dtype=np.float64)
        if box.right > box.left and box.bottom > box.top:
            self._touched = np.concatenate([self._touched, corners])

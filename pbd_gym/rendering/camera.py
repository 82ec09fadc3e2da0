"""From metres to pixels: an orthographic camera for the plane, a perspective one for space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class OrthographicCamera:
    """Looks straight on the plane: x to the right, y up.

    Attributes:
        centre: Point in the middle of the picture, (2,) [m].
        middle: Pixel in the middle of the picture, (2,).
        pixels_per_metre: Scale of the picture.
    """

    centre: np.ndarray
    middle: np.ndarray
    pixels_per_metre: float

    @classmethod
    def framing(
        cls,
        lower: np.ndarray,
        upper: np.ndarray,
        size: tuple[int, int],
        margin: float,
        zoom: float = 1.0,
    ) -> OrthographicCamera:
        """Return the camera that shows a box as large as it fits.

        Args:
            lower: Lower corner of the box, (2,) [m].
            upper: Upper corner of the box, (2,) [m].
            size: Width and height of the picture [pixels].
            margin: Share of the picture left free on every side.
            zoom: How much larger than that.
        """
        free = np.array(size) * (1.0 - 2.0 * margin)
        scale = zoom * float(np.min(free / (upper - lower)))
        return cls((lower + upper) / 2.0, np.array(size) / 2.0, scale)

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Project points (M, 2) [m] on pixels (M, 2); the plane lies at depth 0."""
        offset = (points - self.centre) * (self.pixels_per_metre, -self.pixels_per_metre)
        return self.middle + offset, np.zeros(len(points))

    def unproject(self, pixels: np.ndarray, depth: np.ndarray | None = None) -> np.ndarray:
        """Return the points (M, 2) [m] that are seen at pixels (M, 2), whatever the depth."""
        offset = (pixels - self.middle) / (self.pixels_per_metre, -self.pixels_per_metre)
        return self.centre + offset

    def scale(self, depth: float) -> float:
        """Return the pixels per metre, the same at every depth."""
        return self.pixels_per_metre


@dataclass(frozen=True)
class PerspectiveCamera:
    """Looks at space with z up, and never rolls.

    Attributes:
        eye: Where the camera stands, (3,) [m].
        axes: Unit vectors to the right, up and forward, (3, 3), one in each row.
        focal_length: Pixels per unit of slope.
        middle: Pixel in the line of sight, (2,).
        nearest: Depth up to which points are too near to be drawn [m].
    """

    eye: np.ndarray
    axes: np.ndarray
    focal_length: float
    middle: np.ndarray
    nearest: float

    @classmethod
    def framing(
        cls,
        lower: np.ndarray,
        upper: np.ndarray,
        size: tuple[int, int],
        margin: float,
        azimuth: float,
        elevation: float,
        zoom: float = 1.0,
    ) -> PerspectiveCamera:
        """Return the camera that shows a box as large as it fits.

        Args:
            lower: Lower corner of the box, (3,) [m].
            upper: Upper corner of the box, (3,) [m].
            size: Width and height of the picture [pixels].
            margin: Share of the picture left free on every side.
            azimuth: Direction in which the camera stands, seen from the box; 0 is x, pi/2 is y.
            elevation: Angle of that direction above the horizon.
            zoom: How much larger than that.
        """
        out = np.array(
            [
                np.cos(elevation) * np.cos(azimuth),
                np.cos(elevation) * np.sin(azimuth),
                np.sin(elevation),
            ]
        )
        right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        axes = np.stack([right, np.cross(out, right), -out])
        # Far enough for a calm perspective; how large the box appears is the focal length's task.
        distance = 2.2 * float(np.linalg.norm(upper - lower))
        eye = (lower + upper) / 2.0 + out * distance
        corners = np.array([[(lower, upper)[b >> k & 1][k] for k in range(3)] for b in range(8)])
        local = (corners - eye) @ axes.T
        slopes = local[:, :2] / local[:, 2:]
        low, high = slopes.min(axis=0), slopes.max(axis=0)
        focal = zoom * float(np.min(np.array(size) * (1.0 - 2.0 * margin) / (high - low)))
        middle = np.array(size) / 2.0 - (low + high) / 2.0 * (focal, -focal)
        return cls(eye, axes, focal, middle, 0.2 * distance)

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Project points (M, 3) [m] on pixels (M, 2) and the depth along the line of sight [m]."""
        local = (points - self.eye) @ self.axes.T
        depth = local[:, 2]
        in_front = np.where(depth > self.nearest, depth, np.nan)
        slopes = local[:, :2] / in_front[:, None]
        return self.middle + slopes * (self.focal_length, -self.focal_length), depth

    def unproject(self, pixels: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """Return the points (M, 3) [m] that are seen at pixels (M, 2) at depths (M,) [m]."""
        slopes = (pixels - self.middle) / (self.focal_length, -self.focal_length)
        local = np.column_stack([slopes, np.ones(len(pixels))]) * depth[:, None]
        return self.eye + local @ self.axes

    def scale(self, depth: float) -> float:
        """Return the pixels per metre at a depth [m]."""
        return self.focal_length / max(depth, self.nearest)

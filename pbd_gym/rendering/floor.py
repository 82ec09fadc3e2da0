"""The floor of a spatial scene: tiles of a known size that fade into the distance."""

from __future__ import annotations

import numpy as np

from pbd_gym.rendering.camera import PerspectiveCamera
from pbd_gym.rendering.palette import FLOOR, FLOOR_TILE, PAPER, SKY


def floor_pixels(
    camera: PerspectiveCamera,
    size: tuple[int, int],
    view: tuple[np.ndarray, np.ndarray],
    room: tuple[np.ndarray, np.ndarray],
    tile: float,
) -> np.ndarray:
    """Return what the camera sees of an empty scene, (height, width, 3) of uint8.

    Args:
        camera: From where it is seen.
        size: Width and height [pixels].
        view: Two corners (3,) of the box in the middle of the scene [m].
        room: Lower and upper walls (3,) [m]; the floor lies at the lower end of z, if it is finite,
            and ends at the others.
        tile: Side of a tile [m].
    """
    width, height = size
    sky = np.linspace(SKY, PAPER, height)[:, None, :]
    lower, upper = room
    if not np.isfinite(lower[2]):
        return np.broadcast_to(np.rint(sky), (height, width, 3)).astype(np.uint8)
    slope_x = ((np.arange(width) + 0.5 - camera.middle[0]) / camera.focal_length)[None, :]
    slope_y = ((camera.middle[1] - np.arange(height) - 0.5) / camera.focal_length)[:, None]
    right, up, forward = camera.axes
    # The camera does not roll, so a row of pixels meets the floor at one distance.
    fall = forward[2] + up[2] * slope_y
    distance = np.where(fall < 0.0, (lower[2] - camera.eye[2]) / np.minimum(fall, -1e-6), np.inf)
    reach = float(np.linalg.norm((view[1] - view[0])[:2]))
    seen = (distance > 0.0) & (distance < 1e3 * reach)
    distance = np.where(seen, distance, 0.0)
    # Single precision from here on: these arrays have as many entries as the canvas has pixels.
    x, y = (
        (camera.eye[k] + distance * (forward[k] + up[k] * slope_y)).astype(np.float32)
        + (distance * right[k]).astype(np.float32) * slope_x.astype(np.float32)
        for k in range(2)
    )
    middle = ((view[0] + view[1]) / 2.0).astype(np.float32)
    from_middle = np.hypot(x - middle[0], y - middle[1]) / np.float32(reach)
    nearness = np.clip(np.float32(1.5) - from_middle, 0.0, 1.0)
    opacity = nearness * nearness * (3.0 - 2.0 * nearness) * seen
    for place, axis in ((x, 0), (y, 1)):
        opacity *= (place >= lower[axis]) & (place <= upper[axis])
    even = (np.floor(x / np.float32(tile)) + np.floor(y / np.float32(tile))) % 2.0 == 0.0
    pixels = np.empty((height, width, 3), dtype=np.uint8)
    for channel in range(3):
        air = sky[..., channel].astype(np.float32)
        ground = np.where(even, np.float32(FLOOR[channel]), np.float32(FLOOR_TILE[channel]))
        pixels[..., channel] = np.rint(air + (ground - air) * opacity)
    return pixels

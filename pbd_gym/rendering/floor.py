"""The floor of a spatial scene: tiles of a known size that fade into the distance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbd_gym.physics.tables import Room
from pbd_gym.rendering.camera import PerspectiveCamera
from pbd_gym.rendering.canvas import Canvas
from pbd_gym.rendering.look import Look
from pbd_gym.rendering.marks import WRITING
from pbd_gym.rendering.palette import Theme
from pbd_gym.rendering.scene import Segment, round_length


def paint_floor(
    canvas: Canvas,
    camera: PerspectiveCamera,
    view: tuple[np.ndarray, np.ndarray],
    room: Room,
    rails: tuple[Segment, ...],
    look: Look,
) -> None:
    """Draw what does not move and keep it as the background."""
    theme = look.colours
    tile = round_length(float(np.max(view[1] - view[0])) / 6.0)
    width, height = canvas.size
    times = 3 if max(canvas.size) <= 512 else 2  # samples along a side of a pixel
    fine = replace(camera, focal_length=camera.focal_length * times, middle=camera.middle * times)
    size = (width * times, height * times)
    pixels = floor_pixels(fine, size, view, (room.lower, room.upper), tile, theme)
    samples = pixels.reshape(height, times, width, times, 3)
    mean = np.rint(samples.mean(axis=(1, 3), dtype=np.float32)).astype(np.uint8)
    canvas.paste(mean)
    for rail in rails:
        ends, _ = camera.project(np.array(rail, dtype=np.float64))
        canvas.stroke(ends, 4.0 * canvas.unit, theme.light_steel)
    if np.isfinite(room.lower[2]) and "scale" in look.show:
        words, u = f"tile {tile:g} m", canvas.unit
        columns, rows = canvas.text_size(words, WRITING * u)
        place = (14.0 * u + columns / 2.0, canvas.size[1] - 12.0 * u - rows / 2.0)
        canvas.text(words, place, WRITING * u, theme.ink)
    canvas.keep_as_background()


def floor_pixels(
    camera: PerspectiveCamera,
    size: tuple[int, int],
    view: tuple[np.ndarray, np.ndarray],
    room: tuple[np.ndarray, np.ndarray],
    tile: float,
    theme: Theme,
) -> np.ndarray:
    """Return what the camera sees of an empty scene, (height, width, 3) of uint8.

    Args:
        camera: From where it is seen.
        size: Width and height [pixels].
        view: Two corners (3,) of the box in the middle of the scene [m].
        room: Lower and upper walls (3,) [m]; the floor lies at the lower end of z, if it is finite,
            and ends at the others.
        tile: Side of a tile [m].
        theme: Its colours.
    """
    width, height = size
    sky = np.linspace(theme.sky, theme.paper, height)[:, None, :]
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
        tones = np.float32(theme.floor[channel]), np.float32(theme.floor_tile[channel])
        ground = np.where(even, *tones)
        pixels[..., channel] = np.rint(air + (ground - air) * opacity)
    return pixels

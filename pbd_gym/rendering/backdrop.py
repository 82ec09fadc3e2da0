"""What does not move in a picture of the plane: squared paper, walls, rails, the scale bar."""

from __future__ import annotations

import numpy as np

from pbd_gym.physics.tables import Room
from pbd_gym.rendering.camera import OrthographicCamera
from pbd_gym.rendering.canvas import Canvas
from pbd_gym.rendering.look import Look
from pbd_gym.rendering.marks import WRITING
from pbd_gym.rendering.palette import Theme
from pbd_gym.rendering.scene import Segment, round_length


def paint_backdrop(
    canvas: Canvas,
    camera: OrthographicCamera,
    room: Room,
    rails: tuple[Segment, ...],
    look: Look,
) -> None:
    """Draw what does not move and keep it as the background."""
    theme = look.colours
    canvas.picture[...] = theme.paper
    cell = round_length(80.0 * canvas.unit / camera.pixels_per_metre)
    _paint_grid(canvas, camera, cell, theme)
    _paint_walls(canvas, camera, room, theme)
    for rail in rails:
        ends, _ = camera.project(np.array(rail, dtype=np.float64))
        canvas.stroke(ends, 4.0 * canvas.unit, theme.light_steel)
        for end in ends:
            canvas.disc(end, 5.0 * canvas.unit, theme.steel)
    if "scale" in look.show:
        _paint_scale(canvas, cell, camera.pixels_per_metre, theme)
    canvas.keep_as_background()


def _paint_grid(canvas: Canvas, camera: OrthographicCamera, cell: float, theme: Theme) -> None:
    corners = camera.unproject(np.array([[0.0, canvas.size[1]], [canvas.size[0], 0.0]]))
    for axis in (0, 1):
        first, last = np.ceil(corners[0, axis] / cell), np.floor(corners[1, axis] / cell)
        for line in np.arange(first, last + 1.0):
            ends = corners.copy()
            ends[:, axis] = line * cell
            pixels, _ = camera.project(ends)
            width = (1.0 if line else 1.6) * max(canvas.unit, 0.8)
            canvas.stroke(pixels, width, theme.grid if line else theme.axis)


def _paint_walls(canvas: Canvas, camera: OrthographicCamera, room: Room, theme: Theme) -> None:
    far = np.array(canvas.size) * 2.0
    for axis in (0, 1):
        for wall, outside in ((room.lower, -1), (room.upper, 1)):
            if not np.isfinite(wall[axis]):
                continue
            place = np.where(np.arange(2) == axis, wall[axis], camera.centre)
            pixel = camera.project(place[None])[0][0, axis]
            # Pixels count downwards, so what is outside below has the larger numbers.
            beyond = pixel + far[axis] * outside * (1 if axis == 0 else -1)
            _paint_half(canvas, axis, pixel, beyond, theme)


def _paint_half(canvas: Canvas, axis: int, pixel: float, beyond: float, theme: Theme) -> None:
    """Fill the solid between a wall's surface and far beyond it."""
    span = (-10.0, max(canvas.size) + 10.0)
    edge = pixel + np.sign(beyond - pixel) * max(2.0 * canvas.unit, 1.0)
    for until, colour in ((beyond, theme.wall), (edge, theme.wall_edge)):
        (a, b), (c, d) = (pixel, span[0]), (until, span[1])
        canvas.bar(*(((a, b), (c, d)) if axis == 0 else ((b, a), (d, c))), colour)


def _paint_scale(canvas: Canvas, cell: float, pixels_per_metre: float, theme: Theme) -> None:
    u = canvas.unit
    left, bottom = 14.0 * u, canvas.size[1] - 14.0 * u
    right = left + cell * pixels_per_metre
    width = max(1.6 * u, 1.0)
    canvas.stroke(np.array([[left, bottom], [right, bottom]]), width, theme.ink)
    for end in (left, right):
        canvas.stroke(np.array([[end, bottom - 5 * u], [end, bottom]]), width, theme.ink)
    words = f"{cell:g} m"
    columns, rows = canvas.text_size(words, WRITING * u)
    middle = max((left + right) / 2.0, 6.0 * u + columns / 2.0)
    canvas.text(words, (middle, bottom - 5.0 * u - 0.5 * rows), WRITING * u, theme.ink)

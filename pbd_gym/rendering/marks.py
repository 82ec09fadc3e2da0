"""Marks that look alike in the plane and in space: beads, goals, grippers, carts and the clock."""

from __future__ import annotations

import numpy as np

from pbd_gym.rendering.canvas import Canvas
from pbd_gym.rendering.palette import Theme, mix

GHOST = 0.45  # opacity of a goal
BEAD = 5.0  # radius of a particle that is marked [units]
WRITING = 18.0  # height of a line of text [units]

# Lines of a gripper that comes from above and holds the point (0, 0) between its fingertips, y
# down [units]; their widths and colours.
_GRIPPER = np.array(
    [
        [[0.0, -24.0], [0.0, -13.0]],
        [[-8.0, -12.0], [8.0, -12.0]],
        [[-8.0, -12.0], [-8.5, -5.0]],
        [[8.0, -12.0], [8.5, -5.0]],
        [[-8.5, -5.0], [-3.5, 1.0]],
        [[8.5, -5.0], [3.5, 1.0]],
        [[-3.2, 0.0], [-3.2, 4.0]],
        [[3.2, 0.0], [3.2, 4.0]],
    ]
)
_WIDTHS = np.array([6.0, 5.5, 4.5, 4.5, 4.0, 4.0, 3.0, 3.0])
_METALS = ("steel", *5 * ("dark_steel",), *2 * ("light_steel",))


def gripper_lines(unit: float, theme: Theme) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return lines (M, 2, 2) from the point that is held, widths (M,) [pixels], colours (M, 3)."""
    colours = np.array([getattr(theme, metal) for metal in _METALS], dtype=np.float64)
    return _GRIPPER * unit, _WIDTHS * unit, colours


def paint_gripper(canvas: Canvas, centre: np.ndarray, theme: Theme) -> None:
    """Draw a gripper that holds a point (2,)."""
    for ends, width, colour in zip(*gripper_lines(canvas.unit, theme), strict=True):
        canvas.stroke(centre + ends, float(width), colour)


def paint_beads(
    canvas: Canvas, centres: np.ndarray, radii: np.ndarray, fills: np.ndarray, theme: Theme
) -> None:
    """Draw shining balls with a dark edge: centres (M, 2), radii (M,), colours (M, 3)."""
    u = canvas.unit
    edges = fills * 0.55
    shine = fills + (np.array(theme.gloss) - fills) * 0.55
    discs = [
        (centres, radii, edges),
        (centres, np.maximum(radii - 1.4 * u, 0.5), fills),
        (centres - 0.3 * radii[:, None], 0.24 * radii, shine),
    ]
    # one ball after the other, each from the edge to the highlight
    points, sizes, colours = (np.stack(parts, axis=1) for parts in zip(*discs, strict=True))
    canvas.discs(points.reshape(-1, 2), sizes.reshape(-1), colours.reshape(-1, 3))


def paint_target(canvas: Canvas, centre: np.ndarray, radius: float, theme: Theme) -> None:
    """Draw the disc (2,) in which a particle counts as arrived, never too small to see."""
    size = max(radius, 6.0 * canvas.unit)
    with canvas.translucent(GHOST, centre[None], size + 2.0):
        canvas.disc(centre, size, theme.goal)
    canvas.disc(centre, size, theme.goal_edge, width=max(1.6 * canvas.unit, 1.0))
    canvas.disc(centre, max(1.5 * canvas.unit, 0.7), theme.goal_edge)


def paint_cart(canvas: Canvas, centre: np.ndarray, theme: Theme) -> None:
    """Draw the cart of a pendulum with the pivot at the point."""
    x, y = centre
    u = canvas.unit
    canvas.bar((x - 18 * u, y - 8 * u), (x + 18 * u, y + 8 * u), theme.dark_steel)
    canvas.disc(centre, 5.0 * u, theme.light_steel)
    canvas.disc(centre, 2.5 * u, theme.dark_steel)


def paint_trail(canvas: Canvas, pixels: np.ndarray, theme: Theme) -> None:
    """Draw where a point was, (T, 2) from the oldest on: a line that fades into the past."""
    if len(pixels) < 2:
        return
    age = np.linspace(0.0, 1.0, len(pixels) - 1)[:, None]
    colours = np.array(theme.paper) + (np.array(theme.goal) - np.array(theme.paper)) * age
    moving = np.isfinite(np.stack([pixels[:-1], pixels[1:]], axis=1)).all(axis=(1, 2))
    ends = np.stack([pixels[:-1], pixels[1:]], axis=1)[moving]
    canvas.strokes(ends, max(2.0 * canvas.unit, 1.0), colours[moving], 0.8)


def paint_clock(canvas: Canvas, time: float, theme: Theme) -> None:
    """Write the time [s] into the upper right corner."""
    u, words = canvas.unit, f"{time:.2f} s"
    # as wide for every digit, so that the writing does not tremble
    columns, rows = canvas.text_size("0" * (len(words) - 3) + ". s", WRITING * u)
    place = (canvas.size[0] - 14.0 * u - columns / 2.0, 12.0 * u + rows / 2.0)
    canvas.text(words, place, WRITING * u, theme.ink)


def paint_rods(canvas: Canvas, ends: np.ndarray, width: float, colours: np.ndarray) -> None:
    """Draw lines between ends (M, 2, 2) with a darker edge, in colours (M, 3)."""
    canvas.strokes(ends, width + 1.6 * canvas.unit, colours * 0.55)
    canvas.strokes(ends, width - 0.8 * canvas.unit, colours)


def paler(colour: tuple[int, int, int], theme: Theme) -> tuple[int, int, int]:
    """Return the colour of a body's inside."""
    return mix(colour, theme.paper, 0.55)

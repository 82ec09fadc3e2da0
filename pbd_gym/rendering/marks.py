"""Marks that look alike in the plane and in space: beads, goals, grippers and carts."""

from __future__ import annotations

import numpy as np

from pbd_gym.rendering.canvas import Canvas
from pbd_gym.rendering.palette import (
    DARK_ORANGE,
    DARK_STEEL,
    LIGHT_STEEL,
    ORANGE,
    PAPER,
    STEEL,
    Colour,
    mix,
)

GHOST = 0.45  # opacity of a goal
BEAD = 5.0  # radius of a particle that is marked [units]


def paint_bead(
    canvas: Canvas, centre: np.ndarray, radius: float, fill: Colour, edge: Colour
) -> None:
    """Draw a shining ball with a dark edge."""
    canvas.disc(centre, radius, edge)
    canvas.disc(centre, radius - 1.4 * canvas.unit, fill)
    canvas.disc(centre - 0.3 * radius, 0.22 * radius, mix(fill, PAPER, 0.45))


def paint_beads(
    canvas: Canvas, centres: np.ndarray, radius: float, fill: Colour, edge: Colour
) -> None:
    """Draw the same bead around many points (M, 2)."""
    canvas.repeat(centres, radius, lambda centre: paint_bead(canvas, centre, radius, fill, edge))


def paint_target(canvas: Canvas, centre: np.ndarray, radius: float) -> None:
    """Draw the disc (2,) in which a particle counts as arrived, never too small to see."""
    size = max(radius, 6.0 * canvas.unit)
    with canvas.translucent(GHOST, centre[None], size + 2.0):
        canvas.disc(centre, size, ORANGE)
    canvas.disc(centre, size, DARK_ORANGE, width=1.6 * canvas.unit)
    canvas.disc(centre, 1.5 * canvas.unit, DARK_ORANGE)


def paint_gripper(canvas: Canvas, centre: np.ndarray) -> None:
    """Draw two fingers on a stem that come from above and hold the point between them."""
    x, y = centre
    u = canvas.unit
    canvas.bar((x - 2.5 * u, y - 18 * u), (x + 2.5 * u, y - 6 * u), STEEL)
    canvas.bar((x - 9 * u, y - 10 * u), (x + 9 * u, y - 4 * u), DARK_STEEL)
    for side in (-1, 1):
        canvas.bar((x + side * 9 * u, y - 10 * u), (x + side * 5 * u, y + 8 * u), DARK_STEEL)
        canvas.bar((x + side * 5 * u, y), (x + side * 2 * u, y + 7 * u), LIGHT_STEEL)


def paint_cart(canvas: Canvas, centre: np.ndarray) -> None:
    """Draw the cart of a pendulum with the pivot at the point."""
    x, y = centre
    u = canvas.unit
    canvas.bar((x - 18 * u, y - 8 * u), (x + 18 * u, y + 8 * u), DARK_STEEL)
    canvas.disc(centre, 5.0 * u, LIGHT_STEEL)
    canvas.disc(centre, 2.5 * u, DARK_STEEL)

"""How much of each pixel a shape covers, and how its colour is laid over the picture."""

from __future__ import annotations

from math import ceil, floor, sqrt
from typing import Any

import numpy as np

from pbd_gym.physics.compiling import entry, kernel


@entry
def bounds(points: Any) -> tuple[float, float, float, float]:
    """Return least x and y and greatest x and y of the finite of points (M, 2)."""
    left, top, right, bottom = np.inf, np.inf, -np.inf, -np.inf
    for k in range(len(points)):
        x, y = points[k, 0], points[k, 1]
        if abs(x) < np.inf and abs(y) < np.inf:
            left, right = min(left, x), max(right, x)
            top, bottom = min(top, y), max(bottom, y)
    return left, top, right, bottom


@entry
def cover_lines(starts: Any, ends: Any, radii: Any, coverage: Any, nearest: Any) -> None:
    """Cover lines with round ends; where some overlap, the one that covers most counts.

    Args:
        starts: (M, 2).
        ends: (M, 2).
        radii: (M,) half widths.
        coverage: (height, width) in [0, 1], raised where a line covers more.
        nearest: (height, width) index of the line that covers most, written.
    """
    height, width = coverage.shape
    for k in range(len(starts)):
        x, y, r = starts[k, 0], starts[k, 1], radii[k]
        dx, dy = ends[k, 0] - x, ends[k, 1] - y
        square = max(dx * dx + dy * dy, 1e-12)
        top = max(floor(min(y, y + dy) - r - 0.5), 0)
        bottom = min(ceil(max(y, y + dy) + r + 0.5), height)
        left = max(floor(min(x, x + dx) - r - 0.5), 0)
        right = min(ceil(max(x, x + dx) + r + 0.5), width)
        for row in range(top, bottom):
            for column in range(left, right):
                px, py = column + 0.5 - x, row + 0.5 - y
                share = min(max((px * dx + py * dy) / square, 0.0), 1.0)
                ox, oy = px - share * dx, py - share * dy
                distance = sqrt(ox * ox + oy * oy)
                covered = min(distance + r, 0.5) - max(distance - r, -0.5)
                if covered > coverage[row, column]:
                    coverage[row, column] = covered
                    nearest[row, column] = k


@entry
def cover_polygon(points: Any, coverage: Any) -> None:
    """Cover the inside of a polygon by the exact area of each pixel.

    Each edge adds to the pixels that it crosses how much of them lies to its right; the sums along
    a row are the coverage (as font rasterisers do: R. Levien, font-rs, 2016).

    Args:
        points: (M, 2) corners once around, in either direction.
        coverage: (height, width) zeros, written.
    """
    height, width = coverage.shape
    for k in range(len(points)):
        after = k + 1 if k + 1 < len(points) else 0
        sign, low, high = 1.0, k, after
        if points[k, 1] > points[after, 1]:
            sign, low, high = -1.0, after, k
        y0, y1 = points[low, 1], points[high, 1]
        if y0 == y1:
            continue
        slope = (points[high, 0] - points[low, 0]) / (y1 - y0)
        for row in range(max(floor(y0), 0), min(ceil(y1), height)):
            upper, lower = max(y0, float(row)), min(y1, row + 1.0)
            a = points[low, 0] + slope * (upper - y0)
            b = points[low, 0] + slope * (lower - y0)
            _cut(coverage[row], min(a, b), max(a, b), sign * (lower - upper))
    for row in range(height):
        total = 0.0
        for column in range(width):
            total += coverage[row, column]
            coverage[row, column] = min(abs(total), 1.0)


@kernel
def _cut(row: Any, left: float, right: float, rise: float) -> None:
    """Add to a row what an edge from x = left to right leaves on its right side.

    Pixel c has 1 - mean(clip(x - c, 0, 1)) of its area to the right; the row holds differences.
    """
    width = len(row)
    left, right = min(max(left, 0.0), float(width)), min(max(right, 0.0), float(width))
    before = 0.0
    for column in range(floor(left), min(floor(right) + 2, width)):
        if column >= right:
            beyond = 1.0
        elif right - left < 1e-9:
            beyond = min(max(column + 1.0 - left, 0.0), 1.0)
        else:
            beyond = _ramp(column + 1.0 - left, right - left) - _ramp(column - left, right - left)
        row[column] += rise * (beyond - before)
        before = beyond


@kernel
def _ramp(x: float, length: float) -> float:
    """Return the integral up to x of a ramp from 0 at 0 to 1 at `length`."""
    inside = min(max(x, 0.0), length)
    return 0.5 * inside * inside / length + max(x - length, 0.0)


@entry
def blend(picture: Any, coverage: Any, nearest: Any, colours: Any, opacity: float) -> None:
    """Lay colours over a picture where they cover it, and empty the coverage.

    Args:
        picture: (height, width, 3) uint8, written.
        coverage: (height, width) in [0, 1], set to 0.
        nearest: (height, width) which colour.
        colours: (M, 3) in [0, 255].
        opacity: Of all of them.
    """
    for row in range(picture.shape[0]):
        for column in range(picture.shape[1]):
            share = coverage[row, column] * opacity
            if share > 0.0:
                coverage[row, column] = 0.0
                k = nearest[row, column]
                for channel in range(3):
                    old = float(picture[row, column, channel])
                    picture[row, column, channel] = int(
                        old + (colours[k, channel] - old) * share + 0.5
                    )


@entry
def draw_discs(picture: Any, centres: Any, radii: Any, colours: Any) -> None:
    """Draw discs one after the other.

    Args:
        picture: (height, width, 3) uint8, written.
        centres: (M, 2).
        radii: (M,).
        colours: (M, 3) in [0, 255].
    """
    height, width = picture.shape[:2]
    for k in range(len(centres)):
        x, y, r = centres[k, 0], centres[k, 1], radii[k]
        inside, outside = max(r - 0.5, 0.0), r + 0.5
        whole = int(colours[k, 0] + 0.5), int(colours[k, 1] + 0.5), int(colours[k, 2] + 0.5)
        for row in range(max(floor(y - outside), 0), min(ceil(y + outside), height)):
            for column in range(max(floor(x - outside), 0), min(ceil(x + outside), width)):
                dx, dy = column + 0.5 - x, row + 0.5 - y
                square = dx * dx + dy * dy
                if square < inside * inside:  # most pixels: no root, nothing to mix
                    for channel in range(3):
                        picture[row, column, channel] = whole[channel]
                elif square < outside * outside:
                    distance = sqrt(square)
                    share = max(min(distance + r, 0.5) - max(distance - r, -0.5), 0.0)
                    for channel in range(3):
                        old = float(picture[row, column, channel])
                        picture[row, column, channel] = int(
                            old + (colours[k, channel] - old) * share + 0.5
                        )

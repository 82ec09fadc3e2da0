"""Surfaces in space, drawn into samples that remember how near they are, some to each pixel.

Nearness is 1 / depth [1/m], linear on the screen and 0 where nothing is. What is drawn later counts
only where it is nearer, so that folds hide each other exactly.
"""

from __future__ import annotations

from math import ceil, floor, sqrt
from typing import Any

import numpy as np

from pbd_gym.physics.compiling import entry, kernel


@entry
def draw_triangles(corners: Any, nearness: Any, colours: Any, image: Any, nearest: Any) -> None:
    """Draw triangles whose colours blend from corner to corner.

    Args:
        corners: (T, 3, 2) [samples].
        nearness: (T, 3) [1/m].
        colours: (T, 3, 3) in [0, 255].
        image: (height, width, 3) uint8, written.
        nearest: (height, width) nearness of what is there [1/m], raised.
    """
    height, width = nearest.shape
    for k in range(len(corners)):
        ax, ay = corners[k, 0, 0], corners[k, 0, 1]
        bx, by = corners[k, 1, 0] - ax, corners[k, 1, 1] - ay
        cx, cy = corners[k, 2, 0] - ax, corners[k, 2, 1] - ay
        area = bx * cy - by * cx
        if area == 0.0:
            continue
        low, high = min(by, cy, 0.0) + ay, max(by, cy, 0.0) + ay
        # weights of the second and third corner, and how they grow with x
        u_x, v_x = cy / area, -by / area
        n0 = nearness[k, 0]
        n1, n2 = nearness[k, 1] - n0, nearness[k, 2] - n0
        first, second, third = colours[k, 0], colours[k, 1], colours[k, 2]
        red1, green1, blue1 = second[0] - first[0], second[1] - first[1], second[2] - first[2]
        red2, green2, blue2 = third[0] - first[0], third[1] - first[1], third[2] - first[2]
        for row in range(max(floor(low), 0), min(ceil(high), height)):
            py = row + 0.5 - ay
            u_0, v_0 = -py * cx / area, py * bx / area
            # where on the row no weight is negative
            left, right = _within(u_0, u_x, -np.inf, np.inf)
            left, right = _within(v_0, v_x, left, right)
            left, right = _within(1.0 - u_0 - v_0, -u_x - v_x, left, right)
            start = max(ceil(max(left + ax - 0.5, 0.0)), 0)
            end = min(floor(min(right + ax - 0.5, width)) + 1, width)
            for column in range(start, end):
                px = column + 0.5 - ax
                u, v = u_0 + px * u_x, v_0 + px * v_x
                near = n0 + u * n1 + v * n2
                if near > nearest[row, column]:
                    nearest[row, column] = near
                    image[row, column, 0] = np.uint8(first[0] + u * red1 + v * red2)
                    image[row, column, 1] = np.uint8(first[1] + u * green1 + v * green2)
                    image[row, column, 2] = np.uint8(first[2] + u * blue1 + v * blue2)


@kernel
def _within(at_zero: float, slope: float, left: float, right: float) -> tuple[float, float]:
    """Return the part of an interval of x in which at_zero + slope x is not negative."""
    if slope > 0.0:
        return max(left, -at_zero / slope), right
    if slope < 0.0:
        return left, min(right, -at_zero / slope)
    return (left, right) if at_zero >= 0.0 else (np.inf, -np.inf)


@entry
def draw_capsules(
    ends: Any,
    radii: Any,
    depths: Any,
    thickness: Any,
    colours: Any,
    light: Any,
    image: Any,
    nearest: Any,
) -> None:
    """Draw lit capsules: lines of round section with round ends; balls where the ends coincide.

    Args:
        ends: (K, 2, 2) [samples].
        radii: (K, 2) at either end [samples].
        depths: (K, 2) of either end [m].
        thickness: (K,) radius in space [m]; 0 for what is flat and not lit.
        colours: (K, 3) in [0, 255].
        light: Unit vector towards the lamp: right, down, towards the eye.
        image: (height, width, 3) uint8, written.
        nearest: (height, width) nearness of what is there [1/m], raised.
    """
    height, width = nearest.shape
    for k in range(len(ends)):
        x, y = ends[k, 0, 0], ends[k, 0, 1]
        dx, dy = ends[k, 1, 0] - x, ends[k, 1, 1] - y
        square = max(dx * dx + dy * dy, 1e-12)
        reach = max(radii[k, 0], radii[k, 1])
        top = max(floor(min(y, y + dy) - reach), 0)
        bottom = min(ceil(max(y, y + dy) + reach), height)
        left = max(floor(min(x, x + dx) - reach), 0)
        right = min(ceil(max(x, x + dx) + reach), width)
        for row in range(top, bottom):
            for column in range(left, right):
                px, py = column + 0.5 - x, row + 0.5 - y
                share = min(max((px * dx + py * dy) / square, 0.0), 1.0)
                radius = radii[k, 0] + share * (radii[k, 1] - radii[k, 0])
                ox, oy = (px - share * dx) / radius, (py - share * dy) / radius
                inside = 1.0 - ox * ox - oy * oy
                if inside <= 0.0:
                    continue
                bulge = sqrt(inside)
                depth = depths[k, 0] + share * (depths[k, 1] - depths[k, 0])
                near = 1.0 / (depth - thickness[k] * bulge)
                if near > nearest[row, column]:
                    nearest[row, column] = near
                    brightness, gloss = 1.0, 0.0
                    if thickness[k] > 0.0:
                        facing = ox * light[0] + oy * light[1] + bulge * light[2]
                        brightness = 0.45 + 0.65 * (0.5 + 0.5 * facing)
                        gloss = max(facing - 0.9, 0.0) * 4.0
                    for channel in range(3):
                        tone = min(colours[k, channel] * brightness, 255.0)
                        image[row, column, channel] = int(tone + (255.0 - tone) * gloss)


@entry
def resolve(image: Any, nearest: Any, times: int, opacity: float, picture: Any) -> None:
    """Average samples over pixels, lay them over a picture and empty them.

    Args:
        image: (height * times, width * times, 3) uint8.
        nearest: (height * times, width * times), set to 0.
        times: Samples along a side of a pixel.
        opacity: Of what was drawn.
        picture: (height, width, 3) uint8, written.
    """
    for row in range(picture.shape[0]):
        for column in range(picture.shape[1]):
            red, green, blue, count = 0.0, 0.0, 0.0, 0
            for r in range(row * times, (row + 1) * times):
                for c in range(column * times, (column + 1) * times):
                    if nearest[r, c] > 0.0:
                        nearest[r, c] = 0.0
                        red += image[r, c, 0]
                        green += image[r, c, 1]
                        blue += image[r, c, 2]
                        count += 1
            if count:
                share = opacity * count / (times * times)
                scale = share / count
                rest = 1.0 - share
                pixel = picture[row, column]
                pixel[0] = int(pixel[0] * rest + red * scale + 0.5)
                pixel[1] = int(pixel[1] * rest + green * scale + 0.5)
                pixel[2] = int(pixel[2] * rest + blue * scale + 0.5)


@entry
def darken(quads: Any, opacity: Any, mask: Any) -> None:
    """Raise a mask to the opacity of each quadrilateral where it covers the middle of a cell.

    Args:
        quads: (Q, 4, 2) corners, convex [cells].
        opacity: (Q,).
        mask: (rows, columns), raised.
    """
    rows, columns = mask.shape
    for k in range(len(quads)):
        quad = quads[k]
        low_x, high_x = quad[:, 0].min(), quad[:, 0].max()
        low_y, high_y = quad[:, 1].min(), quad[:, 1].max()
        for row in range(max(floor(low_y), 0), min(ceil(high_y), rows)):
            for column in range(max(floor(low_x), 0), min(ceil(high_x), columns)):
                left, right = 0, 0
                for i in range(4):
                    j = i + 1 if i < 3 else 0
                    side = (quad[j, 0] - quad[i, 0]) * (row + 0.5 - quad[i, 1]) - (
                        quad[j, 1] - quad[i, 1]
                    ) * (column + 0.5 - quad[i, 0])
                    left += side > 0.0
                    right += side < 0.0
                if (left == 0 or right == 0) and opacity[k] > mask[row, column]:
                    mask[row, column] = opacity[k]


@entry
def tint(mask: Any, cell: int, colour: Any, picture: Any) -> None:
    """Lay a colour over a picture as opaque as a coarse mask says, blended between its cells.

    Args:
        mask: (rows, columns) opacity in [0, 1].
        cell: Pixels along a side of a cell.
        colour: (3,) in [0, 255].
        picture: (height, width, 3) uint8, written.
    """
    rows, columns = mask.shape
    for row in range(picture.shape[0]):
        y = max((row + 0.5) / cell - 0.5, 0.0)
        above = min(int(y), rows - 1)
        below = min(above + 1, rows - 1)
        down = y - above
        for column in range(picture.shape[1]):
            x = max((column + 0.5) / cell - 0.5, 0.0)
            left = min(int(x), columns - 1)
            right = min(left + 1, columns - 1)
            over = x - left
            upper = mask[above, left] * (1.0 - over) + mask[above, right] * over
            lower = mask[below, left] * (1.0 - over) + mask[below, right] * over
            share = upper * (1.0 - down) + lower * down
            if share > 0.002:
                for channel in range(3):
                    old = float(picture[row, column, channel])
                    picture[row, column, channel] = int(old + (colour[channel] - old) * share + 0.5)

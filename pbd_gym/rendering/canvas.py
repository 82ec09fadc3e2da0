"""A picture to draw on, anti-aliased: lines, discs, polygons, writing, glass and soft shadows."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from math import ceil, floor
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pbd_gym.rendering.palette import Colour
from pbd_gym.rendering.raster import plane, space

if TYPE_CHECKING:
    import pygame

_READABLE = 13  # height of the smallest writing [pixels]
_LEAST_UNIT = 0.2  # thinner lines could not be seen in small pictures [pixels]
_FOR_WRITING = 200  # least side of a picture that has room for it [pixels]
_EVERYWHERE = 1e7  # coordinates are kept within, so that they fit whole numbers [pixels]


class Box(NamedTuple):
    """A part of a picture [pixels]; the right and the bottom are no part of it."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def corner(self) -> np.ndarray:
        """The upper left corner (2,)."""
        return np.array([self.left, self.top], dtype=np.float64)

    def of(self, array: np.ndarray, times: int = 1) -> np.ndarray:
        """Return this part of an array (height, width, ...), or of one some times finer."""
        rows = slice(self.top * times, self.bottom * times)
        return array[rows, self.left * times : self.right * times]


class Canvas:
    """A picture that shapes are laid upon, each as opaque as the part of a pixel that it covers.

    It needs neither a display nor an initialised pygame. Coordinates are x and y, y down, in
    pixels; the first pixel covers the square from (0, 0) to (1, 1).

    Args:
        size: Width and height of the picture [pixels].

    Attributes:
        size: As given.
        unit: 1/512 of the picture's smaller side, but at least 0.2 [pixels]: what is not measured
            in metres, such as the width of a line, is measured in units and so looks alike at
            every size.
        picture: What is drawn, (height, width, 3) uint8.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        width, height = self.size = size
        self.unit = max(min(size) / 512.0, _LEAST_UNIT)
        self.picture = np.zeros((height, width, 3), dtype=np.uint8)
        self._background = self.picture.copy()
        self._coverage = np.zeros((height, width), dtype=np.float32)
        self._nearest = np.zeros((height, width), dtype=np.int32)

    def keep_as_background(self) -> None:
        """Keep what is drawn so far as the background of all later pictures."""
        self._background = self.picture.copy()

    def clear(self) -> None:
        """Start a new picture: the background alone."""
        np.copyto(self.picture, self._background)

    def frame(self) -> np.ndarray:
        """Return the picture as a fresh array (height, width, 3) of uint8."""
        return self.picture.copy()

    def show_on(self, surface: pygame.Surface) -> None:
        """Draw the picture on a pygame surface of its size."""
        import pygame

        surface.blit(pygame.image.frombuffer(self.picture.data, self.size, "RGB"), (0, 0))

    def around(self, points: np.ndarray, pad: float) -> Box:
        """Return the part of the canvas within `pad` of the finite points."""
        bounds = plane.bounds(_real(points))
        if bounds[0] > bounds[2]:
            return Box(0, 0, 0, 0)
        width, height = self.size
        left, right = (min(max(x, -pad - 1.0), width + pad + 1.0) for x in bounds[::2])
        top, bottom = (min(max(y, -pad - 1.0), height + pad + 1.0) for y in bounds[1::2])
        return Box(
            max(floor(left - pad), 0),
            max(floor(top - pad), 0),
            min(max(ceil(right + pad), 0), width),
            min(max(ceil(bottom + pad), 0), height),
        )

    def paste(self, pixels: np.ndarray) -> None:
        """Cover the canvas with an array (height, width, 3) of uint8 of its own size."""
        np.copyto(self.picture, pixels)

    def polygon(self, points: np.ndarray, colour: Colour, opacity: float = 1.0) -> None:
        """Fill a polygon with corners (M, 2)."""
        box = self.around(points, 1.0)
        plane.cover_polygon(_whole(points) - box.corner, box.of(self._coverage))
        box.of(self._nearest)[...] = 0
        self._blend(box, np.array([colour], dtype=np.float64), opacity)

    def disc(self, centre: np.ndarray, radius: float, colour: Colour, width: float = 0.0) -> None:
        """Fill a disc around (2,); with a width, draw a ring that ends at the radius."""
        if width:
            angles = np.linspace(0.0, 2.0 * np.pi, 65)
            rim = (radius - width / 2.0) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
            self.stroke(centre + rim, width, colour)
        else:
            self.discs(centre[None], np.array([radius]), np.array([colour]))

    def discs(self, centres: np.ndarray, radii: np.ndarray, colours: np.ndarray) -> None:
        """Fill discs around (M, 2) of radii (M,) in colours (M, 3), one after the other."""
        plane.draw_discs(self.picture, _whole(centres), _real(radii), _real(colours))

    def stroke(
        self, points: np.ndarray, width: float, colour: Colour | np.ndarray, opacity: float = 1.0
    ) -> None:
        """Draw a line of constant width with round joints and ends through points (M, 2).

        Its colour is one for all, or (M - 1, 3): one for each piece.
        """
        self.strokes(np.stack([points[:-1], points[1:]], axis=1), width, colour, opacity)

    def strokes(
        self, ends: np.ndarray, width: float, colour: Colour | np.ndarray, opacity: float = 1.0
    ) -> None:
        """Draw lines between ends (M, 2, 2) as one shape: where they cross, nothing shows twice.

        The colour is one for all, or (M, 3): one for each line.
        """
        if not len(ends):
            return
        box = self.around(ends.reshape(-1, 2), width / 2.0 + 1.0)
        local = _whole(ends) - box.corner
        radii = np.full(len(ends), width / 2.0)
        parts = box.of(self._coverage), box.of(self._nearest)
        plane.cover_lines(local[:, 0], local[:, 1], radii, *parts)
        self._blend(box, np.broadcast_to(_real(colour), (len(ends), 3)), opacity)

    def bar(self, start: tuple[float, float], end: tuple[float, float], colour: Colour) -> None:
        """Fill a rectangle with slightly rounded corners that stands upright, corner to corner."""
        low, high = np.minimum(start, end), np.maximum(start, end)
        radius = min(1.5 * self.unit, float((high - low).min()) / 2.0)
        turns = np.radians([180.0, 210.0, 240.0, 270.0])
        corners = [high - radius, (low[0] + radius, high[1] - radius), low + radius]
        corners.append((high[0] - radius, low[1] + radius))
        rim = [
            np.array(corner) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            for corner, angle in zip(
                corners, turns + np.radians([[180], [270], [0], [90]]), strict=True
            )
        ]
        self.polygon(np.concatenate(rim), colour)

    def text_size(self, words: str, height: float) -> tuple[int, int]:
        """Return width and height of a line of text [pixels]; (0, 0) where there is no room."""
        if min(self.size) < _FOR_WRITING:
            return 0, 0
        rows, columns = _writing(words, max(round(height), _READABLE)).shape
        return columns, rows

    def text(self, words: str, centre: tuple[float, float], height: float, colour: Colour) -> None:
        """Write a line of text around a point, unless the picture is too small for any."""
        columns, rows = self.text_size(words, height)
        if not columns:
            return
        ink = _writing(words, max(round(height), _READABLE))
        left, top = round(centre[0] - columns / 2.0), round(centre[1] - rows / 2.0)
        box = Box(
            max(left, 0),
            max(top, 0),
            min(left + columns, self.size[0]),
            min(top + rows, self.size[1]),
        )
        ink = ink[box.top - top : box.bottom - top, box.left - left : box.right - left]
        box.of(self._coverage)[...] = ink
        box.of(self._nearest)[...] = 0
        self._blend(box, np.array([colour], dtype=np.float64), 1.0)

    @contextmanager
    def translucent(self, opacity: float, points: np.ndarray, pad: float) -> Iterator[None]:
        """Lay all that is drawn inside over the picture as one translucent sheet of glass.

        Args:
            opacity: From 0, invisible, to 1.
            points: (M, 2) around which it is drawn; points that are not finite do not count.
            pad: How far around them [pixels].
        """
        box = self.around(points, pad)
        part = box.of(self.picture)
        before = part.astype(np.float32)
        yield
        part[...] = np.rint(before + (part - before) * np.float32(opacity))

    def shadow(self, quads: np.ndarray, opacity: np.ndarray, colour: Colour) -> None:
        """Cast soft shadows; where they overlap, the darkest counts.

        Args:
            quads: (M, 4, 2) corners of M quadrilaterals.
            opacity: (M,) of each, in [0, 1].
            colour: Of all of them.
        """
        if not len(quads):
            return
        cell = max(round(3.0 * self.unit), 1)  # shadows are soft, so a coarse mask does [pixels]
        box = self.around(quads.reshape(-1, 2), 5.0 * cell)
        mask = np.zeros([-(-side // cell) + 1 for side in box.of(self.picture).shape[:2]])
        space.darken((_whole(quads) - box.corner) / cell, _real(opacity), mask)
        soft = _smoothed(_smoothed(mask).T).T
        space.tint(soft, cell, _real(colour), box.of(self.picture))

    def _blend(self, box: Box, colours: np.ndarray, opacity: float) -> None:
        coverage, nearest = box.of(self._coverage), box.of(self._nearest)
        plane.blend(box.of(self.picture), coverage, nearest, np.ascontiguousarray(colours), opacity)


def ribbon(points: np.ndarray, width: float) -> np.ndarray:
    """Return the rectangles (M - 1, 4, 2) along a line through points (M, 2) of a width."""
    along = np.diff(points, axis=0)
    length = np.hypot(along[:, 0], along[:, 1])
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(length, 1e-9)[:, None]
    side = across * (width / 2.0)
    start, end = points[:-1], points[1:]
    return np.stack([start + side, end + side, end - side, start - side], axis=1)


def _real(values: object) -> np.ndarray:
    """Return values as a contiguous array of float64."""
    return np.ascontiguousarray(values, dtype=np.float64)


def _whole(points: np.ndarray) -> np.ndarray:
    """Return points as float64, no farther than whole numbers reach."""
    return np.clip(_real(points), -_EVERYWHERE, _EVERYWHERE)


@lru_cache(maxsize=256)
def _writing(words: str, height: int) -> np.ndarray:
    """Return how much of each pixel a line of text covers, (rows, columns) in [0, 1]."""
    import pygame

    pygame.font.init()
    # Four times as large and averaged: letters of few pixels are bent to whole ones.
    label = pygame.font.Font(None, 4 * height).render(words, True, (255, 255, 255))
    ink = pygame.surfarray.array_alpha(label).T.astype(np.float32) / np.float32(255.0)
    rows, columns = (-(-side // 4) for side in ink.shape)
    whole = np.zeros((4 * rows, 4 * columns), dtype=np.float32)
    whole[: ink.shape[0], : ink.shape[1]] = ink
    return whole.reshape(rows, 4, columns, 4).mean(axis=(1, 3))


def _smoothed(values: np.ndarray) -> np.ndarray:
    """Return values (M, K) averaged along the first axis with weights 1, 4, 6, 4, 1."""
    padded = np.pad(values, ((2, 2), (0, 0)))
    ends, inner = padded[:-4] + padded[4:], padded[1:-3] + padded[3:-1]
    return (ends + 4.0 * inner + 6.0 * values) / 16.0

"""A picture to draw on, anti-aliased: lines, discs, polygons, glass and soft shadows."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from pbd_gym.rendering.palette import Colour

if TYPE_CHECKING:
    import pygame


class Canvas:
    """A surface some times larger than the picture; `frame` averages it down to the picture.

    It needs neither a display nor an initialised pygame. Only the part that was drawn upon since
    `clear` costs time.

    Args:
        size: Width and height of the picture [pixels].

    Attributes:
        size: Width and height of the canvas [canvas pixels]; all coordinates are meant in these.
        unit: 1/512 of the picture's smaller side [canvas pixels]: what is not measured in metres,
            such as the width of a line, is measured in units and so looks alike at every size.
        surface: Where everything is drawn.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        import pygame

        self._pygame: ModuleType = pygame
        # Large pictures need less smoothing and would pay most for it. Powers of two, because
        # smoothscale divides exactly by them and else darkens the picture by a shade.
        self._supersampling = 4 if max(size) <= 512 else 2
        self.size = (size[0] * self._supersampling, size[1] * self._supersampling)
        self.unit = min(self.size) / 512.0
        self.surface = self._new_surface(self.size)
        self._touched = self.surface.get_rect()
        self._background = self._new_surface(self.size)
        self._background_picture = np.zeros((size[1], size[0], 3), dtype=np.uint8)
        self._small_background: pygame.Surface | None = None
        self._layer: pygame.Surface | None = None
        self._shadow_layer: pygame.Surface | None = None

    def keep_as_background(self) -> None:
        """Keep what is drawn so far as the background of all later pictures."""
        self._touched = self.surface.get_rect()
        self._background.blit(self.surface, (0, 0))
        self._background_picture = self.frame()
        self._small_background = None

    def clear(self) -> None:
        """Start a new picture: the background alone."""
        self.surface.blit(self._background, self._touched, self._touched)
        self._touched = self._pygame.Rect(0, 0, 0, 0)

    def frame(self) -> np.ndarray:
        """Return the picture as a fresh array (height, width, 3) of uint8."""
        times = self._supersampling
        picture = self._background_picture.copy()
        box = self._touched
        left, top = box.left // times, box.top // times
        right, bottom = -(-box.right // times), -(-box.bottom // times)
        width, height = right - left, bottom - top
        if not (width and height):
            return picture
        part = self.surface.subsurface([times * side for side in (left, top, width, height)])
        small = self._pygame.transform.smoothscale(part, (width, height))
        pixels = np.frombuffer(small.get_buffer(), dtype=np.uint8).reshape(height, -1, 4)
        for channel in range(3):  # three strided copies; one of (..., :3) takes eight times as long
            picture[top:bottom, left:right, channel] = pixels[:, :width, channel]
        return picture

    def show_on(self, surface: pygame.Surface) -> None:
        """Draw the picture on another surface of the picture's size, faster than by `frame`."""
        if self._small_background is None:
            data = self._background_picture.tobytes()
            size = (self.size[0] // self._supersampling, self.size[1] // self._supersampling)
            image = self._pygame.image.frombuffer(data, size, "RGB")
            self._small_background = self._new_surface(size)
            self._small_background.blit(image, (0, 0))
        surface.blit(self._small_background, (0, 0))
        times, box = self._supersampling, self._touched
        left, top = box.left // times, box.top // times
        size = (-(-box.right // times) - left, -(-box.bottom // times) - top)
        if size[0] and size[1]:
            part = self.surface.subsurface([times * side for side in (left, top, *size)])
            surface.blit(self._pygame.transform.smoothscale(part, size), (left, top))

    def touch(self, box: Any) -> None:
        """Note that the part of the canvas within a rectangle has been drawn upon."""
        seen = self._pygame.Rect(box).clip(self.surface.get_rect())
        if seen.width and seen.height:
            self._touched = self._touched.union(seen) if self._touched.width else seen

    def around(self, points: np.ndarray, pad: float) -> pygame.Rect:
        """Return the part of the canvas within `pad` of the finite points."""
        seen = points[np.isfinite(points).all(axis=1)]
        if not len(seen):
            return self._pygame.Rect(0, 0, 0, 0)
        low = np.floor(seen.min(axis=0) - pad).astype(int)
        high = np.ceil(seen.max(axis=0) + pad).astype(int)
        box = self._pygame.Rect(low.tolist(), (high - low).tolist())
        return box.clip(self.surface.get_rect())

    def paste(self, pixels: np.ndarray) -> None:
        """Cover the canvas with an array (height, width, 3) of uint8 of the canvas' own size."""
        data = np.ascontiguousarray(pixels).tobytes()
        image = self._pygame.image.frombuffer(data, self.size, "RGB")
        self.touch(self.surface.blit(image, (0, 0)))

    def polygon(self, points: np.ndarray, colour: Colour) -> None:
        """Fill a polygon with corners (M, 2)."""
        self.touch(self.around(points, 2.0))
        self.fill_polygon(np.rint(points).astype(int).tolist(), colour)

    def fill_polygon(self, corners: list[list[int]], colour: Sequence[int]) -> None:
        """Fill one of many polygons, of whole corners; the caller notes them all by `touch`."""
        self._pygame.draw.polygon(self.surface, colour, corners)

    def disc(self, centre: np.ndarray, radius: float, colour: Colour, width: float = 0.0) -> None:
        """Fill a disc around (2,); with a width, draw a ring that ends at the radius."""
        x, y = np.rint(centre).astype(int).tolist()
        size, ring = max(round(radius), 1), max(round(width), 1) if width else 0
        self.touch(self._pygame.draw.circle(self.surface, colour, (x, y), size, ring))

    def stroke(self, points: np.ndarray, width: float, colour: Colour) -> None:
        """Draw a line of constant width with round joints and ends through points (M, 2)."""
        draw, radius = self._pygame.draw, max(round(width / 2.0), 1)
        for quad in np.rint(ribbon(points, width)).astype(int).tolist():
            draw.polygon(self.surface, colour, quad)
        for centre in np.rint(points).astype(int).tolist():
            draw.circle(self.surface, colour, centre, radius)
        self.touch(self.around(points, width / 2.0 + 2.0))

    def polylines(self, runs: Sequence[np.ndarray], width: float, colour: Colour) -> None:
        """Draw many lines through points (M, 2) each, fast and without round joints."""
        if not len(runs):
            return
        whole = max(round(width), 1)
        for run in runs:
            self._pygame.draw.lines(self.surface, colour, False, run.tolist(), whole)
        self.touch(self.around(np.concatenate(runs), width + 2.0))

    def repeat(
        self, centres: np.ndarray, reach: float, paint: Callable[[np.ndarray], object]
    ) -> None:
        """Draw one mark around many points: painted once and copied.

        Args:
            centres: (M, 2).
            reach: How far the mark extends from its centre [canvas pixels].
            paint: Draws it around a point (2,).
        """
        half = int(np.ceil(reach)) + 1
        picture, touched = self.surface, self._touched
        mark = self.surface = self._new_surface((2 * half, 2 * half), alpha=True)
        try:
            paint(np.full(2, float(half)))
        finally:
            self.surface, self._touched = picture, touched
        corners = np.rint(centres - half).astype(int).tolist()
        self.surface.fblits([(mark, corner) for corner in corners])
        self.touch(self.around(centres, half + 1.0))

    def bar(self, start: tuple[float, float], end: tuple[float, float], colour: Colour) -> None:
        """Fill a rectangle that stands upright, from corner to corner."""
        x, y = min(start[0], end[0]), min(start[1], end[1])
        size = (abs(end[0] - start[0]), abs(end[1] - start[1]))
        radius = round(1.5 * self.unit)
        box = ((x, y), size)
        self.touch(self._pygame.draw.rect(self.surface, colour, box, border_radius=radius))

    def text(self, words: str, centre: tuple[float, float], height: float, colour: Colour) -> None:
        """Write a line of text around a point, unless it would be too small to read."""
        if height < 6.0 * self._supersampling:
            return
        self._pygame.font.init()
        font = self._pygame.font.Font(None, round(height))
        label = font.render(words, True, colour)
        place = label.get_rect(center=(round(centre[0]), round(centre[1])))
        self.touch(self.surface.blit(label, place))

    @contextmanager
    def translucent(self, opacity: float, points: np.ndarray, pad: float) -> Iterator[None]:
        """Lay all that is drawn inside over the picture as one translucent sheet of glass.

        Args:
            opacity: From 0, invisible, to 1.
            points: (M, 2) around which it is drawn; points that are not finite do not count.
            pad: How far around them [canvas pixels].
        """
        box = self.around(points, pad)
        if self._layer is None:
            self._layer = self._new_surface(self.size, alpha=True)
        picture, self.surface = self.surface, self._layer
        self.surface.fill((0, 0, 0, 0), box)
        try:
            yield
        finally:
            layer, self.surface = self.surface, picture
        layer.set_alpha(round(255 * opacity))
        self.touch(self.surface.blit(layer, box, box))

    def shadow(self, polygons: np.ndarray, opacity: np.ndarray, colour: Colour) -> None:
        """Cast soft shadows; where they overlap, the last one counts.

        Args:
            polygons: (M, K, 2) corners of M polygons.
            opacity: (M,) of each, in [0, 1].
            colour: Of all of them.
        """
        if not len(polygons):
            return
        # Shadows are soft, so coarse layers do: [canvas pixels] of a pixel as drawn and as blurred.
        drawn = max(round(2.0 * self.unit), 1)
        blurred = 2 * drawn
        if self._shadow_layer is None:
            width, height = (-(-side // blurred) * 2 for side in self.size)
            self._shadow_layer = self._new_surface((width, height), alpha=True)
        layer, smoothscale = self._shadow_layer, self._pygame.transform.smoothscale
        layer.fill((*colour, 0))
        alphas = np.rint(255 * opacity).astype(int).tolist()
        corners = np.rint(polygons / drawn).astype(int).tolist()
        for polygon, alpha in zip(corners, alphas, strict=True):
            self._pygame.draw.polygon(layer, (*colour, alpha), polygon)
        box = self.around(polygons.reshape(-1, 2), 3.0 * blurred)
        if not (box.width and box.height):
            return
        left, top = box.left // blurred, box.top // blurred
        width, height = -(-box.right // blurred) - left, -(-box.bottom // blurred) - top
        part = layer.subsurface([2 * v for v in (left, top, width, height)])
        coarse = smoothscale(part, (width, height))
        alpha = self._pygame.surfarray.pixels_alpha(coarse)
        alpha[...] = _smoothed(_smoothed(alpha.astype(np.float32)).T).T
        del alpha  # it locks the surface
        soft = smoothscale(coarse, (width * blurred, height * blurred))
        self.touch(self.surface.blit(soft, (left * blurred, top * blurred)))

    def _new_surface(self, size: tuple[int, int], *, alpha: bool = False) -> pygame.Surface:
        """Return a surface whose bytes are red, green, blue, alpha on every machine and display."""
        masks = [0x000000FF, 0x0000FF00, 0x00FF0000, 0xFF000000 if alpha else 0]
        if sys.byteorder == "big":
            masks = [0xFF000000, 0x00FF0000, 0x0000FF00, 0x000000FF if alpha else 0]
        return self._pygame.Surface(size, self._pygame.SRCALPHA if alpha else 0, 32, tuple(masks))


def ribbon(points: np.ndarray, width: float | np.ndarray) -> np.ndarray:
    """Return the rectangles (M - 1, 4, 2) along a line through points (M, 2) of a width."""
    along = np.diff(points, axis=0)
    length = np.hypot(along[:, 0], along[:, 1])
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(length, 1e-9)[:, None]
    side = across * np.reshape(width, (-1, 1)) / 2.0
    start, end = points[:-1], points[1:]
    return np.stack([start + side, end + side, end - side, start - side], axis=1)


def _smoothed(values: np.ndarray) -> np.ndarray:
    """Return values (M, K) averaged along the first axis with weights 1, 4, 6, 4, 1."""
    padded = np.pad(values, ((2, 2), (0, 0)))
    ends, inner = padded[:-4] + padded[4:], padded[1:-3] + padded[3:-1]
    return (ends + 4.0 * inner + 6.0 * values) / 16.0

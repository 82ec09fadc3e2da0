"""What the mouse does: drag, pin, cut and draw."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import pygame

from pbd_gym.playground import editing
from pbd_gym.playground.simulation import Grip
from pbd_gym.playground.stage import Stage

Pixel = tuple[int, int]

_SNAP = 14.0  # how near to a particle a stroke joins it [pixels]
_SPACING = 26.0  # of the particles of a stroke [pixels]
_CLICK = 6.0  # what moves less is a click [pixels]
_FLAT_ONLY = "Drawing needs a flat scene: in space, a stroke has no depth."


class Tool(Protocol):
    """What the left button of the mouse does between its press and its release."""

    hint: str

    def press(self, stage: Stage, pixel: Pixel) -> None:
        """Begin at a pixel."""

    def move(self, stage: Stage, pixel: Pixel) -> None:
        """Go on to a pixel."""

    def release(self, stage: Stage, pixel: Pixel) -> None:
        """End at a pixel."""

    def draw(self, surface: pygame.Surface, stage: Stage, pixel: Pixel) -> None:
        """Draw what is about to happen."""


class Drag:
    """Takes a particle along."""

    hint = "Drag particles; the right button pins and unpins them."

    def press(self, stage: Stage, pixel: Pixel) -> None:
        """Take the nearest particle."""
        particle = stage.nearest(pixel)
        if particle is not None:
            target = stage.point(pixel, particle)
            stage.simulation.grip = Grip(particle, target, stage.springs)

    def move(self, stage: Stage, pixel: Pixel) -> None:
        """Take it along."""
        grip = stage.simulation.grip
        if grip is not None:
            target = stage.point(pixel, grip.particle)
            stage.simulation.grip = Grip(grip.particle, target, stage.springs)

    def release(self, stage: Stage, pixel: Pixel) -> None:
        """Let it go."""
        stage.simulation.grip = None

    def draw(self, surface: pygame.Surface, stage: Stage, pixel: Pixel) -> None:
        """Mark what is held, or what would be."""
        grip = stage.simulation.grip
        particle = stage.nearest(pixel) if grip is None else grip.particle
        if particle is None:
            return
        place = stage.place_of(particle, pixel)
        if grip is not None:
            pygame.draw.aaline(surface, stage.view.shades.mark, place, pixel)
            pygame.draw.aacircle(surface, stage.view.shades.mark, pixel, 4)
        pygame.draw.aacircle(surface, stage.view.shades.mark, place, 10, 2)


class Pin:
    """Pins what is free and frees what is pinned."""

    hint = "Click a particle to pin it, or a pinned one to free it."

    def press(self, stage: Stage, pixel: Pixel) -> None:
        """Pin or free the nearest particle."""
        particle = stage.nearest(pixel)
        if particle is None:
            return
        drawing = editing.toggle_pin(stage.drawing, particle)
        state = "pinned" if drawing.particles[particle].pinned else "free"
        stage.edit(drawing, f"Particle {particle} is {state}.")

    def move(self, stage: Stage, pixel: Pixel) -> None:
        """Do nothing."""

    def release(self, stage: Stage, pixel: Pixel) -> None:
        """Do nothing."""

    def draw(self, surface: pygame.Surface, stage: Stage, pixel: Pixel) -> None:
        """Mark what would be pinned."""
        particle = stage.nearest(pixel)
        if particle is not None:
            pygame.draw.aacircle(
                surface, stage.view.shades.mark, stage.place_of(particle, pixel), 10, 2
            )


class Cut:
    """Cuts the links that a stroke crosses."""

    hint = "Draw a stroke across links to cut them."

    def __init__(self) -> None:
        self._last: Pixel | None = None
        self._trail: list[Pixel] = []

    def press(self, stage: Stage, pixel: Pixel) -> None:
        """Begin a stroke."""
        self._last, self._trail = pixel, [pixel]

    def move(self, stage: Stage, pixel: Pixel) -> None:
        """Cut what lies between the last pixel and this one."""
        if self._last is None or pixel == self._last:
            return
        seen = stage.view.pixels(stage.simulation, pixel)
        stroke = np.array([self._last, pixel], dtype=np.float64)
        crossed = editing.crossed_links(stage.drawing, seen, stroke)
        if crossed:
            links = "link" if len(crossed) == 1 else "links"
            stage.edit(editing.cut(stage.drawing, crossed), f"Cut {len(crossed)} {links}.")
        self._last = pixel
        self._trail = [*self._trail[-12:], pixel]

    def release(self, stage: Stage, pixel: Pixel) -> None:
        """End the stroke."""
        self.move(stage, pixel)
        self._last, self._trail = None, []

    def draw(self, surface: pygame.Surface, stage: Stage, pixel: Pixel) -> None:
        """Show the last part of the stroke."""
        if len(self._trail) > 1:
            pygame.draw.lines(surface, stage.view.shades.mark, False, self._trail, 2)


class Draw:
    """Adds ropes, soft bodies and balls."""

    hint = "Draw a rope; close a loop for a soft body; click for a ball."

    def __init__(self) -> None:
        self._stroke: list[Pixel] = []
        self._start: int | None = None  # particle at which the stroke begins

    def press(self, stage: Stage, pixel: Pixel) -> None:
        """Begin a stroke."""
        if stage.drawing.dim == 3:
            stage.message = _FLAT_ONLY
            return
        self._stroke, self._start = [pixel], stage.nearest(pixel, _SNAP)

    def move(self, stage: Stage, pixel: Pixel) -> None:
        """Go on with the stroke."""
        if self._stroke and pixel != self._stroke[-1]:
            self._stroke.append(pixel)

    def release(self, stage: Stage, pixel: Pixel) -> None:
        """Add what the stroke has drawn."""
        self.move(stage, pixel)
        stroke, self._stroke = np.array(self._stroke, dtype=np.float64), []
        if not len(stroke):
            return
        length = float(np.linalg.norm(np.diff(stroke, axis=0), axis=1).sum())
        start, end = self._start, stage.nearest(pixel, _SNAP)
        if length < _CLICK:
            self._add_ball(stage, stroke[0])
        elif start is None and end is None and _is_loop(stroke, length):
            points = _points(stage, editing.resample(stroke, _SPACING, closed=True))
            stage.edit(editing.draw_outline(stage.drawing, points), "Drew a soft body.")
        else:
            for particle, at in ((start, 0), (end, -1)):
                if particle is not None:
                    stroke[at] = stage.place_of(particle, pixel)
            points = _points(stage, editing.resample(stroke, _SPACING))
            stage.edit(editing.draw_line(stage.drawing, points, start, end), "Drew a rope.")

    def draw(self, surface: pygame.Surface, stage: Stage, pixel: Pixel) -> None:
        """Show the stroke, and the particle that it would join."""
        if len(self._stroke) > 1:
            pygame.draw.lines(surface, stage.view.shades.mark, False, self._stroke, 2)
        particle = stage.nearest(pixel, _SNAP) if stage.drawing.dim == 2 else None
        if particle is not None:
            pygame.draw.aacircle(
                surface, stage.view.shades.mark, stage.place_of(particle, pixel), 8, 2
            )

    def _add_ball(self, stage: Stage, pixel: np.ndarray) -> None:
        point = _points(stage, pixel[None])[0]
        stage.edit(editing.draw_ball(stage.drawing, point), "Drew a ball.")


TOOLS: dict[str, type[Drag] | type[Pin] | type[Cut] | type[Draw]] = {
    "Drag": Drag,
    "Pin": Pin,
    "Cut": Cut,
    "Draw": Draw,
}


def _is_loop(stroke: np.ndarray, length: float) -> bool:
    """Tell whether a stroke comes back to where it began."""
    return length > 4.0 * _SPACING and float(np.linalg.norm(stroke[-1] - stroke[0])) < _SPACING


def _points(stage: Stage, pixels: np.ndarray) -> np.ndarray:
    """Return the points (M, 2) [m] that are seen at pixels (M, 2)."""
    return np.array([stage.point((x, y)) for x, y in pixels.tolist()])

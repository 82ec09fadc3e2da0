"""Shows a simulation in a part of the window, and tells what is where."""

from __future__ import annotations

import numpy as np
import pygame

from pbd_gym.playground.drawing import Drawing
from pbd_gym.playground.energy import style
from pbd_gym.playground.simulation import Simulation
from pbd_gym.playground.theme import SHADES, Shades, write
from pbd_gym.rendering import Renderer

_GAP = 2  # between two pictures side by side [pixels]


class View:
    """One picture of a simulation, or two side by side.

    Args:
        place: Part of the window.

    Attributes:
        place: As given.
        strains: Whether links are coloured by how much they are stretched or pressed.
        theme: "light" or "dark".
    """

    def __init__(self, place: pygame.Rect, *, strains: bool = False, theme: str = "light") -> None:
        self.place = place
        self.strains = strains
        self.theme = theme
        self._renderers: dict[str, Renderer] = {}
        self._pictures: dict[str, pygame.Rect] = {}
        self._shown: tuple[object, ...] = ()

    @property
    def shades(self) -> Shades:
        """The colours of the window."""
        return SHADES[self.theme]

    def show(self, surface: pygame.Surface, simulation: Simulation) -> None:
        """Draw all worlds of a simulation on the window."""
        self._fit(simulation)
        surface.fill(self.shades.paper, self.place)
        for name, renderer in self._renderers.items():
            place = self._pictures[name]
            renderer.draw_on(surface.subsurface(place), simulation.worlds[name].x[0])
            if simulation.is_compared:
                words, colour = style(name, self.shades)
                write(surface, words, (place.left + 14, place.top + 10), colour, 15)
        if simulation.is_compared:
            middle = self.place.centerx
            ends = ((middle, self.place.top), (middle, self.place.bottom))
            pygame.draw.line(surface, self.shades.line, *ends, _GAP)

    def pixels(self, simulation: Simulation, near: tuple[float, float]) -> np.ndarray:
        """Return where particles are seen in the picture under a pixel, (N, 2) of the window."""
        name = self._picture_at(simulation, near)
        seen, _ = self._renderers[name].project(simulation.worlds[name].x[0])
        return seen + self._pictures[name].topleft

    def nearest(
        self, simulation: Simulation, pixel: tuple[float, float], reach: float
    ) -> int | None:
        """Return the particle that is seen nearest to a pixel, or None if none is in reach."""
        apart = np.linalg.norm(self.pixels(simulation, pixel) - pixel, axis=1)
        apart[~np.isfinite(apart)] = np.inf
        best = int(np.argmin(apart))
        return best if apart[best] <= reach else None

    def point(
        self, simulation: Simulation, pixel: tuple[float, float], like: int | None = None
    ) -> np.ndarray:
        """Return the point (dim,) [m] that is seen at a pixel, as deep in space as a particle."""
        name = self._picture_at(simulation, pixel)
        renderer, corner = self._renderers[name], self._pictures[name].topleft
        _, depths = renderer.project(simulation.worlds[name].x[0])
        depth = depths[[0 if like is None else like]]
        inside = np.array([pixel], dtype=np.float64) - corner
        return renderer.unproject(inside, depth)[0]

    def _picture_at(self, simulation: Simulation, pixel: tuple[float, float]) -> str:
        self._fit(simulation)
        for name, place in self._pictures.items():
            if place.collidepoint(pixel):
                return name
        return next(iter(self._pictures))

    def _fit(self, simulation: Simulation) -> None:
        """Make new renderers where there is something else to draw."""
        wanted = (simulation, simulation.revision, tuple(simulation.worlds), self.strains)
        if wanted == self._shown:
            return
        self._shown = wanted
        count = len(simulation.worlds)
        # pictures have even sides
        width = (self.place.width - _GAP * (count - 1)) // count // 2 * 2
        height = self.place.height // 2 * 2
        self._pictures, self._renderers = {}, {}
        for column, (name, world) in enumerate(simulation.worlds.items()):
            left = self.place.left + column * (width + _GAP)
            self._pictures[name] = pygame.Rect(left, self.place.top, width, height)
            view = _with_ground(simulation.drawing)
            color = "strain" if self.strains else "material"
            self._renderers[name] = Renderer(
                world.model, view, size=(width, height), color=color, theme=self.theme
            )


def _with_ground(drawing: Drawing) -> tuple[np.ndarray, np.ndarray]:
    """Return corners of the view that leave room for the scale below a ground seen edge-on."""
    lower, upper = (np.array(corner, dtype=np.float64) for corner in drawing.view)
    if drawing.dim == 2:
        lower[1] -= 0.08 * (upper[1] - lower[1])
    return lower, upper

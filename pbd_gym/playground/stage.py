"""What the tools work on: the simulation, the view of it, and what there is to say."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np

from pbd_gym.playground.drawing import Drawing
from pbd_gym.playground.files import Scene
from pbd_gym.playground.simulation import Simulation
from pbd_gym.playground.view import View

_REMEMBERED = 100  # edits that can be undone


class Stage:
    """A simulation and its view.

    Attributes:
        simulation: What moves.
        view: Where it is seen.
        message: The last thing to tell the user.
        springs: Whether the mouse drags by a spring; else by hand.
    """

    def __init__(self, simulation: Simulation, view: View) -> None:
        self.simulation = simulation
        self.view = view
        self.message = ""
        self.springs = True
        self._before: deque[Scene] = deque(maxlen=_REMEMBERED)

    @property
    def drawing(self) -> Drawing:
        """The drawing as it is now."""
        return self.simulation.drawing

    def edit(self, drawing: Drawing, done: str = "") -> None:
        """Go on with another drawing, or say why that cannot be."""
        before = self.simulation.scene()
        try:
            self.simulation.change(drawing)
        except ValueError as error:
            self.message = f"That cannot be: {error}"
            return
        if replace(drawing, settings=before.drawing.settings) != before.drawing:
            self._before.append(before)
        self.message = done

    def undo(self) -> None:
        """Go back to just before the last edit: all is where it was; the sliders stay."""
        if not self._before:
            self.message = "There is nothing to undo."
            return
        scene = self._before.pop()
        drawing = replace(scene.drawing, settings=self.drawing.settings)
        self.simulation.change(drawing)
        self.simulation.place(scene.x, scene.v)
        self.message = "The last edit is undone."

    def reset(self) -> None:
        """Go back to the scene as it was loaded."""
        self.simulation.reset()
        self._before.clear()
        self.message = "As it was loaded."

    def nearest(self, pixel: tuple[float, float], reach: float = 28.0) -> int | None:
        """Return the particle that is seen nearest to a pixel, or None."""
        return self.view.nearest(self.simulation, pixel, reach)

    def place_of(self, particle: int, near: tuple[float, float]) -> tuple[float, float]:
        """Return where a particle is seen in the picture under a pixel."""
        x, y = self.view.pixels(self.simulation, near)[particle]
        return float(x), float(y)

    def point(self, pixel: tuple[float, float], like: int | None = None) -> np.ndarray:
        """Return the point that is seen at a pixel, as deep as a particle (dim,) [m]."""
        return self.view.point(self.simulation, pixel, like)

"""Compiles the physics in the background, so that the window never freezes."""

from __future__ import annotations

import threading

import numpy as np

from pbd_gym.physics import World
from pbd_gym.playground.building import build_model
from pbd_gym.playground.drawing import Drawing, Particle
from pbd_gym.playground.simulation import shown

Variant = tuple[int, str]


class Preparation:
    """Which variants of the kernels are loaded, and the thread that loads the next.

    There is one variant for each number of axes and integrator: drawings share them. The first
    time ever they are compiled, later read from disk.
    """

    def __init__(self) -> None:
        self._ready: set[Variant] = set()
        self._thread: threading.Thread | None = None
        self._error: Exception | None = None

    def is_ready(self, drawing: Drawing) -> bool:
        """Tell whether a drawing can be stepped without waiting; if not, begin to load.

        Raises:
            RuntimeError: If the kernels could not be compiled.
        """
        if self._error is not None:
            raise RuntimeError(f"the physics could not be compiled: {self._error}")
        missing = {(drawing.dim, name) for name in shown(drawing)} - self._ready
        if missing and (self._thread is None or not self._thread.is_alive()):
            loading = (sorted(missing),)
            self._thread = threading.Thread(target=self._load, args=loading, daemon=True)
            self._thread.start()
        return not missing

    def wait(self, drawing: Drawing) -> None:
        """Return when a drawing can be stepped."""
        while not self.is_ready(drawing):
            assert self._thread is not None
            self._thread.join()

    def _load(self, variants: list[Variant]) -> None:
        try:
            for dim, integrator in variants:
                _step_once(dim, integrator)
                self._ready.add((dim, integrator))
        except Exception as error:  # shown by whoever asks next, in the window's own thread
            self._error = error


def _step_once(dim: int, integrator: str) -> None:
    """Step the smallest drawing, which loads the kernels."""
    origin = (0.0,) * dim
    view = ((-1.0,) * dim, (1.0,) * dim)
    drawing = Drawing("", dim, view, (Particle(origin),))
    World(build_model(drawing, integrator), dtype=np.float64, num_threads=1).step(1e-3, 1)

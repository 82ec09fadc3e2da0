"""Strain as a colour: how much longer or shorter each link is than it shall be, or larger an area.

Bends, hinges, folds, rest shapes and the volumes of bodies in space have no colour.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pbd_gym.physics.model import Model
from pbd_gym.physics.readouts import volume_strains
from pbd_gym.rendering.canvas import Canvas
from pbd_gym.rendering.palette import Theme

GREATEST = 0.1  # strains beyond have the last colour
_LINEAR = 0.001  # up to about here the scale is linear, beyond logarithmic
_TICKS = (-0.1, -0.01, -0.001, 0.0, 0.001, 0.01, 0.1)

# Diverging from blue (short) over grey to red (long), after ColorBrewer's RdBu: both ends differ
# in hue and from the middle in lightness with every colour vision.
_STOPS = np.linspace(-1.0, 1.0, 7)
_SHORT_AND_LONG = {
    "light": ("184890", "3482be", "84b6d6", "c4c6c8", "f0a078", "d85442", "961028"),
    "dark": ("3c82ff", "468ee2", "5484b0", "70767e", "be745c", "ec604c", "ff4646"),
}


class Strains:
    """Rest lengths of a model's links, and the colours of their strains.

    A pair of particles that no link holds has the rest length in which the model was built.

    Args:
        model: Whose links they are.
        theme: "light" or "dark".
    """

    def __init__(self, model: Model, theme: str) -> None:
        pairs, rest = model.links()
        self.pairs = np.concatenate([pairs, model.distances.pairs]).astype(np.int64)
        self._rest = np.concatenate([rest, model.distances.rest])
        self._positions = model.positions
        self._model, self._contents = model, contents_of(model)
        stops = [list(bytes.fromhex(stop)) for stop in _SHORT_AND_LONG[theme]]
        self._colours = np.array(stops, dtype=np.float64)
        # All pairs as sorted numbers, to find the rest length of any.
        self._count = len(model.inverse_mass)
        numbers = self._numbers(self.pairs)
        order = np.argsort(numbers, kind="stable")
        self._sorted, self._sorted_rest = numbers[order], self._rest[order]

    def of_pairs(self, pairs: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return the strains (M,) of pairs of particles (M, 2) at positions (N, dim) [m]."""
        rest = np.linalg.norm(np.diff(self._positions[pairs], axis=1)[:, 0], axis=1)
        if len(self._sorted):
            numbers = self._numbers(pairs)
            place = np.minimum(np.searchsorted(self._sorted, numbers), len(self._sorted) - 1)
            rest = np.where(self._sorted[place] == numbers, self._sorted_rest[place], rest)
        return _strain(x, pairs, rest)

    def of_particles(self, x: np.ndarray) -> np.ndarray:
        """Return the strain of greatest size among the links of each particle, (N,)."""
        strain = np.nan_to_num(_strain(x, self.pairs, self._rest))
        longest, shortest = np.zeros(self._count), np.zeros(self._count)
        for end in self.pairs.T:
            np.maximum.at(longest, end, strain)
            np.minimum.at(shortest, end, strain)
        return np.where(longest >= -shortest, longest, shortest)

    def of_content(self, particles: np.ndarray, x: np.ndarray) -> float | None:
        """Return the relative change of the area within particles (M,), None if it is not kept."""
        index = self._contents.get(frozenset(particles.tolist()))
        return None if index is None else float(volume_strains(self._model, x[None])[0, index])

    def of_grid(self, grid: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return the strain of greatest size among the threads at particles (rows, columns)."""
        greatest = np.zeros(grid.shape)
        for axis in (0, 1):
            rows = grid if axis else grid.T
            pairs = np.stack([rows[:, :-1], rows[:, 1:]], axis=2).reshape(-1, 2)
            strain = np.nan_to_num(self.of_pairs(pairs, x)).reshape(len(rows), -1)
            padded = np.pad(strain, ((0, 0), (1, 1)))
            larger = _larger(padded[:, :-1], padded[:, 1:])
            greatest = _larger(greatest, larger if axis else larger.T)
        return greatest

    def colours(self, strain: np.ndarray) -> np.ndarray:
        """Return the colours (..., 3) in [0, 255] of strains (...)."""
        place = scale(np.nan_to_num(strain))
        channels = [np.interp(place, _STOPS, channel) for channel in self._colours.T]
        return np.stack(channels, axis=-1)

    def of_row(self, particles: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return the colours (M - 1, 3) of the links between particles (M,) in a row."""
        return self.colours(self.of_pairs(np.stack([particles[:-1], particles[1:]], axis=1), x))

    def _numbers(self, pairs: np.ndarray) -> np.ndarray:
        return pairs.min(axis=1) * self._count + pairs.max(axis=1)


def contents_of(model: Model) -> dict[frozenset[int], int]:
    """Return the index of each area or volume that a model keeps, by its particles."""
    table = model.volumes
    if table is None:
        return {}
    rows = pairwise(table.offsets.tolist())
    return {frozenset(table.particles[a:b].tolist()): k for k, (a, b) in enumerate(rows)}


def scale(strain: np.ndarray) -> np.ndarray:
    """Return the places of strains on the legend, in [-1, 1]: linear about 0, then logarithmic."""
    size = np.log1p(np.abs(strain) / _LINEAR) / np.log1p(GREATEST / _LINEAR)
    return np.sign(strain) * np.minimum(size, 1.0)


def paint_legend(canvas: Canvas, strains: Strains, theme: Theme) -> None:
    """Draw the scale of colours in percent along the lower right edge."""
    u = canvas.unit
    _, rows = canvas.text_size("0", 16.0 * u)
    width, height = max(190.0 * u, 112.0 if rows else 0.0), 9.0 * u
    last, _ = canvas.text_size("+10 %", 16.0 * u)
    right, bottom = canvas.size[0] - 12.0 * u - last / 2.0, canvas.size[1] - 12.0 * u - 1.25 * rows
    left, steps = right - width, 96
    places = np.linspace(-1.0, 1.0, steps)
    size = _LINEAR * np.expm1(np.abs(places) * np.log1p(GREATEST / _LINEAR))
    edges = np.rint(np.linspace(left, right, steps + 1)).astype(int)
    colours = np.rint(strains.colours(np.sign(places) * size)).astype(np.uint8)
    top, base = round(bottom - height), max(round(bottom), round(bottom - height) + 1)
    for start, end, colour in zip(edges[:-1], edges[1:], colours, strict=True):
        canvas.picture[top:base, start:end] = colour
    for tick in _TICKS:
        x = left + width * (0.5 + 0.5 * float(scale(np.array(tick))))
        mark = np.array([[x, base], [x, base + 3.0 * u]])
        canvas.stroke(mark, max(1.0 * u, 0.8), theme.ink)
        if abs(tick) != min(abs(t) for t in _TICKS if t):
            words = f"{100 * tick:+g}" if tick else "0"
            words = words.replace("-", "−") + (" %" if tick == _TICKS[-1] else "")
            canvas.text(words, (x, base + 4.0 * u + 0.55 * rows), 16.0 * u, theme.ink)
    middle = ((left + right) / 2.0, top - 3.0 * u - 0.5 * rows)
    canvas.text("strain", middle, 16.0 * u, theme.ink)


def _larger(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return whichever of two arrays is larger in size, entry by entry."""
    return np.where(np.abs(a) >= np.abs(b), a, b)


def _strain(x: np.ndarray, pairs: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """Return length / rest length - 1 of pairs (M, 2) at positions (N, dim) [m], (M,)."""
    length = np.linalg.norm(x[pairs[:, 1]] - x[pairs[:, 0]], axis=1)
    return length / np.maximum(rest, 1e-12) - 1.0

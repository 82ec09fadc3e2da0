"""The curve of energy over time, one for each integrator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain

import numpy as np
import pygame

from pbd_gym.playground import theme
from pbd_gym.rendering.palette import Colour

_WORDS = {"pbd": "first order (the seed's)", "rattle": "second order (RATTLE)"}
_LEFT, _TOP, _BOTTOM, _RIGHT = 62, 36, 14, 16  # margins [pixels]


def draw_energies(
    surface: pygame.Surface,
    place: pygame.Rect,
    energies: Mapping[str, Sequence[float]],
    pictures: int,
    shades: theme.Shades,
) -> None:
    """Draw the curves.

    Args:
        surface: Of the window.
        place: Where on it.
        energies: By integrator, the latest values [J].
        pictures: How many values the width shows.
        shades: Colours of the window.
    """
    pygame.draw.rect(surface, shades.paper, place)
    pygame.draw.line(surface, shades.line, place.topleft, place.topright)
    theme.write(surface, "Energy [J]", (place.left + 12, place.top + 6), shades.faint, 13)
    at = place.left + 110
    for name in energies:
        words, colour = style(name, shades)
        pygame.draw.line(surface, colour, (at, place.top + 16), (at + 18, place.top + 16), 3)
        theme.write(surface, words, (at + 24, place.top + 6), colour, 13)
        at += 44 + theme.font(13).size(words)[0]
    area = pygame.Rect(
        place.left + _LEFT,
        place.top + _TOP,
        place.width - _LEFT - _RIGHT,
        place.height - _TOP - _BOTTOM,
    )
    low, high, step = _scale(list(chain.from_iterable(energies.values())))
    for value in np.arange(low, high + 0.5 * step, step):
        y = area.bottom - (value - low) / (high - low) * area.height
        pygame.draw.line(surface, shades.line, (area.left, y), (area.right, y))
        words = f"{value:.6g}"
        width, height = theme.font(12).size(words)
        corner = (area.left - 8 - width, y - height / 2)
        theme.write(surface, words, corner, shades.faint, 12)
    for name, values in energies.items():
        if len(values) > 1:
            x = area.left + np.arange(len(values)) * (area.width / (pictures - 1))
            y = area.bottom - (np.array(values) - low) / (high - low) * area.height
            pygame.draw.lines(
                surface, style(name, shades)[1], False, np.stack([x, y], 1).tolist(), 2
            )


def style(integrator: str, shades: theme.Shades) -> tuple[str, Colour]:
    """Return what an integrator is called, and the colour of its curve."""
    colour = shades.first_order if integrator == "pbd" else shades.second_order
    return _WORDS[integrator], colour


def _scale(values: Sequence[float]) -> tuple[float, float, float]:
    """Return least and greatest mark and their distance, so that all values lie between."""
    finite = np.array(values)[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    # what is constant but for rounding is shown as constant
    span = max(high - low, 1e-3 * max(abs(low), abs(high)), 1e-6)
    power = 10.0 ** np.floor(np.log10(span))
    step = power * next(k for k in (1.0, 2.0, 5.0, 10.0) if k * power >= span / 2.0)
    low = np.floor(low / step) * step
    return low, max(np.ceil(high / step) * step, low + step), step

"""Cloth as a mesh: a smooth surface through its particles, chequered and lit on both sides."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pbd_gym.rendering.curves import smooth_sheet
from pbd_gym.rendering.palette import Colour

_AMBIENT = 0.40  # light that a patch turned away from the lamp still receives
_BRIGHTEST = 1.18  # light that a patch facing the lamp receives
_STRIPE = 0.07  # how much darker each crossing stripe of the check is
_HEM = 0.16  # how much darker the outermost patches are


class Mesh(NamedTuple):
    """Patches of a cloth: corners (Q, 4, 3) [m] and colours (Q, 3) in [0, 255]."""

    patches: np.ndarray
    colours: np.ndarray


def weave(
    points: np.ndarray,
    pieces: int,
    eye: np.ndarray,
    light: np.ndarray,
    sides: tuple[Colour, Colour],
    holes: Sequence[tuple[int, int]] = (),
) -> Mesh:
    """Return the visible patches of a cloth, as the eye sees them lit.

    Args:
        points: Particles (rows, columns, 3) [m]; patches at one that is not finite are left out.
        pieces: Into how many patches each side between two particles is divided.
        eye: From where it is seen (3,) [m].
        light: Unit vector towards the lamp (3,).
        sides: Colours of the side on which rows, columns and normal are right-handed, and of the
            other.
        holes: Row and column of cells that are left out; then nothing is smoothed, as a curve
            would pull the two sides of a cut together.
    """
    surface = points if len(holes) else smooth_sheet(points, pieces)
    pieces = 1 if surface is points else pieces
    patches = np.stack(
        [surface[:-1, :-1], surface[:-1, 1:], surface[1:, 1:], surface[1:, :-1]], axis=2
    ).reshape(-1, 4, 3)
    tone = _pattern(surface.shape[0] - 1, surface.shape[1] - 1, pieces)
    seen = np.isfinite(patches).all(axis=(1, 2))
    for row, column in holes:
        seen[row * (surface.shape[1] - 1) + column] = False
    patches, tone = patches[seen], tone[seen]
    normal = np.cross(patches[:, 2] - patches[:, 0], patches[:, 3] - patches[:, 1])
    return Mesh(patches, shade(patches, normal, tone, eye, light, sides))


def shade(
    patches: np.ndarray,
    normal: np.ndarray,
    tone: np.ndarray,
    eye: np.ndarray,
    light: np.ndarray,
    sides: tuple[Colour, Colour],
) -> np.ndarray:
    """Return the colours (Q, 3) in which patches are seen.

    Args:
        patches: Corners (Q, K, 3) [m].
        normal: Of any length (Q, 3), on the side of the first colour.
        tone: Brightness of their own (Q,), 1 for plain.
        eye: From where they are seen (3,) [m].
        light: Unit vector towards the lamp (3,).
        sides: Colours of the two sides.
    """
    unit = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    front = np.einsum("ij,ij->i", unit, eye - patches.mean(axis=1)) > 0.0
    facing = np.where(front, 1.0, -1.0) * (unit @ light)
    # Half Lambert: the side turned away is still modelled and not one flat dark spot.
    brightness = _AMBIENT + (_BRIGHTEST - _AMBIENT) * (0.5 + 0.5 * facing)
    base = np.where(front[:, None], np.array(sides[0], float), np.array(sides[1], float))
    return np.clip(base * (brightness * tone)[:, None], 0.0, 255.0)


def _pattern(rows: int, columns: int, pieces: int) -> np.ndarray:
    """Return the tone (rows * columns,) of each patch: crossing stripes within a darker hem."""
    row, column = np.indices((rows, columns))
    stripes = (row // pieces) % 2 + (column // pieces) % 2
    hem = (row == 0) | (row == rows - 1) | (column == 0) | (column == columns - 1)
    return (1.0 - _STRIPE * stripes - _HEM * hem).ravel()

"""Cloth as a mesh: a smooth surface through its particles, chequered and lit on both sides."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from pbd_gym.rendering.curves import smooth_sheet

_AMBIENT = 0.40  # light that a patch turned away from the lamp still receives
_BRIGHTEST = 1.18  # light that a patch facing the lamp receives
_STRIPE = 0.07  # how much darker each crossing stripe of the check is
_HEM = 0.16  # how much darker the outermost patches are


class Mesh(NamedTuple):
    """Patches of a cloth: corners (Q, 4, 3) [m] and their colours (Q, 4, 3) in [0, 255]."""

    patches: np.ndarray
    colours: np.ndarray


def weave(
    points: np.ndarray,
    pieces: int,
    eye: np.ndarray,
    light: np.ndarray,
    sides: tuple[np.ndarray, np.ndarray],
    holes: Sequence[tuple[int, int]] = (),
) -> Mesh:
    """Return the visible patches of a cloth, as the eye sees them lit.

    Args:
        points: Particles (rows, columns, 3) [m]; patches at one that is not finite are left out.
        pieces: Into how many patches each side between two particles is divided.
        eye: From where it is seen (3,) [m].
        light: Unit vector towards the lamp (3,).
        sides: Colours of the side on which rows, columns and normal are right-handed, and of the
            other: (3,), or (rows, columns, 3) for one at each particle.
        holes: Row and column of cells that are left out; then nothing is smoothed, as a curve
            would pull the two sides of a cut together.
    """
    surface = points if len(holes) else smooth_sheet(points, pieces)
    pieces = 1 if surface is points else pieces
    normal = np.cross(np.gradient(surface, axis=1), np.gradient(surface, axis=0))
    patches = quads(surface)
    tone = _pattern(surface.shape[0] - 1, surface.shape[1] - 1, pieces)
    seen = np.asarray(np.isfinite(patches).all(axis=(1, 2)))
    for row, column in holes:
        seen[row * (surface.shape[1] - 1) + column] = False
    paints = []
    for side in sides:
        fine = side if side.ndim == 1 else quads(_between(side, pieces))[seen]
        paints.append(fine * tone[seen, None, None])
    patches = patches[seen]
    facets = np.cross(patches[:, 2] - patches[:, 0], patches[:, 3] - patches[:, 1])
    smooth = quads(normal)[seen]
    bent = np.isfinite(smooth)  # next to what is left out there is no slope
    smooth = np.where(bent, smooth, facets[:, None])
    return Mesh(patches, shade(patches, smooth, eye, light, (paints[0], paints[1])))


def shade(
    patches: np.ndarray,
    normals: np.ndarray,
    eye: np.ndarray,
    light: np.ndarray,
    sides: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """Return the colours (Q, K, 3) in which the corners of patches are seen.

    Args:
        patches: Corners (Q, K, 3) [m].
        normals: At the corners, of any length (Q, K, 3), on the side of the first colour.
        eye: From where they are seen (3,) [m].
        light: Unit vector towards the lamp (3,).
        sides: Colours of the two sides, that broadcast to (Q, K, 3).
    """
    unit = normals / np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-12)
    facet = np.cross(patches[:, 1] - patches[:, 0], patches[:, 2] - patches[:, 0])
    facet += np.cross(patches[:, 2] - patches[:, 0], patches[:, -1] - patches[:, 0])
    front = np.einsum("ij,ij->i", facet, eye - patches[:, 0]) > 0.0
    facing = np.where(front, 1.0, -1.0)[:, None] * (unit @ light)
    # Half Lambert: the side turned away is still modelled and not one flat dark spot.
    brightness = _AMBIENT + (_BRIGHTEST - _AMBIENT) * (0.5 + 0.5 * facing)
    base = np.where(front[:, None, None], *sides)
    return np.clip(base * brightness[:, :, None], 0.0, 255.0)


def quads(surface: np.ndarray) -> np.ndarray:
    """Return the cells (Q, 4, k) of a grid of points (rows, columns, k), once around each."""
    corners = [surface[:-1, :-1], surface[:-1, 1:], surface[1:, 1:], surface[1:, :-1]]
    return np.stack(corners, axis=2).reshape(-1, 4, surface.shape[2])


def _between(values: np.ndarray, pieces: int) -> np.ndarray:
    """Return values (rows, columns, k) blended linearly over all corners of the patches."""
    for axis in (0, 1):
        count = values.shape[axis]
        place = np.arange((count - 1) * pieces + 1) / pieces
        low = np.minimum(place.astype(int), count - 2)
        share = np.expand_dims(place - low, (1 - axis, 2))
        lower, upper = np.take(values, low, axis), np.take(values, low + 1, axis)
        values = lower + share * (upper - lower)
    return values


@lru_cache(maxsize=16)
def _pattern(rows: int, columns: int, pieces: int) -> np.ndarray:
    """Return the tone (rows * columns,) of each patch: crossing stripes within a darker hem."""
    row, column = np.indices((rows, columns))
    stripes = (row // pieces) % 2 + (column // pieces) % 2
    hem = (row == 0) | (row == rows - 1) | (column == 0) | (column == columns - 1)
    return (1.0 - _STRIPE * stripes - _HEM * hem).ravel()

"""Smooth curves through particles, so that few particles still look like one rope or cloth."""

from __future__ import annotations

from functools import lru_cache

import numpy as np


@lru_cache(maxsize=64)
def spline(count: int, pieces: int) -> np.ndarray:
    """Return the matrix of a Catmull-Rom spline, which passes through every point it is given.

    Args:
        count: Points given, two or more.
        pieces: Into how many each span between two of them is divided.

    Returns:
        ((count - 1) * pieces + 1, count), read-only. Times the points it gives the points of the
        curve. Beyond the ends it continues straight.
    """
    padded = np.zeros((count + 2, count))
    padded[1:-1] = np.eye(count)
    padded[0] = 2.0 * padded[1] - padded[2]
    padded[-1] = 2.0 * padded[-2] - padded[-3]
    matrix = np.zeros(((count - 1) * pieces + 1, count))
    for row in range(len(matrix)):
        span = min(row // pieces, count - 2)
        t = row / pieces - span
        weights = (
            -0.5 * t + t**2 - 0.5 * t**3,
            1.0 - 2.5 * t**2 + 1.5 * t**3,
            0.5 * t + 2.0 * t**2 - 1.5 * t**3,
            -0.5 * t**2 + 0.5 * t**3,
        )
        matrix[row] = sum(w * padded[span + k] for k, w in enumerate(weights))
    matrix.flags.writeable = False
    return matrix


def smooth_line(points: np.ndarray, pieces: int) -> np.ndarray:
    """Return the curve ((M - 1) * pieces + 1, dim) through points (M, dim)."""
    return points if len(points) < 3 else spline(len(points), pieces) @ points


def smooth_loop(points: np.ndarray, pieces: int) -> np.ndarray:
    """Return the closed curve (M * pieces, dim) through points (M, dim), once around."""
    around = np.concatenate([points[-2:], points, points[:2]])
    return smooth_line(around, pieces)[2 * pieces : (2 + len(points)) * pieces]


def smooth_sheet(points: np.ndarray, pieces: int) -> np.ndarray:
    """Return the surface through points (rows, columns, dim); as given where one is not finite."""
    if not np.isfinite(points).all():
        return points
    along_rows = np.einsum("ij,jkd->ikd", spline(points.shape[0], pieces), points)
    return np.einsum("ij,kjd->kid", spline(points.shape[1], pieces), along_rows)


def finite_rows(points: np.ndarray) -> np.ndarray:
    """Return which of points (M, dim) have only finite coordinates, (M,)."""
    return np.asarray(np.isfinite(points).all(axis=1))


def finite_spans(points: np.ndarray) -> list[slice]:
    """Return the stretches of points (M, dim), in order, in which all are finite."""
    finite = np.concatenate([[False], finite_rows(points), [False]])
    edges = np.flatnonzero(finite[1:] != finite[:-1]).reshape(-1, 2)
    return [slice(start, end) for start, end in edges.tolist()]

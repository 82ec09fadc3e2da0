"""Moving frames: where the pins of a rigid handle go when it moves and turns."""

from __future__ import annotations

from typing import Any

import numpy as np

from pbd_gym.physics import portable


def frame_targets(points: Any, position: Any, rotation: Any) -> np.ndarray:
    """Return where the points of a rigid frame are: targets for the pins that it carries.

    The pins follow these targets in straight lines at constant speed, so that what hangs on them
    feels the frame's velocity and no jump. Only between the ends of a control step do the chords
    shorten the frame, by phi^2/8 of its size for a turn of phi: by 0.13 % for 0.1 rad.

    Args:
        points: Where the frame carries its pins, in its own coordinates, (P, dim) [m].
        position: Of the frame's origin, (..., dim) [m].
        rotation: 2D: angle (...) [rad]. 3D: unit quaternion (..., 4), its real part first; its
            length has no effect.

    Returns:
        Targets (..., P, dim) [m].

    Raises:
        ValueError: If a shape does not fit, or a number is not finite, or a quaternion is 0.
    """
    carried = np.asarray(points, dtype=np.float64)
    origin = np.asarray(position, dtype=np.float64)
    turn = np.asarray(rotation, dtype=np.float64)
    if carried.ndim != 2 or carried.shape[1] not in (2, 3):
        raise ValueError(f"points have shape {carried.shape}; expected (P, 2) or (P, 3)")
    dim = carried.shape[1]
    if not origin.ndim or origin.shape[-1] != dim:
        raise ValueError(f"position has shape {origin.shape}; expected (..., {dim})")
    if dim == 3 and (not turn.ndim or turn.shape[-1] != 4):
        raise ValueError(f"rotation has shape {turn.shape}; expected a quaternion (..., 4)")
    for name, values in (("points", carried), ("position", origin), ("rotation", turn)):
        if not np.isfinite(values).all():
            raise ValueError(f"{name} is {values}; its numbers must be finite")
    matrix = _planar(turn) if dim == 2 else _spatial(turn)
    return origin[..., None, :] + np.sum(carried[:, None, :] * matrix[..., None, :, :], axis=-1)


def _planar(angle: np.ndarray) -> np.ndarray:
    """Return rotation matrices (..., 2, 2)."""
    cosine, sine = portable.cos_sin(angle - 2.0 * np.pi * np.rint(angle / (2.0 * np.pi)))
    return _matrix([[cosine, -sine], [sine, cosine]])


def _spatial(quaternion: np.ndarray) -> np.ndarray:
    """Return rotation matrices (..., 3, 3)."""
    square = np.sum(quaternion**2, axis=-1)
    if not np.all(square > 0.0):
        raise ValueError(f"rotation is {quaternion}; a quaternion may not be 0")
    w, x, y, z = np.moveaxis(quaternion / np.sqrt(square)[..., None], -1, 0)
    return _matrix(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def _matrix(rows: list[list[np.ndarray]]) -> np.ndarray:
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)

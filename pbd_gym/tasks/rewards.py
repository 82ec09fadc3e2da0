"""Shapes of rewards: 1 where all is well, falling off smoothly."""

from __future__ import annotations

from typing import Any

import numpy as np

from pbd_gym.physics.portable import exp

# ln(10): dm_control's Gaussian has fallen to 0.1 at its margin.
_LN_10 = 2.302585092994046


def near(error: Any, margin: float) -> np.ndarray:
    """Return dm_control's tolerance around 0: 1 at error 0, 0.1 at the margin (a Gaussian)."""
    scaled = np.asarray(error, dtype=np.float64) / margin
    return exp(-_LN_10 * scaled * scaled)


def quiet(action: Any) -> np.ndarray:
    """Return dm_control's quadratic tolerance of an action: 1 at 0, 0 at -1 and 1."""
    value = np.asarray(action, dtype=np.float64)
    return np.maximum(1.0 - value * value, 0.0)


def closeness(distance: Any, scale: float) -> np.ndarray:
    """Return exp(-distance/scale): 1 on the spot."""
    return exp(-np.asarray(distance, dtype=np.float64) / scale)

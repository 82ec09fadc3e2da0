"""Shapes of rewards: 1 where all is well, falling off smoothly. Numbers, for use within kernels."""

from __future__ import annotations

from typing import Any

from pbd_gym.physics.compiling import kernel
from pbd_gym.physics.portable import exp_scalar

# ln(10): dm_control's Gaussian has fallen to 0.1 at its margin.
_LN_10 = 2.302585092994046


@kernel
def near(error: float, margin: float) -> float:
    """Return dm_control's tolerance around 0: 1 at error 0, 0.1 at the margin (a Gaussian)."""
    scaled = error / margin
    return exp_scalar(-_LN_10 * scaled * scaled)


@kernel
def near_each(errors: Any, margin: float) -> None:
    """Replace errors (n,) by their tolerance, see `near`. A loop of its own is vector code."""
    for index in range(errors.shape[0]):
        errors[index] = near(errors[index], margin)


@kernel
def quiet(action: float) -> float:
    """Return dm_control's quadratic tolerance of an action: 1 at 0, 0 at -1 and 1."""
    return max(1.0 - action * action, 0.0)


@kernel
def closeness(distance: float, scale: float) -> float:
    """Return exp(-distance/scale): 1 on the spot."""
    return exp_scalar(-distance / scale)

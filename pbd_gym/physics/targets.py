"""Where pins and grabbed particles are sent: what a step may be given."""

from __future__ import annotations

from typing import Any

import numpy as np

from pbd_gym.physics.compiling import entry


def check_targets(targets: np.ndarray, pins: np.ndarray, grabbed: np.ndarray) -> None:
    """Refuse targets that are not finite; those of particles that are not grabbed are not read.

    Args:
        targets: (W, P + G, dim) [m].
        pins: (P,) particles.
        grabbed: (W, G) bool.

    Raises:
        ValueError: Naming the first that is wrong.
    """
    found = _first_not_finite(targets, len(pins), grabbed)
    if found < 0:
        return
    world, index = divmod(found, targets.shape[1])
    what = f"pin {index}" if index < len(pins) else f"grabbable particle {index - len(pins)}"
    raise ValueError(f"target of {what} in world {world} is {targets[world, index]}")


@entry
def _first_not_finite(targets: Any, num_pins: int, grabbed: Any) -> int:
    """Return world * (P + G) + index of the first target that is needed and not finite, or -1."""
    for world in range(targets.shape[0]):
        for index in range(targets.shape[1]):
            if index < num_pins or grabbed[world, index - num_pins]:
                for k in range(targets.shape[2]):
                    if not abs(targets[world, index, k]) < np.inf:  # not so for NaN either
                        return world * targets.shape[1] + index
    return -1

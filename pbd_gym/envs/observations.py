"""Observations of n worlds: one array (n, ...), or a dict of them where goals are apart."""

from __future__ import annotations

from typing import Any

import numpy as np


def world_of(observations: Any, world: int) -> Any:
    """Return a copy of what one world observes."""
    if isinstance(observations, dict):
        return {name: world_of(part, world) for name, part in observations.items()}
    return observations[world].copy()


def replace(observations: Any, worlds: np.ndarray, fresh: Any) -> None:
    """Write what the k `worlds` observe anew, (k, ...), into observations (n, ...)."""
    if isinstance(observations, dict):
        for name, part in observations.items():
            replace(part, worlds, fresh[name])
    else:
        observations[worlds] = fresh

"""What `get_state` returns and `set_state` takes, of one world or n."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pbd_gym.physics import Snapshot


@dataclass(frozen=True)
class EpisodeState:
    """All that the continuation of n episodes depends on; made by `get_state`.

    Attributes:
        worlds: Positions and velocities.
        variables: What the task remembers of each episode, (W, ...) arrays by name.
        generators: State of each world's random generator.
        elapsed: Steps since each episode began, (W,).
        ended: Which episodes have ended and were not begun anew, (W,).
        begun: Which worlds were reset at least once, (W,).
    """

    worlds: Snapshot
    variables: dict[str, np.ndarray]
    generators: list[Mapping[str, Any]]
    elapsed: np.ndarray
    ended: np.ndarray
    begun: np.ndarray


def check_state(state: Any, num_worlds: int) -> None:
    """Refuse what is no state, or one of another number of worlds."""
    if not isinstance(state, EpisodeState):
        raise TypeError(f"the state is {state!r}; expected an EpisodeState of get_state()")
    for name in ("generators", "elapsed", "ended", "begun"):
        count = len(getattr(state, name))
        if count != num_worlds:
            raise ValueError(f"the state holds {name} of {count} worlds; expected {num_worlds}")

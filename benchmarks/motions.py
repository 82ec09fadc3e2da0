"""What is compared with peers: something that is stepped, whoever steps it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from driven_tasks import FRAMES


class Motion(NamedTuple):
    """A scene that was set up.

    Attributes:
        step: Takes the k-th control step in all worlds and reads what a policy would need.
        places: Returns where the particles of the first world are, (N, dim) [m]; None where no
            shape is to be compared.
    """

    step: Callable[[int], Any]
    places: Callable[[], np.ndarray] | None = None


@dataclass(frozen=True)
class Contender:
    """One way to step one scene.

    Attributes:
        engine: Its name.
        setting: What was chosen, in words.
        worlds: That are stepped together.
        threads: On which.
        prepare: Sets up so many worlds.
    """

    engine: str
    setting: str
    worlds: int
    threads: int
    prepare: Callable[[int], Motion]


def frame(k: int) -> int:
    """Return the place of control step k in a path of `FRAMES`: its last second repeats."""
    return k if k < FRAMES else FRAMES - 60 + (k - FRAMES) % 60

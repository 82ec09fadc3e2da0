"""How long a fresh process takes to its first step, with and without compiled kernels on disk.

python benchmarks/start_up.py pbd_gym:PBDRope-v0 64
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from typing import NamedTuple

_FIRST_STEP = """
import sys
import gymnasium
import pbd_gym
id, worlds = sys.argv[1], int(sys.argv[2])
if worlds == 1:
    env = gymnasium.make(id)
else:
    env = gymnasium.make_vec(id, num_envs=worlds, vectorization_mode="vector_entry_point")
env.reset(seed=0)
env.step(env.action_space.sample())
"""


class StartUp(NamedTuple):
    """Seconds from the start of the interpreter to the end of the first step.

    Attributes:
        cold: With an empty cache: the kernels are compiled.
        warm: With the kernels on disk.
    """

    cold: float
    warm: float


def measure_start_up(id: str, worlds: int, repeats: int = 3) -> StartUp:
    """Time fresh processes on a cache of their own; warm is the median of `repeats`.

    Args:
        id: Of the environment.
        worlds: 1 for `gymnasium.make`, more for `make_vec`.
        repeats: Processes with a warm cache.

    Raises:
        subprocess.CalledProcessError: If the environment cannot be made or stepped.
    """
    with tempfile.TemporaryDirectory() as cache:
        cold, *warm = (_time_process(id, worlds, cache) for _ in range(1 + repeats))
    return StartUp(cold, sorted(warm)[repeats // 2])


def _time_process(id: str, worlds: int, cache: str) -> float:
    begin = time.perf_counter()
    subprocess.run(
        [sys.executable, "-c", _FIRST_STEP, id, str(worlds)],
        env=os.environ | {"NUMBA_CACHE_DIR": cache},
        stderr=subprocess.PIPE,
        check=True,
    )
    return time.perf_counter() - begin


if __name__ == "__main__":
    start_up = measure_start_up(sys.argv[1], int(sys.argv[2]))
    print(f"cold {start_up.cold:.1f} s, warm {start_up.warm:.2f} s")

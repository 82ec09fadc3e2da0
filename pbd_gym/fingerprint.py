"""Hashes of fixed trajectories: whether two machines compute the same bits.

`python -m pbd_gym.fingerprint` prints them for every environment, beside those of this version. The
same seed and actions have to give the same bits on every processor, with any number of worlds and
threads. A hash that changes from one version of this package to the next means that an environment
has changed: then the version in its id goes up.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import platform
import sys
from collections.abc import Sequence
from importlib.metadata import version
from typing import Any

import gymnasium
import llvmlite.binding as llvm
import numpy as np

from pbd_gym.physics import World

# By id: of the environment, and of its model alone in float32 and float64, of the first world.
# A change of any of these is a change of that environment's version.
RELEASED: dict[str, dict[str, str]] = {
    "PBDPendulum-v0": {
        "environment": "1bc87529ce58241b",
        "float32": "bfbbcf4ceb0f3724",
        "float64": "23d899970d8c1668",
    },
    "PBDDoublePendulum-v0": {
        "environment": "134b0508d08c45f3",
        "float32": "6fbed5c800fdc465",
        "float64": "a20ffb3630b2f0b6",
    },
    "PBDTriplePendulum-v0": {
        "environment": "420c539ac2ec1ffc",
        "float32": "5ea4148c7e8d08ca",
        "float64": "3997049e0ac2de45",
    },
    "PBDRope-v0": {
        "environment": "80d647a3aead9394",
        "float32": "0fc9b67ff9491e00",
        "float64": "b429ed8abd8fcede",
    },
    "PBDCloth-v0": {
        "environment": "759dc3a2a9eac23a",
        "float32": "9acb507bf49581b1",
        "float64": "0f5d67acc579abe4",
    },
    "PBDRopeGoal-v0": {
        "environment": "80fcc45f846b6938",
        "float32": "0fc9b67ff9491e00",
        "float64": "b429ed8abd8fcede",
    },
    "PBDClothGoal-v0": {
        "environment": "aaccc272a3416697",
        "float32": "9acb507bf49581b1",
        "float64": "0f5d67acc579abe4",
    },
}
KINDS = ("environment", "float32", "float64")

_SEED = 7
_STEPS = 30
_DIGITS = 16


def hash_environment(id: str, num_worlds: int = 1, num_threads: int | None = None) -> list[str]:
    """Hash observations and rewards of each world: fixed seed, random actions fixed by world.

    Args:
        id: Of a registered environment.
        num_worlds: That are stepped in one batch.
        num_threads: As for `gymnasium.make_vec`.
    """
    env = gymnasium.make_vec(
        id, num_worlds, vectorization_mode="vector_entry_point", num_threads=num_threads
    )
    actions = _by_world(num_worlds, (_STEPS, *(env.single_action_space.shape or ())))
    seen = [_numbers(env.reset(seed=_SEED)[0])]
    earned = []
    for step in range(_STEPS):
        observation, reward, *_ = env.step(actions[:, step].astype(np.float32))
        seen.append(_numbers(observation))
        earned.append(reward)
    env.close()
    return _hashes(np.stack(seen, axis=1), np.stack(earned, axis=1))


def hash_physics(
    id: str, dtype: Any, num_worlds: int = 1, num_threads: int | None = None
) -> list[str]:
    """Hash positions and velocities of an environment's model alone, for each world.

    The particles begin with random velocities, and the pins wander, fixed by world.
    """
    task = gymnasium.make(id).get_wrapper_attr("task")
    model, count = task.model, task.model.num_particles
    world = World(model, num_worlds, dtype=dtype, num_threads=num_threads)
    numbers = _by_world(num_worlds, (count + _STEPS, model.dim))
    free = model.inverse_mass > 0
    world.v[:, free] = 0.5 * numbers[:, :count][:, free]
    targets = np.repeat(model.positions[None, model.pins], num_worlds, axis=0)
    states = []
    for step in range(_STEPS):
        targets = targets + 0.01 * numbers[:, None, count + step]
        world.step(1.0 / task.control_rate, task.substeps, targets)
        states.append(np.concatenate([world.x, world.v], axis=1))
    return _hashes(np.stack(states, axis=1))


def _by_world(num_worlds: int, shape: tuple[int, ...]) -> np.ndarray:
    """Return numbers in [-1, 1] for each world, the same in any number of worlds."""
    generators = (np.random.default_rng([_SEED, world]) for world in range(num_worlds))
    return np.stack([random.uniform(-1.0, 1.0, shape) for random in generators])


def _numbers(observation: Any) -> np.ndarray:
    """Return all numbers of observations (worlds, size), also of those in parts."""
    parts = observation.values() if isinstance(observation, dict) else [observation]
    return np.concatenate(list(parts), axis=-1)


def _hashes(*arrays: np.ndarray) -> list[str]:
    """Hash arrays (worlds, ...) world by world."""
    worlds = zip(*arrays, strict=True)
    joined = (b"".join(array.tobytes() for array in world) for world in worlds)
    return [hashlib.sha256(data).hexdigest()[:_DIGITS] for data in joined]


def fingerprint(id: str, kind: str) -> str:
    """Return the hash of one world; kind is one of `KINDS`."""
    if kind not in KINDS:
        raise ValueError(f"kind is {kind!r}; allowed: {', '.join(KINDS)}")
    return (hash_environment(id) if kind == "environment" else hash_physics(id, kind))[0]


def _machine() -> str:
    """Return in one line what computes."""
    packages = ", ".join(f"{name} {version(name)}" for name in ("numpy", "numba", "gymnasium"))
    target = os.environ.get("NUMBA_CPU_NAME") or llvm.get_host_cpu_name()
    return (
        f"{platform.machine()}, compiled for {target}, {platform.system()}, "
        f"Python {platform.python_version()}, {packages}"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the hashes; return 1 if one is not that of this version."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ids", nargs="+", choices=RELEASED, default=list(RELEASED), metavar="ID")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    options = parser.parse_args(arguments)
    print(_machine())
    differs = False
    for id in options.ids:
        for kind in options.kinds:
            own, released = fingerprint(f"pbd_gym:{id}", kind), RELEASED[id][kind]
            differs |= own != released
            verdict = "same" if own == released else f"differs: {released} in this version"
            print(f"{id:24} {kind:12} {own}  {verdict}", flush=True)
    return int(differs)


if __name__ == "__main__":
    sys.exit(main())

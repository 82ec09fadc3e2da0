"""Frames per second of stable-baselines3's PPO on our batch, beside its own vector environments.

In one run, in turn: our batch through `pbd_gym.sb3`, the same task 256 times in a `DummyVecEnv`
and in a `SubprocVecEnv` (one forked process each), and worlds that do nothing, which leave what
the learner itself costs. A turn is one rollout with its update, by the shipped hyperparameters.
"""

from __future__ import annotations

import argparse
import functools
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecEnv
from tqdm import tqdm

from pbd_gym.hyperparams import algorithm_arguments, load_hyperparameters
from pbd_gym.sb3 import make_sb3_vec_env
from records import RESULTS, in_turn, table, write

_IDS = ("PBDPendulum-v0", "PBDRope-v0", "PBDCloth-v0")


class Row(NamedTuple):
    """Of one environment: frames per second with and without the updates."""

    id: str
    worlds: str
    count: int
    training: float
    collecting: float


class Nothing(VecEnv):
    """Worlds that never move nor end."""

    def __init__(self, like: VecEnv) -> None:
        super().__init__(like.num_envs, like.observation_space, like.action_space)
        self._observation = np.zeros_like(like.reset())
        self._reward = np.zeros(self.num_envs, dtype=np.float32)
        self._done = np.zeros(self.num_envs, dtype=bool)
        self._infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]

    def reset(self) -> Any:
        """Return the observation."""
        return self._observation

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions."""

    def step_wait(self) -> Any:
        """Return what is always the same."""
        return self._observation, self._reward, self._done, self._infos

    def close(self) -> None:
        """Leave nothing behind."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of the worlds, all alike."""
        return [None] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refuse: there is nothing to set."""
        raise AttributeError(attr_name)

    def env_method(self, method_name: str, *_: Any, **__: Any) -> list[Any]:
        """Refuse: there is nothing to call."""
        raise AttributeError(method_name)

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Say that no world is wrapped."""
        return [False] * self.num_envs


def environments(id: str, count: int, keywords: dict[str, Any]) -> dict[str, VecEnv]:
    """Make the same task in every way, and nothing in its shape."""
    one = functools.partial(gymnasium.make, f"pbd_gym:{id}", **keywords)
    one().reset()  # the kernels of one world are compiled before processes are forked
    batch = make_sb3_vec_env(f"pbd_gym:{id}", count, stagger=True, **keywords)
    return {
        "pbd_gym.sb3": batch,
        "nothing": Nothing(batch),
        "DummyVecEnv": DummyVecEnv([one] * count),
        "SubprocVecEnv": SubprocVecEnv([one] * count, start_method="fork"),
    }


def measure(id: str, count: int, rounds: int) -> list[Row]:
    """Train in every environment in turn."""
    settings = load_hyperparameters("ppo", id)
    keywords = settings.get("env_kwargs", {})
    arguments = algorithm_arguments("ppo", settings)
    envs = environments(id, count, keywords)
    models = {name: PPO(env=env, device="cpu", seed=0, **arguments) for name, env in envs.items()}
    frames = count * arguments["n_steps"]
    calls: dict[tuple[str, str], Callable[[int], Any]] = {}
    for name, model in models.items():
        learn = functools.partial(model.learn, frames, reset_num_timesteps=False)
        calls[name, "training"] = lambda _, learn=learn: learn()
        collect = functools.partial(_collect, model, arguments["n_steps"])
        calls[name, "collecting"] = lambda _, collect=collect: collect()
    spreads = in_turn(calls, rounds, 0.0)
    for env in envs.values():
        env.close()
    return [
        Row(
            id,
            name,
            count,
            frames / spreads[name, "training"].median,
            frames / spreads[name, "collecting"].median,
        )
        for name in envs
    ]


def _collect(model: PPO, steps: int) -> None:
    """Collect one rollout without an update."""
    _, callback = model._setup_learn(steps, reset_num_timesteps=False)
    model.collect_rollouts(model.env, callback, model.rollout_buffer, steps)  # pyright: ignore[reportArgumentType]


def report(rows: Sequence[Row]) -> str:
    """Return the frames per second, and how many times the others' ours are, as markdown."""
    lines = []
    for row in rows:
        own = next(x for x in rows if (x.id, x.worlds) == (row.id, "pbd_gym.sb3"))
        lines.append([
            row.id, row.worlds, f"{row.collecting:,.0f}", f"{own.collecting / row.collecting:.2f}",
            f"{row.training:,.0f}", f"{own.training / row.training:.2f}",
        ])  # fmt: skip
    head = ["id", "worlds", "collecting [1/s]", "ours to it", "training [1/s]", "ours to it"]
    return (
        f"Frames per second of PPO with {rows[0].count} worlds and the shipped hyperparameters, "
        "median over the rounds, while it collects a rollout and with the update:\n\n"
        + table(head, lines)
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure; write CSV and table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ids", nargs="+", default=_IDS, help="environments")
    parser.add_argument("--worlds", type=int, default=256, help="(default: 256)")
    parser.add_argument("--rounds", type=int, default=5, help="(default: 5)")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder of the results")
    options = parser.parse_args(arguments)
    torch.set_num_threads(1)
    rows = [
        row
        for id in tqdm(options.ids, desc="training", unit="task")
        for row in measure(id, options.worlds, options.rounds)
    ]
    write(options.out, "sb3_frames", rows, report(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Policies by name: functions from observations of W worlds to actions (W, action)."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv

from pbd_gym.hyperparams import ALGORITHMS, algorithm_class
from pbd_gym.planning import Planner, planner_settings

Policy = Callable[[Any], np.ndarray]

# A HerReplayBuffer could not be made without worlds, and a model that only acts needs none.
NO_HINDSIGHT = {"replay_buffer_class": None, "replay_buffer_kwargs": {}}

BASELINES = ("noop", "random", "scripted", "planner")


def make_policy(name: str, env: VectorEnv, *, seed: int = 0) -> Policy:
    """Make the policy for a batch of worlds.

    Args:
        name: "noop" (no motion), "random" (uniform actions), "scripted" (the task's own
            baseline), "planner" (search on snapshots of the worlds), or the path of a model that
            stable-baselines3 has saved. Loading a model unpickles, so load only your own.
        env: The native batch to act in.
        seed: Of the random policy and of the planner.
    """
    if name == "noop":
        actions = np.zeros(env.action_space.shape or (), dtype=np.float32)
        return lambda observation: actions
    if name == "random":
        env.action_space.seed(seed)
        return lambda observation: env.action_space.sample()
    if name == "scripted":
        return env.unwrapped.task.scripted  # type: ignore[attr-defined]
    if name == "planner":
        return PlannedPolicy(env, seed)
    return _load_model(Path(name), env)


class PlannedPolicy:
    """Plans from the true state of the worlds, whatever is observed, and plays some of each plan.

    Args:
        env: The native batch with autoreset in the same step.
        seed: Of the planner, anew whenever all episodes begin.
    """

    def __init__(self, env: VectorEnv, seed: int) -> None:
        self._env: Any = env.unwrapped
        self._seed = seed
        settings = planner_settings(env.spec.id if env.spec else "")
        self._planner = Planner(self._env.task, settings, num_worlds=env.num_envs, seed=seed)

    def __call__(self, observation: Any) -> np.ndarray:
        """Return the next actions (W, action) of the plan."""
        state = self._env.get_state()
        begun = state.elapsed == 0
        if begun.any():
            self._planner.reset(self._seed) if begun.all() else self._planner.forget(begun)
        return self._planner.act(state)


def _load_model(path: Path, env: VectorEnv) -> Policy:
    if not path.is_file():
        raise FileNotFoundError(f"policy must be {', '.join(BASELINES)} or a file, got {path}")
    model = algorithm_class(_saved_algorithm(path)).load(
        path, device="cpu", custom_objects=NO_HINDSIGHT
    )
    for kind in ("observation", "action"):
        ours = _shape(getattr(env, f"single_{kind}_space"))
        theirs = _shape(getattr(model, f"{kind}_space"))
        if ours != theirs:
            raise ValueError(
                f"{path} was trained on {kind}s of shape {theirs}, "
                f"but this environment has {ours}; are --env and --env-kwargs the same?"
            )
    return lambda observation: model.predict(observation, deterministic=True)[0]


def _shape(space: spaces.Space) -> Any:
    """Return the shape of a box, or those of a dict's boxes by name."""
    if isinstance(space, spaces.Dict):
        return {name: part.shape for name, part in space.items()}
    return space.shape


def _saved_algorithm(path: Path) -> str:
    """Tell the algorithm by the policy class named in the file, without unpickling anything."""
    try:
        with zipfile.ZipFile(path) as archive:
            module = json.loads(archive.read("data"))["policy_class"]["__module__"]
    except (zipfile.BadZipFile, KeyError, ValueError) as error:
        raise ValueError(f"{path} is no model saved by stable-baselines3") from error
    return next((name for name in ALGORITHMS if f".{name}." in module), "ppo")

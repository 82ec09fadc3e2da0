"""Policies by name: functions from observations (W, observation) to actions (W, action)."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from gymnasium.vector import VectorEnv

from pbd_gym.hyperparams import algorithm_class

Policy = Callable[[np.ndarray], np.ndarray]

BASELINES = ("noop", "random", "scripted")


def make_policy(name: str, env: VectorEnv, *, seed: int = 0) -> Policy:
    """Make the policy for a batch of worlds.

    Args:
        name: "noop" (no motion), "random" (uniform actions), "scripted" (the task's own
            baseline), or the path of a model that stable-baselines3 has saved. Loading a model
            unpickles, so load only your own.
        env: The native batch to act in.
        seed: Of the random policy.
    """
    if name == "noop":
        actions = np.zeros(env.action_space.shape or (), dtype=np.float32)
        return lambda observation: actions
    if name == "random":
        env.action_space.seed(seed)
        return lambda observation: env.action_space.sample()
    if name == "scripted":
        return env.unwrapped.task.scripted  # type: ignore[attr-defined]
    return _load_model(Path(name), env)


def _load_model(path: Path, env: VectorEnv) -> Policy:
    if not path.is_file():
        raise FileNotFoundError(f"policy must be {', '.join(BASELINES)} or a file, got {path}")
    model = algorithm_class(_saved_algorithm(path)).load(path, device="cpu")
    for kind in ("observation", "action"):
        ours = getattr(env, f"single_{kind}_space")
        theirs = getattr(model, f"{kind}_space")
        if ours.shape != theirs.shape:
            raise ValueError(
                f"{path} was trained on {kind}s of shape {theirs.shape}, "
                f"but this environment has {ours.shape}; are --env and --env-kwargs the same?"
            )
    return lambda observation: model.predict(observation, deterministic=True)[0]


def _saved_algorithm(path: Path) -> str:
    """Tell PPO from SAC by the policy class named in the file, without unpickling anything."""
    try:
        with zipfile.ZipFile(path) as archive:
            module = json.loads(archive.read("data"))["policy_class"]["__module__"]
    except (zipfile.BadZipFile, KeyError, ValueError) as error:
        raise ValueError(f"{path} is no model saved by stable-baselines3") from error
    return "sac" if ".sac." in module else "ppo"

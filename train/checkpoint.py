"""Exact checkpoints: all that the next update depends on, in one file that is replaced at once.

Taken between two updates, a checkpoint holds the model with its optimizers and counters, the
replay buffer, the state of all worlds, and the state of every random generator. Continuing from it
gives the same bits as never having stopped (on the CPU, with the same versions installed).

Checkpoints and models are pickles: loading one runs code from it, so load only your own.
"""

from __future__ import annotations

import io
import pickle
import random
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import HerReplayBuffer
from stable_baselines3.common.base_class import BaseAlgorithm

from files import write_atomically
from pbd_gym.hyperparams import algorithm_class
from pbd_gym.sb3 import SB3VecEnv

# The running episodes belong to the checkpoint; a model to act with can do without.
_EPISODE_ATTRIBUTES = (
    "_last_obs",
    "_last_original_obs",
    "_last_episode_starts",
    "ep_info_buffer",
    "ep_success_buffer",
)


def save_checkpoint(path: Path, model: BaseAlgorithm, **records: Any) -> None:
    """Write a checkpoint of the model, its worlds and `records`, any picklable values."""
    weights = io.BytesIO()
    model.save(weights)
    content = {
        "num_timesteps": model.num_timesteps,
        "model": weights.getvalue(),
        "replay_buffer": getattr(model, "replay_buffer", None),
        "worlds": _worlds(model).get_state(),
        "random": _random_state(model),
        **records,
    }
    with write_atomically(path) as file:
        pickle.dump(content, file, protocol=pickle.HIGHEST_PROTOCOL)


def load_checkpoint(path: Path) -> dict[str, Any]:
    """Read a checkpoint (unpickles: load only your own)."""
    with path.open("rb") as file:
        return pickle.load(file)


def restore_model(content: dict[str, Any], algo: str, env: SB3VecEnv, device: str) -> BaseAlgorithm:
    """Rebuild the model of a checkpoint on `env`, whose worlds go on where they were.

    The global random generators are set as well, so nothing may draw from them before `learn`.
    """
    model = algorithm_class(algo).load(
        io.BytesIO(content["model"]), env=env, device=device, force_reset=False
    )
    if content["replay_buffer"] is not None:
        model.replay_buffer = content["replay_buffer"]
        model.replay_buffer.device = model.device
        if isinstance(model.replay_buffer, HerReplayBuffer):
            model.replay_buffer.set_env(env)  # whose worlds compute rewards of replaced goals
    _worlds(model).set_state(content["worlds"])
    _set_random_state(model, content["random"])
    return model


def save_model(path: Path, model: BaseAlgorithm) -> None:
    """Write a model to act with or to look at, in stable-baselines3's own format."""
    with write_atomically(path) as file:
        model.save(file, exclude=_EPISODE_ATTRIBUTES)  # type: ignore[arg-type]


def _worlds(model: BaseAlgorithm) -> SB3VecEnv:
    env = model.get_env()
    if not isinstance(env, SB3VecEnv):
        raise TypeError(f"a checkpoint needs the native batch SB3VecEnv, got {type(env).__name__}")
    return env


def _random_state(model: BaseAlgorithm) -> dict[str, Any]:
    return {
        "python": random.getstate(),
        "numpy": np.random.get_state(),  # noqa: NPY002, stable-baselines3 draws from it
        "torch": torch.get_rng_state(),
        "cuda": torch.cuda.get_rng_state_all(),  # an empty list without a GPU
        "action_space": model.action_space.np_random.bit_generator.state,
    }


def _set_random_state(model: BaseAlgorithm, state: dict[str, Any]) -> None:
    random.setstate(state["python"])
    np.random.set_state(state["numpy"])  # noqa: NPY002
    torch.set_rng_state(state["torch"])
    torch.cuda.set_rng_state_all(state["cuda"])
    model.action_space.np_random.bit_generator.state = state["action_space"]

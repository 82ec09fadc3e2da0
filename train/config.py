"""What a training run depends on: checked before anything is created, stored in its folder."""

from __future__ import annotations

import dataclasses
import importlib
import platform
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

import gymnasium
import yaml

from files import write_atomically
from pbd_gym.hyperparams import SETUP, check_hyperparameters, load_hyperparameters

DEFAULT_ENV = "pbd_gym:PBDRope-v0"

# What a wrong setting may raise in building the worlds and the model.
SETTING_ERRORS = (
    ValueError,
    TypeError,
    AssertionError,
    OSError,
    ImportError,
    gymnasium.error.Error,
)


@dataclass(frozen=True)
class TrainingConfig:
    """Settings of one run. Frequencies are in environment steps, 0 switches them off."""

    total_timesteps: int
    num_envs: int
    eval_freq: int
    checkpoint_freq: int
    env: str = DEFAULT_ENV
    algo: str = "ppo"
    seed: int = 0
    eval_episodes: int = 100
    device: str = "cpu"
    threads: int = 1
    env_kwargs: dict[str, Any] = field(default_factory=dict)
    train_env_kwargs: dict[str, Any] = field(default_factory=dict)  # over them, where it learns
    hyperparameters: dict[str, Any] = field(default_factory=dict)  # of the algorithm alone

    def __post_init__(self) -> None:
        for name in ("total_timesteps", "num_envs", "eval_episodes", "threads"):
            check_at_least(name, getattr(self, name), 1)
        for name in ("seed", "eval_freq", "checkpoint_freq"):
            check_at_least(name, getattr(self, name), 0)
        check_registered(self.env)
        check_hyperparameters(self.algo, self.hyperparameters)

    @property
    def env_name(self) -> str:
        """The id without its module."""
        return self.env.split(":")[-1]


def new_config(given: dict[str, Any]) -> TrainingConfig:
    """Complete what the user gave with the hyperparameter file and the defaults.

    `hyperparameters`, `env_kwargs` and `train_env_kwargs` given by the user win over the file,
    entry by entry.
    """
    given = dict(given)
    hyperparameters = load_hyperparameters(
        given.get("algo", TrainingConfig.algo), given.get("env", TrainingConfig.env)
    )
    hyperparameters.update(given.pop("hyperparameters", {}))
    setup = {key: hyperparameters.pop(key) for key in SETUP if key in hyperparameters}
    total = given.pop("total_timesteps", setup["n_timesteps"])
    check_at_least("total_timesteps", total, 1)
    return TrainingConfig(
        total_timesteps=total,
        num_envs=given.pop("num_envs", setup["n_envs"]),
        eval_freq=given.pop("eval_freq", -(-total // 20)),
        checkpoint_freq=given.pop("checkpoint_freq", -(-total // 10)),
        env_kwargs=setup.get("env_kwargs", {}) | given.pop("env_kwargs", {}),
        train_env_kwargs=setup.get("train_env_kwargs", {}) | given.pop("train_env_kwargs", {}),
        hyperparameters=hyperparameters,
        **given,
    )


def save_config(path: Path, config: TrainingConfig) -> None:
    """Write the settings and the versions of what they ran with as YAML."""
    content = dataclasses.asdict(config) | {"versions": installed_versions()}
    with write_atomically(path) as file:
        file.write(yaml.safe_dump(content, sort_keys=False).encode())


def load_config(path: Path) -> tuple[TrainingConfig, dict[str, str]]:
    """Read back the settings and the versions of what they ran with."""
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    versions = content.pop("versions", {})
    return TrainingConfig(**content), versions


def installed_versions() -> dict[str, str]:
    """Return the versions of all that a training's numbers depend on."""
    names = ("pbd-gym", "gymnasium", "numba", "numpy", "stable-baselines3", "torch")
    return {"python": platform.python_version()} | {name: _version(name) for name in names}


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"


def check_at_least(name: str, value: Any, lowest: int) -> None:
    """Raise ValueError unless a setting is an integer of at least `lowest`."""
    if not isinstance(value, int) or value < lowest:
        raise ValueError(f"{name} must be an integer of at least {lowest}, got {value!r}")


def check_registered(env: str) -> None:
    """Raise an error unless an environment exists and has a native batch."""
    module, _, name = env.rpartition(":")
    importlib.import_module(module or "pbd_gym")
    if gymnasium.spec(name).vector_entry_point is None:
        raise ValueError(f"{env} has no native vector environment, which the training needs")

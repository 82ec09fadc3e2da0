"""Hyperparameters of stable-baselines3 per algorithm and environment, in the format of rl_zoo3.

One YAML file per algorithm maps environment ids to settings; `default` serves every other id. What
only the worlds that train are made with stands apart, under `train_env_kwargs`: rl_zoo3 would hand
an entry that it does not know to the algorithm.
"""

from __future__ import annotations

import ast
import inspect
from pathlib import Path
from typing import Any

ALGORITHMS = ("ppo", "sac", "crossq")

# Entries that set up the training; all others are arguments of the algorithm.
SETUP = frozenset({"n_timesteps", "n_envs", "env_kwargs", "train_env_kwargs"})

# Arguments of the algorithms that a settings file cannot give: the training sets them itself, or
# they take objects. State-dependent exploration (sde) is refused as its noise is in no checkpoint.
_REFUSED = frozenset(
    {
        "_init_setup_model",
        "action_noise",
        "device",
        "env",
        "rollout_buffer_class",
        "sde_sample_freq",
        "seed",
        "self",
        "stats_window_size",
        "tensorboard_log",
        "use_sde",
        "use_sde_at_warmup",
        "verbose",
    }
)


def load_hyperparameters(algo: str, env_id: str) -> dict[str, Any]:
    """Read the settings of one environment, as they stand in the file.

    Args:
        algo: One of `ALGORITHMS`.
        env_id: Environment id, with or without its module: "pbd_gym:PBDRope-v0".

    Returns:
        The settings under `env_id`, or those under `default` when it has none of its own, with its
        `train_env_kwargs` where there are some.
    """
    import yaml

    check_algorithm(algo)
    entries = yaml.safe_load((Path(__file__).parent / f"{algo}.yml").read_text(encoding="utf-8"))
    name = env_id.split(":")[-1]
    hyperparameters = dict(entries.get(name, entries["default"]))
    if name in entries.get("train_env_kwargs", {}):
        hyperparameters["train_env_kwargs"] = entries["train_env_kwargs"][name]
    return hyperparameters


def algorithm_class(algo: str) -> type[Any]:
    """Return the class of stable-baselines3 or sb3-contrib for an algorithm's name.

    Raises:
        ValueError: If `algo` is not one of `ALGORITHMS`.
        ImportError: If the package that has it is not installed.
    """
    check_algorithm(algo)
    if algo == "crossq":
        from sb3_contrib import CrossQ

        return CrossQ
    from stable_baselines3 import PPO, SAC

    return {"ppo": PPO, "sac": SAC}[algo]


def algorithm_arguments(algo: str, hyperparameters: dict[str, Any]) -> dict[str, Any]:
    """Turn settings into keyword arguments of `algorithm_class(algo)`.

    Drops what sets up the training, makes schedules of strings such as "lin_0.001", reads
    `policy_kwargs` given as text, "dict(net_arch=[64], activation_fn=nn.ReLU)", and finds the class
    of a replay buffer named "HerReplayBuffer".
    """
    from stable_baselines3.common.utils import LinearSchedule

    check_hyperparameters(algo, hyperparameters)
    arguments = {key: value for key, value in hyperparameters.items() if key not in SETUP}
    for key in ("learning_rate", "clip_range", "clip_range_vf"):
        if isinstance(arguments.get(key), str):
            arguments[key] = LinearSchedule(linear_start(key, arguments[key]), 0.0, 1.0)
    for key in ("policy_kwargs", "replay_buffer_kwargs"):
        if isinstance(arguments.get(key), str):
            arguments[key] = _read_dict(key, arguments[key])
    if "replay_buffer_class" in arguments:
        arguments["replay_buffer_class"] = _buffer_class(arguments["replay_buffer_class"])
    return arguments


def check_algorithm(algo: str) -> None:
    """Raise ValueError unless `algo` is one of `ALGORITHMS`."""
    if algo not in ALGORITHMS:
        raise ValueError(f"algo must be one of {', '.join(ALGORITHMS)}, got {algo!r}")


def check_hyperparameters(algo: str, hyperparameters: dict[str, Any]) -> None:
    """Raise ValueError when a name is neither an argument of the algorithm nor in `SETUP`."""
    arguments = inspect.signature(algorithm_class(algo).__init__).parameters
    known = (set(arguments) - _REFUSED) | SETUP
    unknown = sorted(set(hyperparameters) - known)
    if unknown:
        raise ValueError(
            f"unknown hyperparameter of {algo}: {', '.join(unknown)}; "
            f"known are {', '.join(sorted(known))}"
        )


def linear_start(name: str, text: str) -> float:
    """Return the number in "lin_0.001", the start of a fall to 0; `name` is for the ValueError."""
    kind, _, start = text.partition("_")
    try:
        value = float(start)
    except ValueError:
        value = -1.0
    if kind != "lin" or value <= 0.0:
        raise ValueError(f"{name} must be a number or such as 'lin_0.001', got {text!r}")
    return value


def _buffer_class(name: Any) -> type[Any]:
    from stable_baselines3 import HerReplayBuffer

    if name != HerReplayBuffer.__name__:
        raise ValueError(f"replay_buffer_class must be 'HerReplayBuffer', got {name!r}")
    return HerReplayBuffer


def _read_dict(name: str, text: str) -> dict[str, Any]:
    """Read "dict(key=value, ...)" of literals and torch.nn names without evaluating code."""
    from torch import nn

    def read(node: ast.expr) -> Any:
        if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "nn":
            return getattr(nn, node.attr)
        return ast.literal_eval(node)

    try:
        call = ast.parse(text.strip(), mode="eval").body
        if not (isinstance(call, ast.Call) and ast.unparse(call.func) == "dict" and not call.args):
            raise ValueError("not a call of dict with keywords")
        return {str(keyword.arg): read(keyword.value) for keyword in call.keywords}
    except (SyntaxError, ValueError, AttributeError) as error:
        raise ValueError(
            f"{name} must be a mapping or 'dict(key=literal or nn.Name, ...)', got {text!r}"
        ) from error

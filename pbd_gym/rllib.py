"""Ray RLlib on the native batch: PPO whose env runners step n worlds in one call, on any machine.

    from pbd_gym.rllib import make_ppo_config

    algorithm = make_ppo_config("pbd_gym:PBDRope-v0", num_env_runners=2).build_algo()
    print(algorithm.train()["env_runners"]["episode_return_mean"])

Ray pins one version of Gymnasium and wants a virtual environment of its own. This module must be
importable wherever an env runner is, so pbd_gym is installed on every machine of the cluster.
"""

# Types are checked in .venv, which has no Ray.
# pyright: reportMissingImports=false

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from gymnasium.wrappers.vector import FlattenObservation

from pbd_gym.hyperparams import linear_start, load_hyperparameters

try:  # at module level because the policy is a subclass; `import pbd_gym` does not come here
    import torch
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.algorithms.ppo.torch.default_ppo_torch_rl_module import DefaultPPOTorchRLModule
    from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
    from ray.rllib.core.rl_module.rl_module import RLModuleSpec
    from ray.tune import register_env
except ImportError as error:
    raise ImportError(
        "pbd_gym.rllib needs Ray, in a virtual environment of its own; install it with: "
        "pip install -c constraints-rllib.txt 'pbd-gym[rllib]'"
    ) from error

# Settings of stable-baselines3's PPO that RLlib's can follow, and where not every file has them,
# the value that stable-baselines3 takes.
_DEFAULTS: dict[str, Any] = {
    "n_timesteps": 1_000_000,
    "n_envs": 64,
    "env_kwargs": {},
    "train_env_kwargs": {},
    "policy": "MlpPolicy",  # the networks follow from the spaces
    "n_steps": 64,
    "batch_size": 64,
    "n_epochs": 10,
    "learning_rate": 3e-4,
    "gamma": 0.99,
    "gae_lambda": 0.95,
    "clip_range": 0.2,
    "ent_coef": 0.0,
    "vf_coef": 0.5,
    "max_grad_norm": 0.5,
    "policy_kwargs": {},
}
_NETWORK_DEFAULTS: dict[str, Any] = {"net_arch": [64, 64], "log_std_init": 0.0}


def make_ppo_config(
    id: str,
    *,
    num_env_runners: int = 0,
    seed: int | None = None,
    env_kwargs: Mapping[str, Any] | None = None,
    **hyperparameters: Any,
) -> PPOConfig:
    """Configure RLlib's PPO as stable-baselines3's is for an environment.

    Args:
        id: Environment id with its module, such as "pbd_gym:PBDRope-v0".
        num_env_runners: Processes that step worlds, on any machine of the cluster; 0 for none
            beside that of the learner.
        seed: Of everything; None draws fresh entropy.
        env_kwargs: Arguments of the environment, over those of the hyperparameter file.
        **hyperparameters: Over those of pbd_gym/hyperparams/ppo.yml; `n_envs` worlds are shared
            out among the env runners.

    Raises:
        ValueError: For an unknown hyperparameter, or worlds that cannot be shared out evenly.
    """
    settings = _settings(id, hyperparameters)
    runners = max(num_env_runners, 1)
    if num_env_runners < 0 or settings["n_envs"] % runners:
        raise ValueError(
            f"{settings['n_envs']} worlds cannot be shared out evenly among {num_env_runners} env "
            "runners"
        )
    batch_size = settings["n_envs"] * settings["n_steps"]
    # Ray gives each env runner one processor.
    arguments = {"num_threads": 1} | settings["env_kwargs"] | settings["train_env_kwargs"]
    arguments |= env_kwargs or {}
    register_env("pbd_gym", make_rllib_vec_env)
    return (
        PPOConfig()
        .environment("pbd_gym", env_config={"id": id, **arguments})
        .env_runners(
            num_env_runners=num_env_runners,
            num_envs_per_env_runner=settings["n_envs"] // runners,
            rollout_fragment_length=settings["n_steps"],
            gym_env_vectorize_mode=gymnasium.VectorizeMode.VECTOR_ENTRY_POINT,
            sample_timeout_s=300.0,  # the first step may have to compile the kernels
        )
        .training(
            train_batch_size_per_learner=batch_size,
            minibatch_size=min(settings["batch_size"], batch_size),
            num_epochs=settings["n_epochs"],
            lr=_schedule(settings["learning_rate"], settings["n_timesteps"]),
            gamma=settings["gamma"],
            lambda_=settings["gae_lambda"],
            clip_param=settings["clip_range"],
            entropy_coeff=settings["ent_coef"],
            vf_loss_coeff=settings["vf_coef"],
            vf_clip_param=math.inf,
            grad_clip=settings["max_grad_norm"],
            grad_clip_by="global_norm",
            use_kl_loss=False,
        )
        .rl_module(
            rl_module_spec=RLModuleSpec(
                module_class=GaussianPPOModule, model_config=_networks(settings["policy_kwargs"])
            )
        )
        .learners(num_learners=0)  # in the process of the algorithm: the networks are small
        .callbacks(on_episode_end=_record_success)
        .fault_tolerance(restart_failed_env_runners=True, env_runner_health_probe_timeout_s=1.0)
        .debugging(seed=seed, log_level="ERROR")
    )


def make_rllib_vec_env(config: Mapping[str, Any]) -> VectorEnv:
    """Make the native batch of an env runner, from what RLlib calls `env_config`.

    Args:
        config: The environment's `id`, `num_envs`, and arguments of the environment.

    Returns:
        The batch, staggered; the dicts of a goal-conditioned task are flattened.
    """
    arguments = {"stagger": True, **config}
    env = gymnasium.make_vec(
        arguments.pop("id"),
        num_envs=arguments.pop("num_envs"),
        vectorization_mode="vector_entry_point",
        autoreset_mode=AutoresetMode.NEXT_STEP,  # what RLlib's env runners reckon with
        **arguments,
    )
    if isinstance(env.single_observation_space, gymnasium.spaces.Dict):
        env = FlattenObservation(env)
    return RLlibVecEnv(env)


class RLlibVecEnv(VectorWrapper):
    """The native batch with seeds of its own and with no more info than RLlib reads.

    RLlib seeds neighbouring env runners with neighbouring numbers, and world i of a batch takes
    seed + i: without new seeds almost all worlds of two env runners would be twins. And it unpacks
    info world by world in Python, so there is only `is_success`, where an episode has ended.
    """

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes in all worlds."""
        if seed is not None:
            seed = int(np.random.SeedSequence(seed).generate_state(1)[0])
        observation, _ = self.env.reset(seed=seed, options=options)
        return observation, {}

    def step(
        self, actions: np.ndarray
    ) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Advance all worlds by one control step."""
        observation, reward, terminated, truncated, info = self.env.step(actions)
        ended = terminated | truncated
        success = {"is_success": info["is_success"], "_is_success": ended} if ended.any() else {}
        return observation, reward, terminated, truncated, success


class GaussianPPOModule(DefaultPPOTorchRLModule):
    """RLlib's networks, begun as stable-baselines3 begins them: with hardly any first action.

    The noise of exploration begins at `log_std_init` of the model's configuration.
    """

    def setup(self) -> None:
        """Build the networks and set the policy's first output."""
        super().setup()
        last = self.pi.net.mlp[-1]
        torch.nn.init.orthogonal_(last.weight, gain=0.01)
        torch.nn.init.zeros_(last.bias)
        torch.nn.init.constant_(self.pi.log_std, self.model_config["log_std_init"])


def _settings(id: str, given: dict[str, Any]) -> dict[str, Any]:
    settings = _DEFAULTS | load_hyperparameters("ppo", id) | given
    unknown = sorted(set(settings) - set(_DEFAULTS))
    if unknown:
        raise ValueError(
            f"unknown hyperparameter of RLlib's ppo: {', '.join(unknown)}; "
            f"known are {', '.join(sorted(_DEFAULTS))}"
        )
    return settings


def _networks(policy_kwargs: dict[str, Any]) -> dict[str, Any]:
    networks = _NETWORK_DEFAULTS | policy_kwargs
    unknown = sorted(set(networks) - set(_NETWORK_DEFAULTS))
    if unknown:
        raise ValueError(f"policy_kwargs of RLlib's ppo cannot have {', '.join(unknown)}")
    config = DefaultModelConfig(
        fcnet_hiddens=networks["net_arch"],
        fcnet_activation="tanh",
        fcnet_kernel_initializer="orthogonal_",
        fcnet_kernel_initializer_kwargs={"gain": math.sqrt(2.0)},
        fcnet_bias_initializer="zeros_",
        head_fcnet_hiddens=[],
        free_log_std=True,
        vf_share_layers=False,
    )
    return dataclasses.asdict(config) | {"log_std_init": networks["log_std_init"]}


def _schedule(rate: float | str, total_timesteps: int) -> float | list[list[float]]:
    """Turn "lin_0.001" into RLlib's list of [step, value]."""
    if isinstance(rate, str):
        return [[0, linear_start("learning_rate", rate)], [total_timesteps, 0.0]]
    return rate


def _record_success(*, episode: Any, metrics_logger: Any, **_: Any) -> None:
    success = float(episode.get_infos(-1)["is_success"])
    metrics_logger.log_value("success_rate", success, window=100)

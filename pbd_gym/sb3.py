"""stable-baselines3 on the native batch: n worlds behind one `VecEnv`.

stable-baselines3 has no adapter for Gymnasium's vector environments, and its own `make_vec_env`
steps single environments in a Python loop. This bridge hands the batch through: per step it adds a
list of empty dicts, and touches single worlds only where an episode has ended.

    from stable_baselines3 import PPO
    from pbd_gym.sb3 import make_sb3_vec_env

    model = PPO("MlpPolicy", make_sb3_vec_env("pbd_gym:PBDRope-v0", num_envs=256))
"""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

try:  # at module level because the bridge is a subclass; `import pbd_gym` does not come here
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as error:
    raise ImportError(
        "pbd_gym.sb3 needs stable-baselines3, install it with: pip install 'pbd-gym[train]'"
    ) from error

Indices = int | Iterable[int] | None


def make_sb3_vec_env(
    id: str, num_envs: int, *, seed: int | None = None, **kwargs: Any
) -> SB3VecEnv:
    """Make the native batch of an environment as a stable-baselines3 `VecEnv`.

    Args:
        id: Environment id, such as "pbd_gym:PBDRope-v0".
        num_envs: Number of worlds.
        seed: World i is seeded with `seed + i` at the first reset; None draws fresh entropy.
        **kwargs: Passed to the environment: `render_mode` and the task's own arguments.

    Returns:
        The batch with autoreset in the same step, which is what stable-baselines3 expects.
    """
    env = gymnasium.make_vec(
        id,
        num_envs=num_envs,
        vectorization_mode="vector_entry_point",
        autoreset_mode=AutoresetMode.SAME_STEP,
        **kwargs,
    )
    bridge = SB3VecEnv(env)
    if seed is not None:
        bridge.seed(seed)
    return bridge


def load_policy(
    path: str | os.PathLike[str], algo: str, id: str
) -> tuple[Callable[[Any], np.ndarray], dict[str, Any]]:
    """Load a saved model to act in an environment, without exploring.

    Args:
        path: Of the model; load only your own, for it is unpickled.
        algo: "ppo", "sac" or "crossq".
        id: Of the environment.

    Returns:
        A function from an observation, or a batch of them, to actions; and the keywords of `make`
        with which the environment observes what the model was trained on.

    Raises:
        FileNotFoundError: If there is no such model.
        ValueError: If the model was trained on something else.
    """
    from pbd_gym.hyperparams import algorithm_class

    model = algorithm_class(algo).load(path, device="cpu")
    seen = []
    for kind in ("particles", "keypoints"):
        env = gymnasium.make(id, observation=kind)
        seen.append(_shapes(env.observation_space))
        if _shapes(model.observation_space) == seen[-1] and model.action_space == env.action_space:
            return partial(_act, model), {"observation": kind}
    given, allowed = _shapes(model.observation_space), " or ".join(map(str, seen))
    raise ValueError(f"{path} observes {given}; {id} has {allowed}: it was trained on another task")


def _act(model: Any, observation: Any) -> np.ndarray:
    return model.predict(observation, deterministic=True)[0]


def _shapes(space: Any) -> Any:
    """Return the shape of a space, of a dict those of its parts by name."""
    if isinstance(space, gymnasium.spaces.Dict):
        return {name: part.shape for name, part in space.items()}
    return space.shape


class SB3VecEnv(VecEnv):
    """A Gymnasium vector environment with autoreset SAME_STEP, as stable-baselines3 sees it.

    Infos are empty but for the worlds whose episode has just ended. Those hold the last step's
    `is_success` and reward terms, `terminal_observation`, `TimeLimit.truncated`, and
    `episode` = {"r": return, "l": length [steps], "t": seconds since creation}, so neither
    `VecMonitor` nor `Monitor` is needed.
    """

    def __init__(self, env: VectorEnv) -> None:
        mode = env.metadata.get("autoreset_mode")
        if mode != AutoresetMode.SAME_STEP:
            raise ValueError(f"autoreset_mode must be AutoresetMode.SAME_STEP, got {mode}")
        # Any: VectorEnv's signatures know neither lists of seeds nor get_state.
        self.env: Any = env  # before super().__init__, which asks for `render_mode`
        self._returns = np.zeros(env.num_envs)  # (W,) of the running episodes
        self._lengths = np.zeros(env.num_envs, dtype=np.int64)  # (W,) [steps]
        self._created = time.time()
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self.metadata = {**env.metadata, "render_modes": self.metadata["render_modes"]}

    def reset(self) -> np.ndarray:
        """Start a new episode in every world, with the seeds and options set before, if any."""
        seeds = None if all(seed is None for seed in self._seeds) else list(self._seeds)
        options = self._options[0]
        if any(other != options for other in self._options):
            raise ValueError("options must be the same for all worlds of a batch")
        observation, info = self.env.reset(seed=seeds, options=options or None)
        self.reset_infos = [_world_info(info, world) for world in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        self._returns[:] = 0.0
        self._lengths[:] = 0
        return observation

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions (W, action) for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Step all worlds; return observation (W, ...), reward (W,), done (W,) and W infos."""
        observation, reward, terminated, truncated, info = self.env.step(self._actions)
        self._returns += reward
        self._lengths += 1
        done = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if done.any():
            self._finish_episodes(np.flatnonzero(done), terminated, info, infos)
        return observation, reward.astype(np.float32), done, infos  # PPO writes into the reward

    def _finish_episodes(
        self, worlds: np.ndarray, terminated: np.ndarray, info: dict, infos: list[dict[str, Any]]
    ) -> None:
        """Fill the infos of the `worlds` whose episode has ended, and zero their statistics."""
        seconds = time.time() - self._created
        for world in worlds.tolist():
            final_info = _world_info(info["final_info"], world)
            final_info["terminal_observation"] = info["final_obs"][world]
            final_info["TimeLimit.truncated"] = not terminated[world]
            total, length = self._returns.item(world), self._lengths.item(world)
            final_info["episode"] = {"r": total, "l": length, "t": seconds}
            infos[world] = final_info
        self._returns[worlds] = 0.0
        self._lengths[worlds] = 0

    def get_state(self) -> dict[str, Any]:
        """Return everything the next steps depend on, as an object that can be pickled."""
        return {
            "env": self.env.unwrapped.get_state(),
            "returns": self._returns.copy(),
            "lengths": self._lengths.copy(),
            "seeds": list(self._seeds),
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Continue from what `get_state` returned: same worlds, same running episodes."""
        self.env.unwrapped.set_state(state["env"])
        self._returns[:] = state["returns"]
        self._lengths[:] = state["lengths"]
        self._seeds = list(state["seeds"])

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Return one frame (H, W, 3) per world."""
        if self.render_mode != "rgb_array":
            message = f"render_mode must be 'rgb_array' to get images, got {self.render_mode}"
            warnings.warn(message, stacklevel=2)
            return [None] * self.num_envs
        return list(self.env.render())

    def close(self) -> None:
        """Free what the batch holds."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """Return an attribute of the batch, once per index."""
        value = getattr(self.env.unwrapped, attr_name)
        return [value for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        """Set an attribute of the batch; the worlds share it, so `indices` must name them all."""
        if set(self._get_indices(indices)) != set(range(self.num_envs)):
            raise ValueError(f"{attr_name} is shared by all worlds, got only indices {indices}")
        setattr(self.env.unwrapped, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: Indices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of the batch once and return its result once per index."""
        result = getattr(self.env.unwrapped, method_name)(*method_args, **method_kwargs)
        return [result for _ in self._get_indices(indices)]

    def env_is_wrapped(
        self, wrapper_class: type[gymnasium.Wrapper], indices: Indices = None
    ) -> list[bool]:
        """Say True for `Monitor` alone: its episode statistics are in the infos."""
        return [issubclass(wrapper_class, Monitor) for _ in self._get_indices(indices)]


def _world_info(info: dict[str, Any], world: int) -> dict[str, Any]:
    """Return one world's part of Gymnasium's dict of arrays with `_key` masks."""
    return {
        key: values.item(world) if values.ndim == 1 else values[world]
        for key, values in info.items()
        if not key.startswith("_") and info[f"_{key}"][world]
    }

"""n worlds of a task as a Gymnasium vector environment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from pbd_gym.envs.arguments import as_dict, make_task
from pbd_gym.envs.observations import replace, world_of
from pbd_gym.envs.pictures import Pictures
from pbd_gym.envs.state import EpisodeState, check_state
from pbd_gym.rendering import Viewpoint
from pbd_gym.tasks import Batch, Task


class PBDVectorEnv(VectorEnv[Any, np.ndarray, np.ndarray]):
    """n worlds of a task in one batch, with time limit and autoreset.

    Equal to a `SyncVectorEnv` of n single environments to the last bit, in all three autoreset
    modes: world i draws from a generator of its own, seeded as `SyncVectorEnv` seeds env i.

    Args:
        num_envs: Number of worlds.
        task: Task class, or its place "module:Class".
        max_episode_steps: Steps after which an episode is truncated; None for no limit.
        autoreset_mode: NEXT_STEP, SAME_STEP or DISABLED, as an `AutoresetMode` or its name.
        render_mode: None or "rgb_array".
        render_size: Width and height of a frame [pixels].
        camera: "default", "front", "side", "top" or a `pbd_gym.rendering.Viewpoint`.
        color: "material", or "strain" with a legend in percent.
        theme: "light" or "dark".
        show: Any of "scale", "clock" and "trail".
        num_threads: Threads that share the worlds; chosen by the size of the batch where None.
        stagger: Whether a full `reset` cuts the first episode of world i short by the share
            i / num_envs, so that not all episodes end at once. On-policy learners then see all
            parts of an episode in each rollout.
        **arguments: The task's configuration, see its class.

    Raises:
        TypeError: For an unknown keyword.
        ValueError: For a value out of range.
    """

    # Gymnasium reads it from the class, and declares it there as an attribute of instances
    metadata = {"render_modes": ["rgb_array"], "render_fps": 30}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int,
        task: str | type[Task],
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        render_size: tuple[int, int] = (512, 512),
        camera: str | Viewpoint = "default",
        color: str = "material",
        theme: str = "light",
        show: Sequence[str] = ("scale",),
        num_threads: int | None = None,
        stagger: bool = False,
        **arguments: Any,
    ) -> None:
        if render_mode == "human":
            raise ValueError("render_mode is 'human'; a vector environment draws 'rgb_array' only")
        _check_count("num_envs", num_envs)
        if max_episode_steps is not None:
            _check_count("max_episode_steps", max_episode_steps)
        self.task = make_task(task, arguments)
        self._pictures = Pictures(
            self.task, num_envs, render_mode, render_size, camera, color, theme, show
        )
        self.render_mode = render_mode
        self.num_envs = num_envs
        self.max_episode_steps = max_episode_steps
        self._skipped = _skipped_steps(stagger, num_envs, max_episode_steps)
        self.autoreset_mode = _autoreset_mode(autoreset_mode)
        self.metadata = {
            "render_modes": ["rgb_array"],
            "render_fps": self._pictures.fps,
            "autoreset_mode": self.autoreset_mode,
        }
        self._batch = Batch(self.task, num_envs, num_threads)
        self.single_action_space = self.task.action_space
        self.single_observation_space = self.task.observation_space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._generators = [seeding.np_random()[0] for _ in range(num_envs)]
        self._elapsed = np.zeros(num_envs, dtype=np.int64)
        self._ended = np.zeros(num_envs, dtype=bool)
        self._begun = np.zeros(num_envs, dtype=bool)

    def reset(
        self,
        *,
        seed: int | list[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes in all worlds, or in those of `options["reset_mask"]`.

        Args:
            seed: World i is seeded with seed + i, or with the i-th of a list.
            options: Quantities to fix (see the task), for all worlds or one row per world, and
                `reset_mask`, a bool array (num_envs,).

        Raises:
            TypeError, ValueError: For a wrong seed, mask or option. Nothing changes then.
        """
        fixed = as_dict(options)
        mask = self._check_mask(fixed.pop("reset_mask", None))
        fixed = self._batch.check_options(fixed)
        generators = self._seeded(seed, mask)
        self._begin(np.flatnonzero(mask), generators, fixed)
        self._generators = generators
        if mask.all():
            self._elapsed[:] = self._skipped
        return self._batch.observe(), {}

    def _begin(
        self,
        worlds: np.ndarray,
        generators: list[np.random.Generator],
        fixed: dict[str, np.ndarray],
    ) -> None:
        self._batch.reset(worlds, generators, fixed)
        self._elapsed[worlds] = 0
        self._ended[worlds] = False
        self._begun[worlds] = True
        self._pictures.begin(worlds, self._batch)

    def _check_mask(self, mask: Any) -> np.ndarray:
        if mask is None:
            return np.ones(self.num_envs, dtype=bool)
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
            raise TypeError(f"reset_mask is {mask!r}; expected a numpy array of dtype bool")
        if mask.shape != (self.num_envs,) or not mask.any():
            raise ValueError(
                f"reset_mask has shape {mask.shape} and {mask.sum()} true entries; expected shape "
                f"({self.num_envs},) and at least one"
            )
        return mask

    def _seeded(
        self, seed: int | list[int | None] | None, mask: np.ndarray
    ) -> list[np.random.Generator]:
        """Return the generators of all worlds, anew where a masked world is given a seed."""
        if seed is None:
            return self._generators
        if not isinstance(seed, int | list | tuple):
            raise TypeError(
                f"seed is {seed!r}; expected None, a whole number or a list of {self.num_envs}"
            )
        seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, int) else seed
        if len(seeds) != self.num_envs:
            raise ValueError(f"{len(seeds)} seeds were given for {self.num_envs} worlds")
        return [
            seeding.np_random(new)[0] if new is not None and masked else old
            for new, old, masked in zip(seeds, self._generators, mask, strict=True)
        ]

    def step(
        self, actions: np.ndarray
    ) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Advance every world by one control step; begin ended episodes anew by autoreset mode.

        Raises:
            RuntimeError: Before the first `reset`, or with autoreset DISABLED while an ended
                episode was not reset.
            TypeError, ValueError: For actions that are no finite numbers of the right shape.
                Nothing has moved then.
        """
        if not self._begun.all():
            raise RuntimeError("step was called before reset: call reset() first")
        if self.autoreset_mode is AutoresetMode.DISABLED and self._ended.any():
            raise RuntimeError(
                f"the episode of world {np.flatnonzero(self._ended)[0]} has ended and autoreset is "
                "disabled: call reset(options={'reset_mask': ...}) first"
            )
        going = ~self._ended
        outcome = self._batch.step(actions)
        reward = outcome.reward
        self._pictures.advance(self._batch)
        if not going.all():  # NEXT_STEP: this step only begins those episodes
            self._begin(np.flatnonzero(~going), self._generators, {})
            reward = np.where(going, reward, 0.0)
        self._elapsed += going
        terminated = outcome.terminated & going
        limit = self.max_episode_steps
        truncated = np.zeros(self.num_envs, dtype=bool) if limit is None else self._elapsed >= limit
        self._ended = terminated | truncated
        observation = self._batch.observe()
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._ended.any():
            infos = self._begin_ended(observation, outcome.info)
        else:
            infos = _infos(outcome.info, going)
        return observation, reward, terminated, truncated, infos

    def _begin_ended(self, observation: Any, info: dict[str, np.ndarray]) -> dict[str, Any]:
        """Begin the ended episodes anew and observe them; return infos that hold how they ended."""
        ended = self._ended.copy()
        worlds = np.flatnonzero(ended)
        infos = _infos(info, ~ended)
        last = np.full(self.num_envs, None, dtype=object)
        for world in worlds.tolist():
            last[world] = world_of(observation, world)
        infos["final_obs"], infos["final_info"] = last, _infos(info, ended)
        infos["_final_obs"] = infos["_final_info"] = ended
        self._begin(worlds, self._generators, {})
        replace(observation, worlds, self._batch.observe(worlds))
        return infos

    # Gymnasium types it with a variable that is not the one of the class
    def render(self) -> tuple[np.ndarray, ...] | None:  # type: ignore[override]
        """Return one frame per world, (height, width, 3) uint8 each; None without a render mode."""
        if self.render_mode is None:
            gymnasium.logger.warn(
                'render was called without a render mode; pass render_mode="rgb_array"'
            )
            return None
        return tuple(self._pictures.draw(self._batch, world) for world in range(self.num_envs))

    def get_state(self) -> EpisodeState:
        """Return all that the worlds' continuation depends on, random generators included."""
        worlds, variables = self._batch.get_state()
        generators = [generator.bit_generator.state for generator in self._generators]
        counters = self._elapsed.copy(), self._ended.copy(), self._begun.copy()
        return EpisodeState(worlds, variables, generators, *counters)

    def set_state(self, state: EpisodeState) -> None:
        """Continue from a state of `get_state`, to the last bit.

        Raises:
            TypeError: If it is no `EpisodeState`.
            ValueError: If it is of another task, model or number of worlds. Nothing changes then.
        """
        check_state(state, self.num_envs)
        self._batch.set_state((state.worlds, state.variables))
        for generator, saved in zip(self._generators, state.generators, strict=True):
            generator.bit_generator.state = saved
        self._elapsed = state.elapsed.copy()
        self._ended = state.ended.copy()
        self._begun = state.begun.copy()
        self._pictures.begin(np.arange(self.num_envs), self._batch)


def _infos(info: dict[str, np.ndarray], mask: np.ndarray) -> dict[str, Any]:
    """Return Gymnasium's vector format: each array, 0 where masked out, and its mask.

    All of them share the mask.
    """
    shown = np.flatnonzero(mask)
    infos: dict[str, Any] = {}
    if not len(shown):
        return infos
    hidden = np.flatnonzero(~mask) if len(shown) < len(mask) else None
    for name, values in info.items():
        wide = values.astype(np.float64) if values.dtype == np.float32 else values
        infos[name] = wide if hidden is None else _masked(wide, shown, hidden)
        infos[f"_{name}"] = mask
    return infos


def _masked(values: np.ndarray, shown: np.ndarray, hidden: np.ndarray) -> np.ndarray:
    """Return a copy of values that is 0 where hidden; writes the fewer of the two."""
    if len(shown) < len(hidden):
        result = np.zeros(values.shape, values.dtype)
        result[shown] = values[shown]
    else:
        result = values.copy()
        result[hidden] = 0
    return result


def _check_count(name: str, value: Any) -> None:
    """Refuse what is no positive whole number."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise ValueError(f"{name} is {value!r}; expected a whole number from 1 up")


def _skipped_steps(stagger: Any, num_envs: int, limit: int | None) -> np.ndarray:
    """Return how many steps the worlds' first episodes lack, (num_envs,)."""
    if not isinstance(stagger, bool):
        raise TypeError(f"stagger is {stagger!r}; expected True or False")
    if not stagger:
        return np.zeros(num_envs, dtype=np.int64)
    if limit is None:
        raise ValueError("stagger is True; without max_episode_steps it must be False")
    return np.arange(num_envs) * limit // num_envs


def _autoreset_mode(mode: AutoresetMode | str) -> AutoresetMode:
    """Return the mode of a name."""
    if isinstance(mode, AutoresetMode):
        return mode
    if mode in AutoresetMode.__members__:
        return AutoresetMode[mode]
    raise ValueError(f"autoreset_mode is {mode!r}; allowed: {', '.join(AutoresetMode.__members__)}")

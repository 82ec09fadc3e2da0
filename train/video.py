"""Films of a policy: several worlds side by side."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pbd_gym.rendering import VideoWriter, grid
from policies import make_policy
from rollouts import make_batch

WORLDS, COLUMNS = 6, 3
LEAST_SECONDS = 6.0


def check_video(path: Path) -> None:
    """Raise ImportError or ValueError unless a video can be written to `path`."""
    VideoWriter(path, fps=30)  # opens nothing before the first frame


def record_video(
    path: Path, env_id: str, policy_name: str, env_kwargs: dict[str, Any], *, seed: int
) -> None:
    """Film whole episodes of a policy in six worlds, in real time and for at least six seconds.

    Args:
        path: Of the MP4 or GIF.
        env_id: Environment to act in.
        policy_name: As for `make_policy`.
        env_kwargs: Arguments of the environment.
        seed: World i is seeded with `seed + i`, so these are the first worlds of an evaluation
            with the same seed.
    """
    env = make_batch(env_id, WORLDS, env_kwargs, render_mode="rgb_array")
    policy = make_policy(policy_name, env, seed=seed)
    rate = env.metadata["render_fps"]
    frames, ended = 0, False
    observation, _ = env.reset(seed=seed)
    with VideoWriter(path, rate) as video:
        while not ended or frames < LEAST_SECONDS * rate:
            video.write(grid(env.render(), COLUMNS))  # type: ignore[arg-type]
            observation, _, terminated, truncated, _ = env.step(policy(observation))
            frames, ended = frames + 1, bool(terminated[0] or truncated[0])
    env.close()

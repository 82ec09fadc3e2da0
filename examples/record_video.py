"""Film a policy in several worlds side by side.

python examples/record_video.py --env pbd_gym:PBDRope-v0 --policy scripted --grid 2x3 --out rope.mp4
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from tqdm import tqdm

from pbd_gym.rendering import VideoWriter, grid

Policy = Callable[[Any], np.ndarray]


def parse_arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--env", default="pbd_gym:PBDRope-v0", help="id of the environment (default: %(default)s)"
    )
    parser.add_argument(
        "--policy",
        default="scripted",
        help="random, scripted (the task's own baseline) or the path of a model that "
        "stable-baselines3 has saved; load only your own, for it is unpickled "
        "(default: %(default)s)",
    )
    parser.add_argument(
        "--algo",
        choices=("ppo", "sac"),
        default="ppo",
        help="algorithm that trained the model (default: %(default)s)",
    )
    parser.add_argument(
        "--grid",
        type=parse_grid,
        default=(2, 2),
        metavar="ROWSxCOLUMNS",
        help="worlds to show side by side (default: 2x2)",
    )
    parser.add_argument(
        "--episodes",
        type=int,
        help="episodes to film, rounded up to whole grids (default: one grid)",
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("video.mp4"),
        help="the video, .mp4, .gif or .webp (default: %(default)s)",
    )
    parser.add_argument(
        "--size", type=int, default=512, help="of each world [pixels] (default: %(default)s)"
    )
    parser.add_argument(
        "--color",
        choices=("material", "strain"),
        default="material",
        help="what colours tell (default: %(default)s)",
    )
    parser.add_argument(
        "--theme", choices=("light", "dark"), default="light", help="(default: %(default)s)"
    )
    parser.add_argument(
        "--seed",
        type=int,
        default=0,
        help="of the first episode; each further one has the next (default: %(default)s)",
    )
    arguments = parser.parse_args()
    if arguments.episodes is not None and arguments.episodes < 1:
        parser.error(f"argument --episodes: {arguments.episodes} is not positive")
    return arguments


def parse_grid(text: str) -> tuple[int, int]:
    """Read "2x3" as 2 rows and 3 columns."""
    rows, _, columns = text.partition("x")
    if not (rows.isdecimal() and columns.isdecimal() and int(rows) and int(columns)):
        raise argparse.ArgumentTypeError(f"{text!r} is not like 2x3, rows and columns")
    return int(rows), int(columns)


def make_batch(arguments: argparse.Namespace, worlds: int) -> tuple[Any, Policy]:
    """Return worlds that are drawn, and a function from observations (W, ...) to actions."""
    policy, options = None, {}
    if arguments.policy not in ("random", "scripted"):
        from pbd_gym.sb3 import load_policy

        policy, options = load_policy(arguments.policy, arguments.algo, arguments.env)
    env: Any = gymnasium.make_vec(
        arguments.env,
        num_envs=worlds,
        vectorization_mode="vector_entry_point",
        autoreset_mode=AutoresetMode.NEXT_STEP,  # the last frame shows how an episode ended
        render_mode="rgb_array",
        render_size=(arguments.size, arguments.size),
        color=arguments.color,
        theme=arguments.theme,
        **options,
    )
    env.action_space.seed(arguments.seed)
    if arguments.policy == "random":
        return env, lambda observation: env.action_space.sample()
    return env, policy or env.unwrapped.task.scripted


def film_round(
    env: Any, policy: Policy, seed: int, columns: int, video: VideoWriter, bar: tqdm
) -> np.ndarray:
    """Film one episode in every world and return which succeeded (W,); who is done stands still."""
    observation, _ = env.reset(seed=seed)
    pictures = list(env.render())
    done = np.zeros(env.num_envs, dtype=bool)
    success = np.zeros(env.num_envs, dtype=bool)
    video.write(grid(pictures, columns))
    while not done.all():
        observation, _, terminated, truncated, info = env.step(policy(observation))
        frames = env.render()
        for world in np.flatnonzero(~done):
            pictures[world] = frames[world]
            success[world] = info["is_success"][world]
        done |= terminated | truncated
        video.write(grid(pictures, columns))
        bar.update()
    return success


def main() -> None:
    """Film the episodes and say where the film is and how many succeeded."""
    arguments = parse_arguments()
    rows, columns = arguments.grid
    worlds = rows * columns
    rounds = -(-(arguments.episodes or worlds) // worlds)
    env, policy = make_batch(arguments, worlds)
    steps = env.spec.max_episode_steps if env.spec else None
    successes = []
    with (
        VideoWriter(arguments.out, fps=env.metadata["render_fps"]) as video,
        tqdm(total=steps and rounds * steps, unit="frame", desc=str(arguments.out)) as bar,
    ):
        for k in range(rounds):
            seed = arguments.seed + k * worlds
            successes.append(film_round(env, policy, seed, columns, video, bar))
    env.close()
    succeeded = int(np.sum(successes))
    print(f"{arguments.out}: {succeeded} of {rounds * worlds} episodes succeeded")


if __name__ == "__main__":
    main()

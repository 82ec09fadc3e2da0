"""Random actions for a million steps: does every world stay finite, whole and above the table?

Prints one row per environment: steps, episodes that diverged, worst stretch and compression of a
directly solved link, lowest particle above a wall, greatest observation.
"""

from __future__ import annotations

import argparse
from typing import cast

import gymnasium
import numpy as np
from tqdm import trange

import pbd_gym
from pbd_gym.envs import PBDVectorEnv

gymnasium.register_envs(pbd_gym)
# without the twins of other tasks, whose worlds are the same
IDS = [id for id in gymnasium.registry if id.startswith("PBD") and "Goal" not in id]


def endure(name: str, steps: int, worlds: int, seed: int) -> str:
    """Step one environment with random actions and return its row."""
    env = gymnasium.make_vec(name, num_envs=worlds, vectorization_mode="vector_entry_point")
    face = cast(PBDVectorEnv, env.unwrapped)
    model = face.task.model
    pairs, rest = model.links()
    generator = np.random.default_rng(seed)
    env.reset(seed=seed)
    stretch = compression = greatest = 0.0
    lowest, diverged = np.inf, 0
    for _ in trange(-(-steps // worlds), desc=name, leave=False):
        actions = generator.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32)
        observation, _, terminated, _, _ = env.step(actions)
        x = face.get_state().worlds.x
        ends = x[:, pairs].astype(np.float64)
        strain = np.sqrt(((ends[:, :, 0] - ends[:, :, 1]) ** 2).sum(axis=2)) / rest - 1.0
        stretch, compression = max(stretch, strain.max()), min(compression, strain.min())
        lowest = min(lowest, float((x - model.room.lower).min()))
        greatest = max(greatest, float(np.abs(observation).max()))
        diverged += int(terminated.sum())
    env.close()
    total = -(-steps // worlds) * worlds
    return (
        f"| {name} | {total:,} | {diverged} | {100 * stretch:.2f} % | {100 * compression:.2f} % "
        f"| {1000 * lowest:.2f} mm | {greatest:.2f} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ids", nargs="+", default=IDS, choices=IDS, help="environments (all)")
    parser.add_argument("--steps", type=int, default=1_000_000, help="steps over all worlds")
    parser.add_argument("--worlds", type=int, default=256, help="worlds side by side")
    parser.add_argument("--seed", type=int, default=0, help="of worlds and actions")
    options = parser.parse_args()
    print("| id | steps | diverged | stretch | compression | lowest | observation |")
    print("|---|---|---|---|---|---|---|")
    for name in options.ids:
        print(endure(name, options.steps, options.worlds, options.seed), flush=True)


if __name__ == "__main__":
    main()

"""Measure frames per second beside gymnasium's Pendulum-v1: python benchmarks/rendering.py.

All are drawn in turn in one run, at 512 x 512 pixels; what counts is the ratio of the medians.
"""

from __future__ import annotations

import argparse
import os
import time

import gymnasium
import numpy as np

SIZE = 512
IDS = ("PBDRope-v0", "PBDCloth-v0", "PBDDoublePendulum-v0")


def measure(rounds: int) -> dict[str, float]:
    """Return the median time of a frame of each environment by id [s]."""
    # Pendulum-v1 asks for a video driver; without a display it takes this one.
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    pendulum = gymnasium.make("Pendulum-v1", render_mode="rgb_array").unwrapped
    pendulum.screen_dim = SIZE  # pyright: ignore[reportAttributeAccessIssue]
    envs: dict[str, gymnasium.Env] = {"Pendulum-v1": pendulum}
    for id in IDS:
        name = f"pbd_gym:{id}"
        envs[id] = gymnasium.make(name, render_mode="rgb_array", render_size=(SIZE, SIZE))
    times: dict[str, list[float]] = {id: [] for id in envs}
    for env in envs.values():
        env.reset(seed=0)
        env.action_space.seed(0)
    for turn in range(rounds + 5):
        for id, env in envs.items():
            env.step(env.action_space.sample())
            start = time.perf_counter()
            env.render()
            if turn >= 5:  # the first pictures load kernels and fonts
                times[id].append(time.perf_counter() - start)
    return {id: float(np.median(values)) for id, values in times.items()}


def main() -> None:
    """Print the time of a frame, and how many times as fast it is as Pendulum-v1."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=80, help="frames (default: %(default)s)")
    seconds = measure(parser.parse_args().rounds)
    print("| environment | frame | beside Pendulum-v1 |\n|---|---:|---:|")
    for id, median in seconds.items():
        print(f"| `{id}` | {1e3 * median:.2f} ms | {seconds['Pendulum-v1'] / median:.2f} |")


if __name__ == "__main__":
    main()

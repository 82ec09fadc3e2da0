"""Learn from pixels: pictures as observations, the last few stacked so that motion can be seen.

python examples/pixels.py --env pbd_gym:PBDCloth-v0 --size 64 --frames 3
"""

from __future__ import annotations

import argparse
import time

import gymnasium
from gymnasium.wrappers import AddRenderObservation, FrameStackObservation


def make_pixel_env(id: str, size: int, frames: int) -> gymnasium.Env:
    """Make an environment that shows pictures (frames, size, size, 3) of uint8 and nothing else."""
    env = gymnasium.make(id, render_mode="rgb_array", render_size=(size, size))
    # render_only=False would put {"state": ..., "pixels": ...} side by side instead
    return FrameStackObservation(AddRenderObservation(env, render_only=True), frames)


def main() -> None:
    """Step a random policy and say what it saw and how fast."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--env", default="pbd_gym:PBDRope-v0", help="id (%(default)s)")
    parser.add_argument("--size", type=int, default=84, help="even, in pixels (%(default)s)")
    parser.add_argument("--frames", type=int, default=3, help="stacked pictures (%(default)s)")
    parser.add_argument("--steps", type=int, default=500, help="to take (%(default)s)")
    options = parser.parse_args()

    env = make_pixel_env(options.env, options.size, options.frames)
    env.action_space.seed(0)
    observation, _ = env.reset(seed=0)
    begin = time.perf_counter()
    for _ in range(options.steps):
        observation, _, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            observation, _ = env.reset()
    speed = options.steps / (time.perf_counter() - begin)
    print(f"observation {observation.shape} {observation.dtype}, {speed:,.0f} steps/s")
    env.close()


if __name__ == "__main__":
    main()

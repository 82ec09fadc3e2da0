"""Plan an episode on exact snapshots, live: no training, no model but the environment itself.

python examples/plan.py --env pbd_gym:PBDDoublePendulum-v0 --video swing_up.mp4
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import gymnasium

from pbd_gym.planning import METHODS, Planner, planner_settings
from pbd_gym.rendering import VideoWriter


def parse_arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--env", default="pbd_gym:PBDRope-v0", help="id (%(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of start and planner (%(default)s)")
    parser.add_argument("--method", choices=METHODS, default="cem", help="(%(default)s)")
    for name, what in (
        ("horizon", "steps of a sequence"),
        ("candidates", "sequences tried at once"),
        ("iterations", "refinements per plan"),
    ):
        parser.add_argument(f"--{name}", type=int, help=f"{what} (by the environment)")
    parser.add_argument("--steps", type=int, help="to play at most (the whole episode)")
    parser.add_argument("--video", type=Path, metavar="MP4", help="film the episode")
    return parser.parse_args()


def main() -> None:
    """Plan, play and report."""
    options = parse_arguments()
    names = ("method", "horizon", "candidates", "iterations")
    given = {name: getattr(options, name) for name in names if getattr(options, name) is not None}
    settings = planner_settings(options.env, **given)
    env = gymnasium.make(options.env, render_mode="rgb_array" if options.video else None)
    planner = Planner(env.get_wrapper_attr("task"), settings, seed=options.seed)
    get_state = env.get_wrapper_attr("get_state")

    env.reset(seed=options.seed)
    planner.plan(get_state())  # compiles what is not compiled yet, outside of the clock
    planner.reset(options.seed)
    frames, total, steps, seconds, info, ended = [], 0.0, 0, 0.0, {}, False
    while not ended:
        began = time.perf_counter()
        plan = planner.plan(get_state())
        seconds += time.perf_counter() - began
        for action in plan.actions[0, : settings.replan]:
            _, reward, terminated, truncated, info = env.step(action)
            total, steps = total + float(reward), steps + 1
            if options.video:
                frames.append(env.render())
            ended = terminated or truncated or steps == options.steps
            if ended:
                break
    rate = env.get_wrapper_attr("task").control_rate
    print(f"return {total:.1f} in {steps} steps, success: {info['is_success']}")
    print(f"real-time factor of planning: {steps / rate / seconds:.2f} (1 is live)")
    if options.video:
        with VideoWriter(options.video, fps=env.metadata["render_fps"]) as video:
            for frame in frames:
                video.write(frame)
        print(options.video)
    env.close()


if __name__ == "__main__":
    main()

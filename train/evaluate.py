"""Measure a policy: mean return, success rate and normalized performance over fresh episodes.

All episodes run at once in the native batch, each world contributing its first episode.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import gymnasium

from arguments import HelpFormatter, StoreKeyValues
from config import DEFAULT_ENV, load_config
from policies import make_policy
from rollouts import make_batch, report, run_episodes
from run_directory import RunDirectory
from video import check_video, record_video

EXAMPLES = """\
examples:
  python train/evaluate.py scripted
  python train/evaluate.py random --env pbd_gym:PBDCloth-v0 --episodes 1000
  python train/evaluate.py planner --env pbd_gym:PBDTriplePendulum-v0 --episodes 5
  python train/evaluate.py runs/PBDRope-v0-ppo-0 --video rope.mp4 --json rope.json
      the best model of a run, in the environment it was trained in

Models are pickles: loading one can run any code, so load only your own.
"""


def build_parser() -> argparse.ArgumentParser:
    """Describe the options."""
    parser = argparse.ArgumentParser(
        description=__doc__, epilog=EXAMPLES, formatter_class=HelpFormatter
    )
    parser.add_argument(
        "policy",
        help="noop, random, scripted, planner, a saved model (.zip), or the folder of a run",
    )
    parser.add_argument(
        "--env", metavar="ID", help=f"environment (default: the run's, or else {DEFAULT_ENV})"
    )
    parser.add_argument(
        "--env-kwargs",
        nargs="+",
        action=StoreKeyValues,
        default={},
        metavar="KEY:VALUE",
        help="arguments of the environment (default: the run's, or else none)",
    )
    parser.add_argument("--episodes", type=int, default=100, metavar="N", help="(default: 100)")
    parser.add_argument(
        "--seed", type=int, default=0, help="world i is seeded with seed + i (default: 0)"
    )
    parser.add_argument("--video", type=Path, metavar="MP4", help="film the policy")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the numbers")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return its exit status."""
    parser = build_parser()
    options = parser.parse_args(arguments)
    try:
        evaluate(options)
    except (ValueError, TypeError, OSError, ImportError, gymnasium.error.Error) as error:
        parser.error(str(error))
    return 0


def evaluate(options: argparse.Namespace) -> None:
    """Run the episodes and report them as asked for."""
    if options.episodes < 1:
        raise ValueError(f"--episodes must be at least 1, got {options.episodes}")
    if options.seed < 0:
        raise ValueError(f"--seed must not be negative, got {options.seed}")
    for file in (options.video, options.json):
        if file is not None and not file.parent.is_dir():
            raise FileNotFoundError(f"there is no folder {file.parent} to write {file.name} into")
    if options.video is not None:
        check_video(options.video)
    name, env_id, env_kwargs = resolve(options)
    env = make_batch(env_id, options.episodes, env_kwargs)
    policy = make_policy(name, env, seed=options.seed)
    summary = run_episodes(env, policy, seed=options.seed).summary()
    env.close()
    summary |= {"env": env_id, "policy": name, "seed": options.seed}
    print(report(summary, f"{env_id}, {name}"))
    if options.json is not None:
        options.json.write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    if options.video is not None:
        record_video(options.video, env_id, name, env_kwargs, seed=options.seed)
        print(options.video)


def resolve(options: argparse.Namespace) -> tuple[str, str, dict]:
    """Find the policy's name or file, its environment and the environment's arguments.

    A model that lies in the folder of a run is evaluated as that run was trained, unless the
    options say otherwise.
    """
    path = Path(options.policy)
    run = RunDirectory(path if path.is_dir() else path.parent)
    name = str(run.chosen_model) if path.is_dir() else options.policy
    if not (path.exists() and run.config.exists()):
        return name, options.env or DEFAULT_ENV, options.env_kwargs
    config, _ = load_config(run.config)
    return name, options.env or config.env, config.env_kwargs | options.env_kwargs


if __name__ == "__main__":
    sys.exit(main())

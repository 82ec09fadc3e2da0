"""Train a policy for a pendulum by imitation of a swing-up that is planned and regulated.

A swing-up is found by trajectory optimisation on the exact step of the task, a linear-quadratic
regulator is made to follow it and to balance, and a network learns to act as the regulator does.
Everything a run produces is in one folder, runs/<env>-imitate-<seed>.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium

from arguments import StoreKeyValues, sparse_parser
from config import SETTING_ERRORS, save_config
from finishing import finish
from pbd_gym.tasks.pendulum import Pendulum
from run_directory import RunDirectory
from video import check_video

if TYPE_CHECKING:  # torch takes seconds to import, which --help and wrong options need not wait for
    from imitation_training import ImitationTraining

DEFAULT_ENV = "pbd_gym:PBDTriplePendulum-v0"
EXAMPLES = """\
examples:
  python train/imitate.py
      three links, in little more than a minute
  python train/imitate.py --env pbd_gym:PBDDoublePendulum-v0 --seed 1
  python train/imitate.py --seconds 3 --no-video
      a slower swing-up
  python train/evaluate.py runs/PBDTriplePendulum-v0-imitate-0

files in the run's folder:
  config.yml           model and versions             imitation.yml        how it was made
  model.zip            PPO of stable-baselines3       learning_curve.png   and .csv
  evaluation.json      policy, fresh episodes         video.mp4            policy at work

Ctrl-C ends the training and keeps the policy that is there. Models are pickles: loading one can run
any code, so load only your own.
"""


def build_parser() -> argparse.ArgumentParser:
    """Describe the options."""
    parser = sparse_parser(__doc__, EXAMPLES)
    add = parser.add_argument
    add("--env", metavar="ID", help=f"environment, a pendulum (default: {DEFAULT_ENV})")
    add(
        "--env-kwargs",
        nargs="+",
        action=StoreKeyValues,
        metavar="KEY:VALUE",
        help="arguments of the environment",
    )
    add("--seed", type=int, help="of first guesses, network and worlds (default: 0)")
    add("--rounds", type=int, metavar="N", help="of motion and fitting (default: 12)")
    add("--updates", type=int, metavar="N", help="of the network in a round (default: 600)")
    add("--num-envs", type=int, metavar="N", help="worlds that move at once (default: 512)")
    add("--candidates", type=int, metavar="N", help="swing-ups that are tried (default: 16)")
    add("--iterations", type=int, metavar="N", help="improvements of each (default: 120)")
    add("--seconds", type=float, metavar="S", help="length of the swing-up (default: 2.5)")
    add("--eval-episodes", type=int, metavar="N", help="per evaluation (default: 100)")
    add(
        "--video",
        action=argparse.BooleanOptionalAction,
        help="film the final policy (default: yes)",
    )
    add("--log-dir", type=Path, help="folder of all runs (default: runs)")
    add("--threads", type=int, metavar="N", help="torch threads (default: 1)")
    add("--overwrite", action="store_true", help="replace a run of the same name")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return its exit status."""
    parser = build_parser()
    given = vars(parser.parse_args(arguments))
    film = given.pop("video", True)
    try:
        run, training = start_run(given, film)
    except SETTING_ERRORS as error:
        parser.error(str(error))
    config = training.config
    print(f"{config.env}, imitation, {config.num_envs} worlds -> {run.path}", flush=True)
    try:
        finished = training.learn(run)
    except (OSError, ValueError) as error:  # nowhere to write, or no swing-up found
        print(f"\n{error}", file=sys.stderr)
        return 1
    if not finished:
        print(f"\nInterrupted; {'the policy is kept.' if run.model.exists() else 'no policy yet.'}")
        return 130  # what a shell reports for Ctrl-C
    print(f"{training.steps:,} steps in {training.curve.elapsed:.1f} s")
    finish(run, config, video=film)
    return 0


def start_run(given: dict[str, Any], film: bool) -> tuple[RunDirectory, ImitationTraining]:
    """Check the settings of a new run, build its training, and only then make its folder."""
    options = dict(given)
    overwrite, log_dir = options.pop("overwrite", False), options.pop("log_dir", Path("runs"))
    task, options["env"] = pendulum(options)
    from imitation_training import ImitationTraining, new_settings

    config, settings = new_settings(options)
    run = RunDirectory(log_dir / f"{config.env_name}-imitate-{config.seed}")
    run.check_free(overwrite)
    if film:
        check_video(run.video)
    training = ImitationTraining(config, task, settings)
    run.create_anew()
    save_config(run.config, config)
    settings.save(run.imitation)
    return run, training


def pendulum(options: dict[str, Any]) -> tuple[Pendulum, str]:
    """Return the task of the environment that the options name, and its id.

    Raises:
        ValueError: If it is no pendulum.
    """
    env_id = options.get("env", DEFAULT_ENV)
    env = gymnasium.make(env_id, **options.get("env_kwargs", {}))
    task = getattr(env.unwrapped, "task", None)
    env.close()
    if not isinstance(task, Pendulum):
        raise ValueError(f"{env_id} is no pendulum, and only those can be planned and regulated")
    return task, env_id


if __name__ == "__main__":
    sys.exit(main())

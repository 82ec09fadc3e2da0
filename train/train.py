"""Train PPO, SAC or CrossQ on an environment of pbd_gym, from the first step to the video.

Everything a run produces is in one folder, runs/<env>-<algo>-<seed>.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from arguments import StoreKeyValues, sparse_parser
from config import (
    DEFAULT_ENV,
    SETTING_ERRORS,
    TrainingConfig,
    installed_versions,
    load_config,
    new_config,
    save_config,
)
from finishing import finish
from pbd_gym.hyperparams import ALGORITHMS
from run_directory import RunDirectory
from video import check_video

if TYPE_CHECKING:  # torch takes seconds to import, which --help and wrong options need not wait for
    from training import Training

EXAMPLES = """\
examples:
  python train/train.py
      PPO on the rope with the shipped hyperparameters
  python train/train.py --env pbd_gym:PBDCloth-v0 --seed 1 --total-timesteps 3000000
  python train/train.py --algo sac --no-video
  python train/train.py --env-kwargs observation:keypoints --hyperparameters gamma:0.97 n_epochs:8
  python train/train.py --resume runs/PBDRope-v0-ppo-0
      go on where Ctrl-C, a crash or the end has left it, to the last bit
  python train/train.py --resume runs/PBDRope-v0-ppo-0 --total-timesteps 4000000
      train longer; a falling learning rate now falls to 0 at the new total

files in the run's folder:
  config.yml           all settings and versions      checkpoint.pkl       exact state for --resume
  best_model.zip       best periodic evaluation       model.zip            the last model
  learning_curve.png   and .csv                       evaluations.npz      every evaluation episode
  evaluation.json      final policy, fresh episodes   video.mp4            final policy at work
  tensorboard/         tensorboard --logdir runs

Checkpoints and models are pickles: loading one can run any code, so load only your own.
"""

# The rest of a run's settings is fixed when it starts.
RESUME_OPTIONS = ("resume", "total_timesteps", "video")


def build_parser() -> argparse.ArgumentParser:
    """Describe the options."""
    parser = sparse_parser(__doc__, EXAMPLES)
    task = parser.add_argument_group("what to train")
    task.add_argument("--env", metavar="ID", help=f"environment (default: {DEFAULT_ENV})")
    task.add_argument(
        "--env-kwargs",
        nargs="+",
        action=StoreKeyValues,
        metavar="KEY:VALUE",
        help="arguments of the environment, over those of the hyperparameter file",
    )
    task.add_argument(
        "--train-env-kwargs",
        nargs="+",
        action=StoreKeyValues,
        metavar="KEY:VALUE",
        help="the same for the worlds that train alone, not for those that evaluate or are filmed",
    )
    task.add_argument("--algo", choices=ALGORITHMS, help="algorithm (default: ppo)")
    task.add_argument(
        "--hyperparameters",
        nargs="+",
        action=StoreKeyValues,
        metavar="KEY:VALUE",
        help="arguments of the algorithm, over those of pbd_gym/hyperparams/<algo>.yml",
    )
    task.add_argument("--seed", type=int, help="of the model and, derived, of all worlds (0)")
    task.add_argument(
        "--total-timesteps",
        type=int,
        metavar="N",
        help="environment steps, counted over all worlds (default: n_timesteps of the file)",
    )
    task.add_argument(
        "--num-envs", type=int, metavar="N", help="worlds (default: n_envs of the file)"
    )

    watch = parser.add_argument_group("what to write while it trains")
    watch.add_argument(
        "--eval-freq",
        type=int,
        metavar="N",
        help="steps between deterministic evaluations, 0 for none (default: a 20th of all)",
    )
    watch.add_argument(
        "--eval-episodes",
        type=int,
        metavar="N",
        help="fresh episodes per evaluation, all at once (default: 100)",
    )
    watch.add_argument(
        "--checkpoint-freq",
        type=int,
        metavar="N",
        help="steps between checkpoints, 0 for start and end only (default: a 10th of all)",
    )
    watch.add_argument(
        "--video",
        action=argparse.BooleanOptionalAction,
        help="film the final policy (default: yes)",
    )
    watch.add_argument("--log-dir", type=Path, help="folder of all runs (default: runs)")

    run = parser.add_argument_group("how to run it")
    run.add_argument("--device", help="cpu, cuda or auto; for small networks cpu wins (cpu)")
    run.add_argument(
        "--threads",
        type=int,
        metavar="N",
        help="torch threads (default: 1; on a busy machine two can be ten times slower)",
    )
    exists = run.add_mutually_exclusive_group()
    exists.add_argument(
        "--resume",
        type=Path,
        metavar="RUN_DIR",
        help="continue this run exactly; only --total-timesteps and --video can change",
    )
    exists.add_argument("--overwrite", action="store_true", help="replace a run of the same name")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return its exit status."""
    parser = build_parser()
    given = vars(parser.parse_args(arguments))
    try:
        run, config, training = (resume_run if "resume" in given else start_run)(given)
        save_config(run.config, config)
    except SETTING_ERRORS as error:
        parser.error(str(error))
    print(f"{config.env}, {config.algo}, {config.num_envs} worlds -> {run.path}", flush=True)
    try:
        finished = training.learn(run)
        training.close()
        if finished:
            steps, seconds = training.model.num_timesteps, training.curve.seconds
            print(f"{steps:,} steps in {seconds:.1f} s, {steps / seconds:,.0f} steps/s")
            finish(run, config, video=given.get("video", True))
            return 0
        print("\nInterrupted, the training is saved.")
        status = 130  # what a shell reports for Ctrl-C
    except OSError as error:
        print(f"\ncannot write to {run.path}: {error}", file=sys.stderr)
        status = 1
    if run.checkpoint.exists():
        print(f"Continue with:\n  {sys.executable} {sys.argv[0]} --resume {run.path}")
    return status


def start_run(given: dict[str, Any]) -> tuple[RunDirectory, TrainingConfig, Training]:
    """Check the settings of a new run, build its training, and only then make its folder."""
    options = dict(given)
    overwrite = options.pop("overwrite", False)
    log_dir = options.pop("log_dir", Path("runs"))
    film = options.pop("video", True)
    config = new_config(options)
    run = RunDirectory(log_dir / f"{config.env_name}-{config.algo}-{config.seed}")
    run.check_free(overwrite)
    if film:
        check_video(run.video)

    from training import Training

    training = Training(config)
    run.create_anew()
    return run, config, training


def resume_run(given: dict[str, Any]) -> tuple[RunDirectory, TrainingConfig, Training]:
    """Rebuild a training from its last checkpoint."""
    fixed = sorted(set(given) - set(RESUME_OPTIONS))
    if fixed:
        names = ", ".join(f"--{name.replace('_', '-')}" for name in fixed)
        raise ValueError(f"{names} cannot be given with --resume: a run keeps its settings")
    run = RunDirectory(given["resume"])
    run.check_resumable()
    if given.get("video", True):
        check_video(run.video)
    config, versions = load_config(run.config)
    config = replace(config, total_timesteps=given.get("total_timesteps", config.total_timesteps))
    changed = [
        name for name, version in installed_versions().items() if versions.get(name) != version
    ]
    if changed:
        print(f"other versions than at the start, bits may differ: {', '.join(changed)}")

    from checkpoint import load_checkpoint
    from training import Training

    checkpoint = load_checkpoint(run.checkpoint)
    if config.total_timesteps < checkpoint["num_timesteps"]:
        raise ValueError(
            f"--total-timesteps must be at least {checkpoint['num_timesteps']}, the steps that "
            f"{run.path} has already, got {config.total_timesteps}"
        )
    return run, config, Training(config, checkpoint)


if __name__ == "__main__":
    sys.exit(main())

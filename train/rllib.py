"""Train RLlib's PPO on native batches, in one process, on all cores, or on a Ray cluster.

Ray lives in a virtual environment of its own: `make rllib-smoke` makes .venv-rllib. Everything a
run produces is in one folder, runs/<env>-rllib-<seed>.
"""

# Types are checked in .venv, which has no Ray.
# pyright: reportMissingImports=false

from __future__ import annotations

import argparse
import csv
import dataclasses
import logging
import os
import shutil
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import gymnasium
import yaml

from arguments import StoreKeyValues, sparse_parser
from config import DEFAULT_ENV, check_at_least, check_registered
from files import write_atomically
from interrupt import InterruptRequest
from pbd_gym.hyperparams import load_hyperparameters
from run_directory import RunDirectory

EXAMPLES = """\
examples:
  python train/rllib.py --env pbd_gym:PBDPendulum-v0 --num-env-runners 2
      on this machine: two processes that step worlds, and the learner's
  ray start --head --port 6379                    on one machine, and
  ray start --address <its IP address>:6379       on every other, then on any of them
  python train/rllib.py --address auto --num-env-runners 30 --num-envs 3840
  python train/rllib.py --resume runs/PBDRope-v0-rllib-0 --address auto --num-env-runners 8
      go on from the last checkpoint, with as many env runners as there are now

files in the run's folder:
  config.yml    all settings          checkpoint-<steps>/   the last state, for --resume
  progress.csv  every iteration

A machine may fail or join while the training runs: lost env runners are restarted where there is
room. Checkpoints are pickles: loading one can run any code, so load only your own.
"""

# What a wrong setting, a missing package or a missing cluster may raise at the start.
START_ERRORS = (ValueError, TypeError, OSError, ImportError, gymnasium.error.Error)
# The rest of a run's settings is fixed when it starts.
RESUME_OPTIONS = frozenset({"resume", "total_timesteps", "num_env_runners", "address"})


@dataclass(frozen=True)
class RllibConfig:
    """Settings of one run."""

    total_timesteps: int
    num_envs: int  # over all env runners
    checkpoint_freq: int  # [steps]
    env: str = DEFAULT_ENV
    seed: int = 0
    num_env_runners: int = 1
    env_kwargs: dict[str, Any] = field(default_factory=dict)
    hyperparameters: dict[str, Any] = field(default_factory=dict)  # over those of the file

    def __post_init__(self) -> None:
        for name in ("seed", "num_env_runners"):
            check_at_least(name, getattr(self, name), 0)
        for name in ("total_timesteps", "num_envs", "checkpoint_freq"):
            check_at_least(name, getattr(self, name), 1)
        check_registered(self.env)


def new_config(given: dict[str, Any]) -> RllibConfig:
    """Complete what the user gave with the hyperparameter file and the defaults."""
    file = load_hyperparameters("ppo", given.get("env", DEFAULT_ENV))
    total = given.get("total_timesteps", file["n_timesteps"])
    sizes = {
        "total_timesteps": total,
        "num_envs": file["n_envs"],
        "checkpoint_freq": max(total // 20, 1),
    }
    return RllibConfig(**(sizes | given))


def build_parser() -> argparse.ArgumentParser:
    """Describe the options."""
    parser = sparse_parser(__doc__, EXAMPLES)
    add = parser.add_argument
    add("--env", metavar="ID", help=f"environment (default: {DEFAULT_ENV})")
    for name, text in (
        ("--env-kwargs", "arguments of the environment, over those of the hyperparameter file"),
        ("--hyperparameters", "arguments of PPO, over those of pbd_gym/hyperparams/ppo.yml"),
    ):
        add(name, nargs="+", action=StoreKeyValues, metavar="KEY:VALUE", help=text)
    for name, text in (
        ("--seed", "of the networks and, derived, of all worlds (default: 0)"),
        ("--total-timesteps", "environment steps over all worlds (default: that of the file)"),
        ("--num-envs", "worlds over all env runners (default: n_envs of the file)"),
        ("--num-env-runners", "processes that step worlds (1); 0: none beside the learner"),
        ("--checkpoint-freq", "steps between checkpoints (default: a 20th of all)"),
    ):
        add(name, type=int, metavar="N", help=text)
    add("--address", help="of a running cluster: host:port, or auto (default: start Ray here)")
    add("--log-dir", type=Path, help="folder of all runs (default: runs)")
    add("--resume", type=Path, metavar="RUN_DIR", help="continue this run from its checkpoint")
    add("--overwrite", action="store_true", help="replace a run of the same name")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return its exit status."""
    parser = build_parser()
    given = vars(parser.parse_args(arguments))
    address = given.pop("address", None)
    try:
        run, config, checkpoint = (resume_run if "resume" in given else start_run)(given)
        algorithm = build(config, address)
        if checkpoint is None:
            run.create_anew()
        else:
            algorithm.restore_from_path(str(checkpoint.absolute()))
        save_config(run, config)
    except START_ERRORS as error:
        parser.error(str(error))
    print(f"{config.env}, {config.num_envs} worlds, {config.num_env_runners} env runners", end="")
    print(f" -> {run.path}", flush=True)
    try:
        finished = learn(algorithm, run, config, steps_of(checkpoint))
    except OSError as error:
        print(f"\ncannot write to {run.path}: {error}", file=sys.stderr)
        return 1
    finally:
        algorithm.stop()
    if finished:
        return 0
    print("Interrupted, the training is saved. Continue with:")
    print(f"  {sys.executable} {sys.argv[0]} --resume {run.path}")
    return 130  # what a shell reports for Ctrl-C


def start_run(given: dict[str, Any]) -> tuple[RunDirectory, RllibConfig, None]:
    """Check the settings of a new run; nothing is written yet."""
    options = dict(given)
    overwrite, log_dir = options.pop("overwrite", False), options.pop("log_dir", Path("runs"))
    config = new_config(options)
    run = RunDirectory(log_dir / f"{config.env.split(':')[-1]}-rllib-{config.seed}")
    run.check_free(overwrite)
    return run, config, None


def resume_run(given: dict[str, Any]) -> tuple[RunDirectory, RllibConfig, Path]:
    """Find the settings and the last checkpoint of a run."""
    fixed = sorted(set(given) - RESUME_OPTIONS)
    if fixed:
        names = ", ".join(f"--{name.replace('_', '-')}" for name in fixed)
        raise ValueError(f"{names} cannot be given with --resume: a run keeps its settings")
    options = dict(given)
    run = RunDirectory(options.pop("resume"))
    checkpoints = sorted(run.path.glob("checkpoint-*"))
    if not (run.config.exists() and checkpoints):
        raise FileNotFoundError(f"cannot resume {run.path}: it has no config.yml or no checkpoint")
    saved = yaml.safe_load(run.config.read_text(encoding="utf-8"))
    return run, RllibConfig(**(saved | options)), checkpoints[-1]


def build(config: RllibConfig, address: str | None) -> Any:
    """Build the algorithm, on a cluster or on this machine."""
    from pbd_gym.rllib import make_ppo_config, make_rllib_vec_env

    # Wrong arguments are found here, and not by some env runner far away.
    make_rllib_vec_env({"id": config.env, "num_envs": 1, **config.env_kwargs}).close()
    sizes = {"n_timesteps": config.total_timesteps, "n_envs": config.num_envs}
    ppo = make_ppo_config(
        config.env,
        num_env_runners=config.num_env_runners,
        seed=config.seed,
        env_kwargs=config.env_kwargs,
        **(config.hyperparameters | sizes),
    )
    connect(config.num_env_runners, address)
    return ppo.build_algo()


def connect(num_env_runners: int, address: str | None) -> None:
    """Connect to a cluster, or start Ray on this machine."""
    import ray
    import torch

    torch.set_num_threads(1)  # small networks: more threads only wait for each other
    quiet: dict[str, Any] = {"log_to_driver": False, "logging_level": logging.ERROR}
    if address is None:
        processors = max(os.cpu_count() or 1, num_env_runners)
        ray.init("local", num_cpus=processors, include_dashboard=False, **quiet)
        return
    ray.init(address, **quiet)
    there = int(ray.cluster_resources().get("CPU", 0))
    if there < num_env_runners:
        print(f"{there} processors for {num_env_runners} env runners: waiting for more", flush=True)


def save_config(run: RunDirectory, config: RllibConfig) -> None:
    """Write the settings as YAML."""
    with write_atomically(run.config) as file:
        file.write(yaml.safe_dump(dataclasses.asdict(config), sort_keys=False).encode())


def learn(algorithm: Any, run: RunDirectory, config: RllibConfig, steps: int) -> bool:
    """Train up to the configured total; return False when an interrupt has ended it early."""
    save_checkpoint(algorithm, run, steps)  # a full disk is found before hours are spent
    saved, begun = steps, time.monotonic()
    with InterruptRequest() as interrupt, (run.path / "progress.csv").open("a") as file:
        rows = csv.writer(file, lineterminator="\n")
        if steps == 0:
            rows.writerow(("timesteps", "seconds", "mean_return", "success_rate", "env_runners"))
        while steps < config.total_timesteps and not interrupt.requested:
            before, start = steps, time.monotonic()
            result = algorithm.train()
            steps = int(result.get("num_env_steps_sampled_lifetime", steps))
            seen = result.get("env_runners", {})  # empty while no env runner lives
            rate = (steps - before) / (time.monotonic() - start)
            returns, success = seen.get("episode_return_mean"), seen.get("success_rate")
            healthy = algorithm.env_runner_group.num_healthy_remote_workers()
            rows.writerow((steps, f"{time.monotonic() - begun:.1f}", returns, success, healthy))
            file.flush()
            print(
                f"{steps:>12,} steps {rate:>8,.0f} steps/s   return {_shown(returns)}   "
                f"success {_shown(success)}   env runners {healthy} of {config.num_env_runners}",
                flush=True,
            )
            if steps - saved >= config.checkpoint_freq:
                save_checkpoint(algorithm, run, steps)
                saved = steps
    save_checkpoint(algorithm, run, steps)
    return not interrupt.requested


def save_checkpoint(algorithm: Any, run: RunDirectory, steps: int) -> None:
    """Write a checkpoint beside the last one, and only then remove that."""
    partial, whole = run.path / "partial", run.path / f"checkpoint-{steps:012}"
    if whole.exists():
        return
    shutil.rmtree(partial, ignore_errors=True)  # left by a kill
    try:
        algorithm.save_to_path(str(partial.absolute()))
        partial.rename(whole)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    for older in set(run.path.glob("checkpoint-*")) - {whole}:
        shutil.rmtree(older)


def steps_of(checkpoint: Path | None) -> int:
    """Return the steps that a checkpoint has in its name."""
    return 0 if checkpoint is None else int(checkpoint.name.rpartition("-")[2])


def _shown(value: float | None) -> str:
    return "     -" if value is None else f"{value:6.2f}"


if __name__ == "__main__":
    sys.exit(main())

"""Compare policies: run every environment, policy and seed, then write table, CSV and figures.

What is done already is skipped and a training that was cut off goes on, so the command can be
stopped and given again at any time. It takes hours; `--env`, `--policy` and `--seeds` choose less.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from arguments import HelpFormatter
from cells import COMPARED, ENVIRONMENTS, POLICIES, Cell
from comparison import around_marks, report
from policies import BASELINES

SCRIPTS = Path(__file__).parent

EXAMPLES = """\
examples:
  python train/benchmark.py
  python train/benchmark.py --jobs 2
  python train/benchmark.py --env PBDRope-v0 PBDCloth-v0 --policy scripted ppo --seeds 3
  python train/benchmark.py --report-only
      table and figures from the results that are there
"""


def build_parser() -> argparse.ArgumentParser:
    """Describe the options."""
    parser = argparse.ArgumentParser(
        description=__doc__, epilog=EXAMPLES, formatter_class=HelpFormatter
    )
    parser.add_argument(
        "--env", nargs="+", choices=ENVIRONMENTS, default=ENVIRONMENTS, metavar="ID"
    )
    parser.add_argument("--policy", nargs="+", choices=POLICIES, default=POLICIES, metavar="NAME")
    parser.add_argument("--seeds", type=int, default=5, metavar="N", help="(default: 5)")
    parser.add_argument(
        "--episodes",
        type=int,
        default=100,
        metavar="N",
        help="per seed of a policy that is not trained (default: 100, as after a training)",
    )
    parser.add_argument(
        "--planner-episodes",
        type=int,
        default=10,
        metavar="N",
        help="per seed of the planner, which thinks long (default: 10)",
    )
    parser.add_argument(
        "--total-timesteps", type=int, metavar="N", help="of each training (by the environment)"
    )
    parser.add_argument(
        "--jobs",
        type=int,
        default=1,
        metavar="N",
        help="processes at once, each on its share of the cores (default: %(default)s)",
    )
    parser.add_argument(
        "--log-dir", type=Path, default=Path("runs/baselines"), help="of all runs (%(default)s)"
    )
    parser.add_argument(
        "--results",
        type=Path,
        default=Path("docs/results"),
        help="of table, CSV and figures (%(default)s)",
    )
    parser.add_argument(
        "--readme",
        type=Path,
        metavar="FILE",
        help="put the table between this file's <!-- baselines --> and <!-- /baselines -->",
    )
    parser.add_argument(
        "--report-only", action="store_true", help="run nothing, write what there is"
    )
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return its exit status."""
    parser = build_parser()
    options = parser.parse_args(arguments)
    for name in ("seeds", "episodes", "planner_episodes", "jobs"):
        if getattr(options, name) < 1:
            parser.error(f"--{name.replace('_', '-')} must be at least 1")
    cells = [
        Cell(env, policy, seed)
        for env in options.env
        for policy in options.policy
        for seed in range(options.seeds)
        if env in COMPARED.get(policy, ENVIRONMENTS)
    ]
    try:
        if options.readme is not None:
            around_marks(options.readme)  # now, not after hours
        options.results.mkdir(parents=True, exist_ok=True)
        options.log_dir.mkdir(parents=True, exist_ok=True)
        if not options.report_only:
            run_all(cells, options)
        print(report(cells, options.log_dir, options.results, options.readme))
    except (OSError, ValueError) as error:
        parser.error(str(error))
    except KeyboardInterrupt:
        print("\nStopped; the same command goes on from here.")
        return 130
    return 0


def run_all(cells: Sequence[Cell], options: argparse.Namespace) -> None:
    """Run the cells that are not done, some at once."""
    missing = [cell for cell in cells if not cell.done(options.log_dir)]
    began = time.monotonic()

    def run(number: int, cell: Cell) -> None:
        minutes = (time.monotonic() - began) / 60
        place = f"[{number}/{len(missing)}, {minutes:.0f} min]"
        print(f"{place} {cell.env} {cell.policy} {cell.seed}", flush=True)
        # progress bars of several processes would overwrite each other
        run_script(command(cell, options), quiet=options.jobs > 1)

    shares = iter(shares_of_cores(options.jobs))
    pool = ThreadPoolExecutor(options.jobs, initializer=lambda: keep_to(next(shares)))
    try:
        for done in as_completed([pool.submit(run, *job) for job in enumerate(missing, start=1)]):
            done.result()
    finally:
        pool.shutdown(cancel_futures=True)
    print(f"{len(missing)} runs in {(time.monotonic() - began) / 60:.0f} min", flush=True)


def run_script(script: list[str], *, quiet: bool) -> None:
    """Run a script in a process of its own; raise ValueError with what it says if it fails."""
    done = subprocess.run([sys.executable, *script], capture_output=quiet, text=True, check=False)
    if done.returncode:
        said = f":\n{done.stderr[-2000:]}" if quiet else ""
        raise ValueError(f"{' '.join(script)} ended with {done.returncode}{said}")


def shares_of_cores(jobs: int) -> list[set[int]]:
    """Return the cores that each of some jobs may use, no fewer than one."""
    cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else [0]
    return [set(cores[job % len(cores) :: jobs]) for job in range(jobs)]


def keep_to(cores: set[int]) -> None:
    """Keep this thread, and the processes it starts, to some cores, where that can be said."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, cores)


def command(cell: Cell, options: argparse.Namespace) -> list[str]:
    """Return the script and its arguments that do a cell, or do the rest of it."""
    env, run = f"pbd_gym:{cell.env}", cell.run(options.log_dir)
    if cell.policy in BASELINES:
        episodes = options.planner_episodes if cell.policy == "planner" else options.episodes
        # seeds are those of worlds, seed + i: a thousand apart no two cells share one
        seed, file = 1000 * cell.seed, run.evaluation
        run.path.mkdir(exist_ok=True)
        script = [str(SCRIPTS / "evaluate.py"), cell.policy, "--env", env, "--json", str(file)]
        return [*script, "--episodes", str(episodes), "--seed", str(seed)]
    new = ["--no-video", "--env", env, "--seed", str(cell.seed), "--log-dir", str(options.log_dir)]
    new += ["--overwrite"] if run.config.exists() else []
    if cell.policy == "imitate":
        return [str(SCRIPTS / "imitate.py"), *new]
    script = [str(SCRIPTS / "train.py")]
    if run.checkpoint.exists():
        return [*script, "--no-video", "--resume", str(run.path)]
    script += [*new, "--algo", cell.policy]
    if options.total_timesteps is not None:
        script += ["--total-timesteps", str(options.total_timesteps)]
    return script


if __name__ == "__main__":
    sys.exit(main())

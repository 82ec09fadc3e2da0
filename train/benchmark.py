"""Compare policies: run every environment, policy and seed, then write table, CSV and figures.

What is done already is skipped and a training that was cut off goes on, so the command can be
stopped and given again at any time. It takes hours; `--env`, `--policy` and `--seeds` choose less.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from arguments import HelpFormatter
from curve_figures import draw_curves
from curves import Point, read_csv
from files import write_atomically
from pbd_gym.hyperparams import ALGORITHMS
from policies import BASELINES
from run_directory import RunDirectory
from scores import Score, overall_table, read_scores, table, write_scores

ENVIRONMENTS = (
    "PBDPendulum-v0",
    "PBDDoublePendulum-v0",
    "PBDTriplePendulum-v0",
    "PBDRope-v0",
    "PBDCloth-v0",
)
# Where a policy is compared that is not compared everywhere: train/imitate.py plans and regulates
# pendulums alone, and CrossQ stands beside SAC where it learns faster.
COMPARED = {"imitate": ENVIRONMENTS[:3], "crossq": ("PBDRope-v0",)}
TRAINED = (*ALGORITHMS, "imitate")
POLICIES = (*BASELINES, *TRAINED)
SCRIPTS = Path(__file__).parent
MARKS = "<!-- baselines -->", "<!-- /baselines -->"

EXAMPLES = """\
examples:
  python train/benchmark.py
  python train/benchmark.py --jobs 2
  python train/benchmark.py --env PBDRope-v0 PBDCloth-v0 --policy scripted ppo --seeds 3
  python train/benchmark.py --report-only
      table and figures from the results that are there
"""


@dataclass(frozen=True)
class Cell:
    """One environment, policy and seed."""

    env: str
    policy: str
    seed: int


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
        report(cells, options)
    except (OSError, ValueError) as error:
        parser.error(str(error))
    except KeyboardInterrupt:
        print("\nStopped; the same command goes on from here.")
        return 130
    return 0


def run_all(cells: Sequence[Cell], options: argparse.Namespace) -> None:
    """Run the cells that are not done, some at once."""
    missing = [cell for cell in cells if not result_of(cell, options.log_dir).exists()]
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
    env = f"pbd_gym:{cell.env}"
    if cell.policy in BASELINES:
        episodes = options.planner_episodes if cell.policy == "planner" else options.episodes
        # seeds are those of worlds, seed + i: a thousand apart no two cells share one
        seed, file = 1000 * cell.seed, result_of(cell, options.log_dir)
        file.parent.mkdir(exist_ok=True)
        script = [str(SCRIPTS / "evaluate.py"), cell.policy, "--env", env, "--json", str(file)]
        return [*script, "--episodes", str(episodes), "--seed", str(seed)]
    run = RunDirectory(options.log_dir / f"{cell.env}-{cell.policy}-{cell.seed}")
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


def result_of(cell: Cell, log_dir: Path) -> Path:
    """Return the file that a cell that is done has left."""
    return RunDirectory(log_dir / f"{cell.env}-{cell.policy}-{cell.seed}").evaluation


def report(cells: Sequence[Cell], options: argparse.Namespace) -> None:
    """Write the scores of all cells that are done; those of others stay in the CSV as they are."""
    file = options.results / "baselines.csv"
    scores = {_key(score): score for score in (read_scores(file) if file.exists() else [])}
    done = [cell for cell in cells if result_of(cell, options.log_dir).exists()]
    scores |= {(cell.env, cell.policy, cell.seed): score_of(cell, options.log_dir) for cell in done}
    ordered = sorted(scores.values(), key=_place)
    write_scores(file, ordered)
    for env in options.env:
        curves = dict(_curves(env, done, options.log_dir))
        if curves:
            levels = [score for score in ordered if score.env == env]
            draw_curves(options.results / f"{env}.png", env, curves, levels)
    print(table(ordered), "", overall_table(ordered), sep="\n")
    if options.readme is not None:
        put_into(options.readme, table(ordered))


def around_marks(readme: Path) -> tuple[str, str]:
    """Return what stands before and after the table, marks included."""
    head, _, rest = readme.read_text(encoding="utf-8").partition(MARKS[0])
    _, mark, tail = rest.partition(MARKS[1])
    if not mark:
        raise ValueError(f"{readme} has no {MARKS[0]} ... {MARKS[1]} to put the table between")
    return head + MARKS[0], MARKS[1] + tail


def put_into(readme: Path, text: str) -> None:
    """Replace what stands between the marks of the table."""
    before, after = around_marks(readme)
    with write_atomically(readme) as file:
        file.write(f"{before}\n{text}\n{after}".encode())


def score_of(cell: Cell, log_dir: Path) -> Score:
    """Read what a cell has left."""
    file = result_of(cell, log_dir)
    summary = json.loads(file.read_text(encoding="utf-8"))
    return Score(
        cell.env,
        cell.policy,
        cell.seed,
        summary["episodes"],
        summary["success_rate"]["mean"],
        summary["normalized_performance"]["mean"],
        summary["return"]["mean"],
        *_training_of(RunDirectory(file.parent)),
    )


def _training_of(run: RunDirectory) -> tuple[float, ...]:
    """Return steps and seconds of a training, and those until it succeeded; nan if none was."""
    if not run.curve_table.exists():
        return (math.nan,) * 5
    points = read_csv(run.curve_table).evaluations
    first, second = (_first(points, rate) for rate in (0.9, 0.95))
    return (points[-1].timesteps, points[-1].seconds, first[0], first[1], second[1])


def _first(points: Sequence[Point], rate: float) -> tuple[float, float]:
    """Return steps and seconds of the first evaluation with at least this success rate."""
    reached = (point for point in points if point.success_rate >= rate)
    point = next(reached, None)
    return (point.timesteps, point.seconds) if point else (math.inf, math.inf)


def _curves(env: str, done: Sequence[Cell], log_dir: Path) -> Iterator[tuple[str, list[Any]]]:
    for algorithm in TRAINED:
        runs = [cell for cell in done if (cell.env, cell.policy) == (env, algorithm)]
        tables = [RunDirectory(result_of(run, log_dir).parent).curve_table for run in runs]
        if tables:
            yield algorithm, [read_csv(file).evaluations for file in tables]


def _key(score: Score) -> tuple[str, str, int]:
    return score.env, score.policy, score.seed


def _place(score: Score) -> tuple[int, int, int]:
    return ENVIRONMENTS.index(score.env), POLICIES.index(score.policy), score.seed


if __name__ == "__main__":
    sys.exit(main())

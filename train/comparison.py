"""What a benchmark has found so far: CSV, figures, and the table in the README."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path

from cells import ENVIRONMENTS, POLICIES, TRAINED, Cell
from curve_figures import Curves, draw_curves, draw_overview
from curves import Point, read_csv
from files import write_atomically
from run_directory import RunDirectory
from scores import Score, overall_table, read_scores, table, write_scores

MARKS = "<!-- baselines -->", "<!-- /baselines -->"


def report(cells: Sequence[Cell], log_dir: Path, results: Path, readme: Path | None) -> str:
    """Write the scores of all cells that are done; those of others stay in the CSV as they are.

    Args:
        cells: What was compared.
        log_dir: Of all runs.
        results: Folder of baselines.csv, a figure for each environment, and one of all.
        readme: Where the table goes between the marks; None for nowhere.

    Returns:
        The table, and performances over all environments.
    """
    file = results / "baselines.csv"
    done = [cell for cell in cells if cell.done(log_dir)]
    known = read_scores(file) if file.exists() else []
    scores = {(score.env, score.policy, score.seed): score for score in known}
    scores |= {(cell.env, cell.policy, cell.seed): score_of(cell, log_dir) for cell in done}
    ordered = sorted(scores.values(), key=_place)
    write_scores(file, ordered)
    curves = {env: _curves(env, done, log_dir) for env in ENVIRONMENTS}
    curves = {env: algorithms for env, algorithms in curves.items() if algorithms}
    for env, algorithms in curves.items():
        levels = [score for score in ordered if score.env == env]
        draw_curves(results / f"{env}.png", env, algorithms, levels)
    if len(curves) > 1:
        draw_overview(results / "success.png", curves)
    if readme is not None:
        put_into(readme, table(ordered))
    return f"{table(ordered)}\n\n{overall_table(ordered)}"


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
    run = cell.run(log_dir)
    summary = json.loads(run.evaluation.read_text(encoding="utf-8"))
    return Score(
        cell.env,
        cell.policy,
        cell.seed,
        summary["episodes"],
        summary["success_rate"]["mean"],
        summary["normalized_performance"]["mean"],
        summary["return"]["mean"],
        *_training_of(run),
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


def _curves(env: str, done: Sequence[Cell], log_dir: Path) -> Curves:
    """Return the evaluations of each seed of what was trained in an environment."""
    files = {
        algorithm: [
            cell.run(log_dir).curve_table
            for cell in done
            if (cell.env, cell.policy) == (env, algorithm)
        ]
        for algorithm in TRAINED
    }
    return {
        algorithm: [read_csv(file).evaluations for file in tables]
        for algorithm, tables in files.items()
        if tables
    }


def _place(score: Score) -> tuple[int, int, int]:
    return ENVIRONMENTS.index(score.env), POLICIES.index(score.policy), score.seed

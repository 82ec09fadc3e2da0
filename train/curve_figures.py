"""Learning curves of several seeds in one figure: medians with bands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from curves import Point
from files import write_atomically
from scores import Score

# Evaluations of each seed by algorithm.
Curves = Mapping[str, Sequence[Sequence[Point]]]

_COLORS = {"ppo": "#0072b2", "sac": "#d55e00", "crossq": "#56b4e9", "imitate": "#cc79a7"}
_NAMES = {"ppo": "PPO", "sac": "SAC", "crossq": "CrossQ", "imitate": "imitation"}
_LEVELS = {"scripted": ("#009e73", "--"), "planner": ("#7f5aa2", ":"), "random": ("#888888", "-.")}


def draw_curves(path: Path, title: str, curves: Curves, scores: Sequence[Score]) -> None:
    """Draw success rate and return against steps and wall time as a PNG.

    Args:
        path: Of the PNG.
        title: Above the figure.
        curves: The line is the median over the seeds, the band reaches from the least to the
            greatest.
        scores: Of the same environment; untrained policies are drawn as levels.
    """
    from matplotlib.figure import Figure
    from matplotlib.ticker import EngFormatter

    figure = Figure(figsize=(10, 6), layout="constrained")
    axes = figure.subplots(2, 2, sharex="col", sharey="row")
    figure.suptitle(title)
    for row, (quantity, label) in enumerate(
        (("success_rate", "success rate"), ("mean_return", "episode return"))
    ):
        for column, clock in enumerate(("timesteps", "seconds")):
            axis = axes[row, column]
            for algorithm, runs in curves.items():
                _draw_band(axis, algorithm, runs, clock, quantity)
            for policy, (color, style) in _LEVELS.items():
                values = [getattr(score, quantity) for score in scores if score.policy == policy]
                if values:
                    level = float(np.mean(values))
                    axis.axhline(level, color=color, linestyle=style, linewidth=1.2, label=policy)
        axes[row, 0].set_ylabel(label)
    for column in axes.T:
        _scale_clock(column)
    axes[0, 0].set_ylim(-0.03, 1.03)
    axes[1, 0].set_xlabel("environment steps")
    axes[1, 0].xaxis.set_major_formatter(EngFormatter(sep=""))
    axes[1, 1].set_xlabel("wall time [s]")
    # a level may lie at either end of the success rate; below the figure nothing is in the way
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    with write_atomically(path) as file:
        figure.savefig(file, format="png", dpi=110)


def draw_overview(path: Path, curves: Mapping[str, Curves]) -> None:
    """Draw success rates against wall time, one panel per environment, as a PNG.

    Args:
        path: Of the PNG.
        curves: By environment. The line is the median over the seeds, the band reaches from the
            least to the greatest.
    """
    from matplotlib.figure import Figure

    columns = 3
    rows = -(-(len(curves) + 1) // columns)  # one place more, for the legend
    figure = Figure(figsize=(10, 2.6 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
    lines = {}
    for axis, (env, algorithms) in zip(axes, curves.items(), strict=False):
        for algorithm, runs in algorithms.items():
            lines[algorithm] = _draw_band(axis, algorithm, runs, "seconds", "success_rate")
        axis.set_title(env, fontsize=10)
        axis.tick_params(labelbottom=True)
    _scale_clock(axes[: len(curves)])
    axes[0].set_ylim(-0.03, 1.03)
    figure.supxlabel("wall time [s]", fontsize=10)
    figure.supylabel("success rate", fontsize=10)
    for axis in axes[len(curves) :]:
        axis.axis("off")
    names = [_NAMES[algorithm] for algorithm in lines]
    axes[len(curves)].legend(lines.values(), names, loc="center", frameon=False)
    with write_atomically(path) as file:
        figure.savefig(file, format="png", dpi=110)


def _scale_clock(axes: np.ndarray) -> None:
    """Give panels of one clock, which is logarithmic over more than a decade, their scale."""
    start = min(axis.dataLim.minposx for axis in axes)
    end = max(axis.dataLim.x1 for axis in axes)
    for axis in axes:
        # one algorithm may need a hundred times as long as another
        axis.set_xscale("log" if end > 10 * start else "linear")
        axis.xaxis.set_major_formatter("{x:g}")
        axis.grid(alpha=0.3)
        axis.spines[["top", "right"]].set_visible(False)


def _draw_band(
    axis: Any, algorithm: str, runs: Sequence[Sequence[Point]], clock: str, quantity: str
) -> Any:
    """Draw one algorithm and return its line.

    The seeds are interpolated at common times, as far as all of them ran. Until its first
    evaluation, which may come later than another seed's, a seed has its value.
    """
    times = [[getattr(point, clock) for point in run] for run in runs]
    values = [[getattr(point, quantity) for point in run] for run in runs]
    start, end = min(time[0] for time in times), min(time[-1] for time in times)
    grid = np.geomspace(start, end, 400)
    lines = [np.interp(grid, *pair) for pair in zip(times, values, strict=True)]
    color = _COLORS[algorithm]
    axis.fill_between(grid, np.min(lines, axis=0), np.max(lines, axis=0), color=color, alpha=0.2)
    label = f"{_NAMES[algorithm]}, {len(runs)} seed{'s' if len(runs) > 1 else ''}"
    return axis.plot(grid, np.median(lines, axis=0), color=color, linewidth=1.8, label=label)[0]

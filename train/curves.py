"""The learning curve: return and success against environment steps and wall time."""

from __future__ import annotations

import csv
import io
import time
from dataclasses import astuple, dataclass, field
from pathlib import Path
from typing import Any

from files import write_atomically

TRAINING_COLOR, EVALUATION_COLOR = "#7aa6c2", "#c8553d"


@dataclass(frozen=True)
class Point:
    """One place on the curve; success is nan where no episode has ended yet."""

    timesteps: int
    seconds: float  # of training so far, over all resumed parts
    mean_return: float
    success_rate: float


@dataclass
class LearningCurve:
    """Points of the exploring policy while it learns and of its deterministic evaluations."""

    training: list[Point] = field(default_factory=list)
    evaluations: list[Point] = field(default_factory=list)
    elapsed: float = 0.0  # [s] before the clock was started

    def start_clock(self) -> None:
        """Let the wall time run on from `elapsed`."""
        self._started = time.monotonic()

    @property
    def seconds(self) -> float:
        """Wall time of the training so far [s]."""
        return self.elapsed + time.monotonic() - self._started

    def stopped(self) -> LearningCurve:
        """Return a copy that can be stored and goes on later from the time it has now."""
        return LearningCurve(list(self.training), list(self.evaluations), self.seconds)


def write_csv(path: Path, curve: LearningCurve) -> None:
    """Write all points, one row each."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(("policy", "timesteps", "seconds", "mean_return", "success_rate"))
    rows.writerows(("exploring", *astuple(point)) for point in curve.training)
    rows.writerows(("deterministic", *astuple(point)) for point in curve.evaluations)
    with write_atomically(path) as file:
        file.write(text.getvalue().encode())


def read_csv(path: Path) -> LearningCurve:
    """Read back what `write_csv` wrote."""
    curve = LearningCurve()
    kinds = {"exploring": curve.training, "deterministic": curve.evaluations}
    with path.open(encoding="utf-8", newline="") as file:
        for policy, timesteps, *rest in list(csv.reader(file))[1:]:
            kinds[policy].append(Point(int(timesteps), *map(float, rest)))
    return curve


def plot_learning_curve(path: Path, curve: LearningCurve, title: str) -> None:
    """Draw the curve as a PNG: rows return and success, columns steps and wall time."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 6), layout="constrained")
    axes = figure.subplots(2, 2, sharex="col", sharey="row")
    figure.suptitle(title)
    for row, (quantity, label) in enumerate(
        (("mean_return", "episode return"), ("success_rate", "success rate"))
    ):
        for column, clock in enumerate(("timesteps", "seconds")):
            _draw(axes[row, column], curve, clock, quantity)
        axes[row, 0].set_ylabel(label)
    axes[1, 0].set_ylim(-0.03, 1.03)
    axes[1, 0].set_xlabel("environment steps")
    axes[1, 0].xaxis.set_major_formatter(lambda steps, _: _short(steps))
    axes[1, 1].set_xlabel("wall time [s]")
    axes[0, 0].legend(loc="best", frameon=False)
    with write_atomically(path) as file:
        figure.savefig(file, format="png", dpi=120)


def _draw(axis: Any, curve: LearningCurve, clock: str, quantity: str) -> None:
    for points, style in (
        (curve.training, {"color": TRAINING_COLOR, "label": "training, exploring"}),
        (
            curve.evaluations,
            {"color": EVALUATION_COLOR, "label": "evaluation, deterministic", "marker": "o"},
        ),
    ):
        axis.plot(
            [getattr(point, clock) for point in points],
            [getattr(point, quantity) for point in points],
            markersize=4,
            linewidth=1.5,
            **style,
        )
    axis.grid(alpha=0.3)
    axis.spines[["top", "right"]].set_visible(False)


def _short(steps: float) -> str:
    for unit, letter in ((1e6, "M"), (1e3, "k")):
        if steps >= unit:
            return f"{steps / unit:g}{letter}"
    return f"{steps:g}"

"""What the policies of a benchmark earned: one row per environment, policy and seed."""

from __future__ import annotations

import csv
import dataclasses
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from files import write_atomically
from intervals import Estimate

# Quartiles are cut off at either side of an interquartile mean.
_QUARTER = 0.25
_RESAMPLES = 10_000


@dataclass(frozen=True)
class Score:
    """Means over one seed's episodes, and what the training took; nan where nothing was trained.

    The times are of the training's own clock, which runs from its first step and includes the
    compilation of kernels and all evaluations.
    """

    env: str
    policy: str
    seed: int
    episodes: int
    success_rate: float
    normalized_performance: float
    mean_return: float
    timesteps: float
    seconds: float
    steps_to_90: float  # until an evaluation had a success rate of at least 0.9; inf if none had
    seconds_to_90: float
    seconds_to_95: float


def write_scores(path: Path, scores: Sequence[Score]) -> None:
    """Write one line per score."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(field.name for field in dataclasses.fields(Score))
    for score in scores:
        rows.writerow(f"{x:.6g}" if isinstance(x, float) else x for x in dataclasses.astuple(score))
    with write_atomically(path) as file:
        file.write(text.getvalue().encode())


def read_scores(path: Path) -> list[Score]:
    """Read back what `write_scores` wrote, to its six digits."""
    kinds = {"str": str, "int": int, "float": float}
    with path.open(encoding="utf-8", newline="") as file:
        return [
            Score(
                **{
                    field.name: kinds[str(field.type)](row[field.name])
                    for field in dataclasses.fields(Score)
                }
            )
            for row in csv.DictReader(file)
        ]


def interquartile_mean(*strata: np.ndarray) -> Estimate:
    """Estimate the interquartile mean of all values, with a stratified bootstrap interval.

    The statistic that R. Agarwal et al. 2021 ("Deep Reinforcement Learning at the Edge of the
    Statistical Precipice") recommend for few runs: the outer quarters are left out, and the
    percentile bootstrap resamples the runs of each stratum (environment) on their own.

    Args:
        *strata: Values of one environment's seeds each.
    """
    from scipy.stats import bootstrap, trim_mean

    def statistic(*samples: np.ndarray, axis: int = -1) -> np.ndarray:
        return trim_mean(np.concatenate(samples, axis=axis), _QUARTER, axis=axis)

    middle = float(statistic(*strata))
    if min(len(values) for values in strata) < 2:  # one run says nothing on the spread
        return Estimate(middle, float("nan"), float("nan"))
    interval = bootstrap(
        strata, statistic, n_resamples=_RESAMPLES, method="percentile", vectorized=True, rng=0
    ).confidence_interval
    return Estimate(middle, float(interval.low), float(interval.high))


def table(scores: Sequence[Score]) -> str:
    """Return markdown: one line per environment and policy, in the order in which they come."""
    head = ("environment", "policy", "success rate", "normalized performance", "return")
    head = (*head, "steps to 0.9", "time to 0.9", "time to 0.95")
    lines = ["| " + " | ".join(head) + " |", "|---|---|" + "---:|" * (len(head) - 2)]
    for env, policy in dict.fromkeys((score.env, score.policy) for score in scores):
        runs = [score for score in scores if (score.env, score.policy) == (env, policy)]
        cells = [
            _interval([score.success_rate for score in runs], "{:.2f}"),
            _interval([score.normalized_performance for score in runs], "{:.2f}"),
            _interval([score.mean_return for score in runs], "{:.1f}"),
            _median([score.steps_to_90 for score in runs], _thousands),
            _median([score.seconds_to_90 for score in runs], "{:.0f} s".format),
            _median([score.seconds_to_95 for score in runs], "{:.0f} s".format),
        ]
        lines.append(f"| `{env}` | {policy} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def overall_table(scores: Sequence[Score]) -> str:
    """Return markdown: each policy's normalized performance over all environments it was run in."""
    lines = ["| policy | normalized performance over all |", "|---|---:|"]
    for policy in dict.fromkeys(score.policy for score in scores):
        runs = [score for score in scores if score.policy == policy]
        strata = [
            np.array([score.normalized_performance for score in runs if score.env == env])
            for env in dict.fromkeys(score.env for score in runs)
        ]
        lines.append(f"| {policy} | {_text(interquartile_mean(*strata), '{:.2f}')} |")
    return "\n".join(lines)


def _interval(values: Sequence[float], form: str) -> str:
    return _text(interquartile_mean(np.array(values)), form)


def _text(estimate: Estimate, form: str) -> str:
    # adding zero makes a 0 of -0
    mean, low, high = (form.format(round(x, 2) + 0.0) for x in dataclasses.astuple(estimate))
    return mean if np.isnan(estimate.low) else f"{mean} [{low}, {high}]"


def _median(values: Sequence[float], form: Callable[[float], str]) -> str:
    """Return the median; inf, "not reached", where at least half of the seeds did not reach it."""
    if np.isnan(values).all():
        return ""
    middle = float(np.quantile(values, 0.5, method="higher"))
    return form(middle) if np.isfinite(middle) else "not reached"


def _thousands(steps: float) -> str:
    return f"{steps / 1e3:,.0f} k"

"""Repeated measurements, their table and their files, as all benchmarks here write them."""

from __future__ import annotations

import argparse
import csv
import statistics
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from machine import describe_machine

RESULTS = Path(__file__).parent / "results"


class Spread(NamedTuple):
    """Seconds of one call: median, least and greatest over the rounds."""

    median: float
    least: float
    greatest: float


def in_turn(
    calls: Mapping[Any, Callable[[int], Any]],
    rounds: int,
    seconds: float,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[Any, Spread]:
    """Time calls in turn, round after round, so that a busy moment hits all of them alike.

    Args:
        calls: Take the number of the call.
        rounds: How often each has its turn; one more to warm up.
        seconds: That a turn takes about, at least one call.
        clock: `time.thread_time` leaves out what other processes take from a single thread.
    """
    counts = dict.fromkeys(calls, 0)
    times: dict[Any, list[float]] = {name: [] for name in calls}
    for round_ in range(-1, rounds):
        for name, call in calls.items():
            begin, before = clock(), counts[name]
            while clock() - begin < seconds or counts[name] == before:
                call(counts[name])
                counts[name] += 1
            if round_ >= 0:
                times[name].append((clock() - begin) / (counts[name] - before))
    return {
        name: Spread(statistics.median(taken), min(taken), max(taken))
        for name, taken in times.items()
    }


def table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """Return a markdown table, all columns but the first aligned to the right."""
    rule = ["---", *["---:"] * (len(head) - 1)]
    return "\n".join(f"| {' | '.join(line)} |" for line in (head, rule, *lines))


def write(folder: Path, name: str, rows: Sequence[Any], text: str) -> None:
    """Write rows (named tuples) as CSV and a text on them as markdown; print the text."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(rows[0]._fields)
        for row in rows:
            writer.writerow([f"{x:.4g}" if isinstance(x, float) else x for x in row])
    text = f"Measured on {describe_machine()}.\n\n{text}\n"
    (folder / f"{name}.md").write_text(text, encoding="utf-8")
    print(text)


def draw(figure: Callable[[Sequence[Any], Path], bool], rows: Sequence[Any], path: Path) -> None:
    """Draw rows into a file; say so where matplotlib is missing (`figure` returns False then)."""
    if not figure(rows, path):
        print("no figure: matplotlib is missing: pip install -e '.[peers]'", file=sys.stderr)


def benchmark_parser(
    description: str | None, *, rounds: int, seconds: float, quick: str
) -> argparse.ArgumentParser:
    """Return a parser of what all benchmarks here are told, with their defaults."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--rounds", type=int, default=rounds, help=f"(default: {rounds})")
    parser.add_argument(
        "--seconds", type=float, default=seconds, help=f"of a turn (default: {seconds})"
    )
    parser.add_argument("--quick", action="store_true", help=quick)
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder of the results")
    return parser

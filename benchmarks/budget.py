"""Where the time of a complete control step goes: of each environment, one world and a batch.

The parts of a step are timed from outside, each call with all that it calls; what is left of the
whole step, which is timed without looking into it, is Python: arguments, infos, Gymnasium's
wrappers. Watched and unwatched steps take turns. Episodes end at staggered times.
"""

from __future__ import annotations

import contextlib
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple
from unittest import mock

import gymnasium

from pbd_gym.physics import World
from pbd_gym.tasks import Batch, Task
from records import benchmark_parser, in_turn, table, write
from throughput import Case, single_case, task_ids, vector_case

_BATCH = 4096
_LOOKS = 8  # steps between putting the watches on and off


class Row(NamedTuple):
    """One part of the step of one environment.

    Attributes:
        id: Of the environment.
        worlds: In it; 1 is stepped through `gymnasium.make`, more through `make_vec`.
        part: "step" is all of it, "Python" what no part holds.
        microseconds: Of a step of all worlds, median over the rounds.
        share: Of the whole step.
    """

    id: str
    worlds: int
    part: str
    microseconds: float
    share: float


def parts_of(task: type[Task]) -> dict[str, list[tuple[type, str]]]:
    """Return what each part of a step of a task is called, and the methods that it is made of."""
    return {
        "actions": [(Batch, "_clip"), (task, "pin_targets")],
        "kernel": [(World, "step")],
        "reward": [(task, "judge"), (Batch, "_put_back_diverged"), (Batch, "_score")],
        "observation": [(Batch, "observe")],
        "reset": [(Batch, "reset")],
    }


@contextlib.contextmanager
def watched(parts: Mapping[str, Sequence[tuple[type, str]]]) -> Iterator[dict[str, list[float]]]:
    """Note the seconds of every call of the parts within the context."""
    spent: dict[str, list[float]] = {part: [] for part in parts}
    inside = False

    def watch(method: Callable[..., Any], part: str) -> Callable[..., Any]:
        def call(*arguments: Any, **keywords: Any) -> Any:
            nonlocal inside
            if inside:  # it belongs to the part that calls it
                return method(*arguments, **keywords)
            inside, begin = True, time.thread_time()
            try:
                return method(*arguments, **keywords)
            finally:
                spent[part].append(time.thread_time() - begin)
                inside = False

        return call

    with contextlib.ExitStack() as stack:
        for part, methods in parts.items():
            for kind, name in methods:
                watcher = watch(getattr(kind, name), part)
                stack.enter_context(mock.patch.object(kind, name, watcher))
        yield spent


def cost_of_watching() -> float:
    """Return what a watched call seems to take longer than it does [s]."""

    class Nothing:
        def do(self) -> None:
            pass

    nothing = Nothing()
    with watched({"nothing": [(Nothing, "do")]}) as spent:
        for _ in range(1000):
            nothing.do()
    return statistics.median(spent["nothing"])


def measure(id: str, case: Case, rounds: int, seconds: float) -> list[Row]:
    """Measure the parts of one environment's step."""
    env: Any = gymnasium.make(id).unwrapped
    parts, cost = parts_of(type(env.task)), cost_of_watching()
    looks: dict[str, list[float]] = {part: [] for part in parts}

    def look(k: int) -> None:
        with watched(parts) as spent:
            for number in range(_LOOKS):
                case.step(k * _LOOKS + number)
        for part, calls in spent.items():
            looks[part].append((sum(calls) - cost * len(calls)) / _LOOKS)

    whole = in_turn({"step": case.step, "": look}, rounds, seconds, time.thread_time)["step"].median
    # episodes begin in some steps only: of resets the mean
    taken = {part: statistics.median(looks[part]) for part in parts}
    taken["reset"] = statistics.mean(looks["reset"])
    taken["Python"] = max(whole - sum(taken.values()), 0.0)
    return [
        Row(id, case.worlds, part, 1e6 * value, value / whole)
        for part, value in {"step": whole, **taken}.items()
    ]


def report(rows: Sequence[Row]) -> str:
    """Return the shares as markdown."""
    parts = list(dict.fromkeys(row.part for row in rows if row.part != "step"))
    cells = {(row.id, row.worlds, row.part): row for row in rows}
    lines = []
    for id, worlds in dict.fromkeys((row.id, row.worlds) for row in rows):
        shares = [f"{cells[id, worlds, part].share:.0%}" for part in parts]
        whole = cells[id, worlds, "step"].microseconds
        lines.append([f"`{id}`", str(worlds), f"{whole:,.0f}", *shares])
    return (
        "Microseconds of a complete control step of all worlds on one thread, median over the "
        "rounds, and the shares of its parts:\n\n"
        + table(["environment", "worlds", "step [µs]", *parts], lines)
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure; write CSV and table."""
    parser = benchmark_parser(__doc__, rounds=5, seconds=0.2, quick="one environment, briefly")
    options = parser.parse_args(arguments)
    ids, batch = task_ids(), _BATCH
    if options.quick:
        options.rounds, options.seconds, ids, batch = 2, 0.02, ids[:1], 64
    rows = []
    for id in ids:
        for case in (single_case(id), vector_case(id, batch, 1)):
            rows += measure(id, case, options.rounds, options.seconds)
    write(options.out, "budget", rows, report(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())

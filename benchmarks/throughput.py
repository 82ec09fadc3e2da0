"""Measure control steps per second of the environments, and of the bare kernel beside them.

A control step is complete: actions in; observation, reward, info and autoreset out. Episodes end
at staggered times, as in training. "kernel" is `World.step` alone on the same model. Cases of one
environment are measured in turn, round after round, so that a busy moment hits all of them alike;
given are the median over the rounds and the slowest and fastest round.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

import pbd_gym
from machine import describe_machine
from pbd_gym.physics import World
from records import benchmark_parser, draw
from report import draw_figure, markdown
from start_up import measure_start_up

gymnasium.register_envs(pbd_gym)
WORLDS = (1, 64, 1024, 4096)
THREADS = (1, 2)
# The pendulums share their kernels.
START_UP_IDS = ("PBDPendulum-v0", "PBDRope-v0", "PBDCloth-v0")
# Actions are drawn before the clock starts and used in turn.
_ACTIONS = 32


class Row(NamedTuple):
    """One line of the results.

    Attributes:
        id: Of the environment.
        measure: "make", "make_vec" or "kernel" [control steps/s], "cold" or "warm" start [s].
        worlds: Number of worlds.
        threads: Number of threads.
        median: Over all rounds.
        least: The slowest round, or the shortest start.
        greatest: The fastest round, or the longest start.
        rounds: How many there were.
    """

    id: str
    measure: str
    worlds: int
    threads: int
    median: float
    least: float
    greatest: float
    rounds: int


@dataclass(frozen=True)
class Case:
    """Something to step over and over: `step(k)` is the k-th control step of all worlds."""

    measure: str
    worlds: int
    threads: int
    step: Callable[[int], None]


def single_case(id: str) -> Case:
    """Step one world through `gymnasium.make`, begin the next episode where one ends."""
    env = gymnasium.make(id)
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(_ACTIONS)]

    def step(k: int) -> None:
        _, _, terminated, truncated, _ = env.step(actions[k % _ACTIONS])
        if terminated or truncated:
            env.reset()

    return Case("make", 1, 1, step)


def vector_case(id: str, worlds: int, threads: int) -> Case:
    """Step n worlds through `gymnasium.make_vec`, their episodes ending at staggered times."""
    env: Any = gymnasium.make_vec(
        id,
        num_envs=worlds,
        vectorization_mode="vector_entry_point",
        autoreset_mode=AutoresetMode.SAME_STEP,
        num_threads=threads,
    )
    env.reset(seed=0)
    state = env.unwrapped.get_state()
    ages = np.arange(worlds) * env.unwrapped.max_episode_steps // worlds
    env.unwrapped.set_state(replace(state, elapsed=ages))
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(_ACTIONS)]
    return Case("make_vec", worlds, threads, lambda k: env.step(actions[k % _ACTIONS]) and None)


def kernel_case(id: str, worlds: int, threads: int) -> Case:
    """Step the bare worlds of the same task from the same start, their pins swaying a little."""
    env: Any = gymnasium.make_vec(id, num_envs=worlds, vectorization_mode="vector_entry_point")
    env.reset(seed=0)
    task = env.unwrapped.task
    world = World(task.model, worlds, num_threads=threads)
    world.restore(env.unwrapped.get_state().worlds)
    dt = 1.0 / task.control_rate
    start = world.x[:, task.model.pins]
    reach = np.random.default_rng(0).uniform(-0.5, 0.5, start.shape) * task.max_speed * dt
    targets = [(start + side * reach).astype(np.float32) for side in (1.0, -1.0)]
    return Case("kernel", worlds, threads, lambda k: world.step(dt, task.substeps, targets[k % 2]))


def make_cases(id: str, worlds: Sequence[int]) -> list[Case]:
    """Make all cases of one environment."""
    cases = [single_case(id)]
    for count, threads in itertools.product(worlds, THREADS):
        if threads == 1 or count >= 64:  # fewer worlds do not fill two threads
            cases += [vector_case(id, count, threads), kernel_case(id, count, threads)]
    return cases


def measure(case: Case, seconds: float) -> float:
    """Return control steps per second over all worlds, measured for about so many seconds."""
    steps, begin = 0, time.perf_counter()
    while True:
        case.step(steps)
        steps += 1
        elapsed = time.perf_counter() - begin
        if elapsed >= seconds:
            return steps * case.worlds / elapsed


def measure_id(
    id: str, worlds: Sequence[int], rounds: int, seconds: float, progress: Progress
) -> list[Row]:
    """Measure all cases of one environment, in turn, round after round."""
    cases = make_cases(id, worlds)
    speeds: list[list[float]] = [[] for _ in cases]
    for round_ in range(-1, rounds):  # the first warms up: caches, threads, allocator
        for case, measured in zip(cases, speeds, strict=True):
            speed = measure(case, seconds)
            progress.advance(f"{id}, {case.measure}, {case.worlds} worlds")
            if round_ >= 0:
                measured.append(speed)
    return [
        Row(
            id, case.measure, case.worlds, case.threads,
            float(np.median(measured)), min(measured), max(measured), rounds,
        )
        for case, measured in zip(cases, speeds, strict=True)
    ]  # fmt: skip


def measure_starts(ids: Sequence[str], progress: Progress) -> list[Row]:
    """Time fresh processes to their first step, one world and a batch."""
    rows = []
    for id, worlds in itertools.product(ids, (1, 64)):
        progress.advance(f"{id}, compiling in a fresh process")
        seconds = measure_start_up(f"pbd_gym:{id}", worlds)
        for name, value in zip(seconds._fields, seconds, strict=True):
            rows.append(Row(id, name, worlds, 1, value, value, value, 1))
    return rows


class Progress:
    """A bar on stderr, drawn only where someone may watch; the core install has no tqdm."""

    def __init__(self, total: int) -> None:
        self.total, self.done = total, 0

    def advance(self, what: str) -> None:
        """Count one more of `total` and say what it was."""
        self.done += 1
        if not sys.stderr.isatty():
            return
        filled = 30 * self.done // self.total
        line = f"[{'#' * filled}{'.' * (30 - filled)}] {self.done}/{self.total} {what}"
        end = "\n" if self.done == self.total else ""
        print(f"\r\033[K{line[:100]}", end=end, file=sys.stderr, flush=True)


def task_ids() -> list[str]:
    """Return all ids but those of twins: their worlds are those of other tasks."""
    return [id for id in gymnasium.registry if id.startswith("PBD") and "Goal" not in id]


def parse_arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Read the command line."""
    ids = task_ids()
    parser = benchmark_parser(
        __doc__,
        rounds=5,
        seconds=0.25,
        quick="2 rounds of 0.02 s, 1 and 64 worlds, no start-up times: to see that it works",
    )
    parser.add_argument(
        "--ids", nargs="+", default=ids, choices=ids, metavar="ID", help=f"of {', '.join(ids)}"
    )
    parser.add_argument(
        "--worlds", nargs="+", type=int, default=WORLDS, metavar="N", help="(default: %(default)s)"
    )
    parser.add_argument(
        "--no-start-up", action="store_true", help="do not time fresh processes and compilation"
    )
    options = parser.parse_args(arguments)
    if options.rounds < 1 or min(options.worlds) < 1:
        parser.error("--rounds and --worlds must be at least 1")
    if options.quick:
        options.rounds, options.seconds, options.worlds = 2, 0.02, (1, 64)
        options.no_start_up = True
    return options


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print the table and write the results; return the exit status."""
    options = parse_arguments(arguments)
    start_ids = [] if options.no_start_up else [id for id in options.ids if id in START_UP_IDS]
    per_round = 1 + 2 * sum(2 if count >= 64 else 1 for count in options.worlds)
    progress = Progress(2 * len(start_ids) + len(options.ids) * per_round * (options.rounds + 1))
    machine = describe_machine()  # now: the load is that of others
    rows = measure_starts(start_ids, progress)
    for id in options.ids:
        rows += measure_id(id, options.worlds, options.rounds, options.seconds, progress)
    text = markdown(rows, machine)
    print(text)
    options.out.mkdir(parents=True, exist_ok=True)
    with open(options.out / "throughput.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(Row._fields)
        for row in rows:
            digits = 2 if row.measure in ("cold", "warm") else 0
            speeds = [f"{value:.{digits}f}" for value in row[4:7]]
            writer.writerow([*row[:4], *speeds, row.rounds])
    (options.out / "throughput.md").write_text(text, encoding="utf-8")
    draw(draw_figure, rows, options.out / "throughput.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())

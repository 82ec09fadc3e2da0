"""What a substep of a rope and of a cloth costs, by particles, worlds and threads.

The bare `World.step` of the driven scenes. First the size of the body grows, in as many worlds as
make about the same number of particles, on one thread; then the number of worlds, on one thread and
on two. All settings of a series have their turn in each round; as other processes can only slow a
step down, the fastest round counts. What two threads can be worth on the machine is told by two
that share nothing, each with worlds of its own.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from accuracy_scenes import FRAME
from driven import Driven, driven_cloth, driven_rope
from pbd_gym.physics import World
from records import benchmark_parser, draw, in_turn, table, write

_ROPES = (8, 16, 32, 64, 128, 256, 512, 1024)
_CLOTHS = (4, 6, 8, 12, 16, 24, 32)
_PARTICLES = 16_384
_WORLDS = (1, 4, 16, 64, 256, 1024, 4096, 16_384)
_FRAMES = 30
_APART = 1024  # worlds of each of two threads that share nothing
_COLOURS = {"rope": "#0072b2", "cloth": "#d55e00"}


class Row(NamedTuple):
    """One setting.

    Attributes:
        series: What grows: "particles", "worlds", or "threads" at several numbers of worlds;
            "apart" is two threads that share nothing.
        scene: "rope" or "cloth".
        particles: Of a world.
        constraints: Of a world: links, distances and bends.
        substeps: Of a control step.
        worlds: That are stepped.
        threads: On which.
        median: Nanoseconds for a particle and substep of a world, over the rounds.
        least: In the fastest round.
        greatest: In the slowest round.
    """

    series: str
    scene: str
    particles: int
    constraints: int
    substeps: int
    worlds: int
    threads: int
    median: float
    least: float
    greatest: float


def rope(particles: int) -> Driven:
    """Return a rope in so many substeps that its waves run less than half a link in each."""
    return driven_rope(particles, substeps=max(20, particles // 8))


def _batch(scene: Driven) -> int:
    """Return how many worlds have about `_PARTICLES` particles, in whole tiles of 32 lanes."""
    return max(1, _PARTICLES // scene.model.num_particles // 32) * 32


def measure(
    series: str, cases: Sequence[tuple[Driven, int, int]], rounds: int, seconds: float
) -> list[Row]:
    """Measure (scene, worlds, threads) in turn."""
    calls = {number: _steps(*case) for number, case in enumerate(cases)}
    # what other processes take from a single thread is left out; of two threads it cannot be
    alone = all(threads == 1 for *_, threads in cases)
    clock = time.thread_time if alone else time.perf_counter
    spreads = in_turn(calls, rounds, seconds, clock)
    rows = []
    for number, spread in spreads.items():
        scene, worlds, threads = cases[number]
        share = 1e9 / (worlds * scene.model.num_particles * scene.substeps)
        costs = (share * value for value in spread)
        rows.append(_row(series, scene, worlds, threads, *costs))
    return rows


def _row(
    series: str, scene: Driven, worlds: int, threads: int, median: float, least: float, most: float
) -> Row:
    model, name = scene.model, scene.name.split()[0]
    constraints = len(model.links()[0]) + len(model.distances.rest) + len(model.bends.triples)
    size = model.num_particles, constraints, scene.substeps
    return Row(series, name, *size, worlds, threads, median, least, most)


def measure_apart(scene: Driven, rounds: int, seconds: float) -> Row:
    """Measure two threads that share nothing, each with worlds of its own."""
    steps = [_steps(scene, _APART, 1) for _ in range(2)]
    costs = []
    with ThreadPoolExecutor(2) as pool:
        count = _count_within(steps[0], seconds)
        for _ in range(rounds):
            begin = time.perf_counter()
            list(pool.map(lambda step: [step(k) for k in range(count)], steps))
            costs.append(time.perf_counter() - begin)
    share = 1e9 / (2 * count * _APART * scene.model.num_particles * scene.substeps)
    spread = statistics.median(costs), min(costs), max(costs)
    return _row("apart", scene, 2 * _APART, 2, *(share * value for value in spread))


def _count_within(step: Callable[[int], None], seconds: float) -> int:
    """Return how many steps take about so long, no fewer than 8."""
    begin = time.perf_counter()
    for k in range(8):
        step(k)
    return max(8, round(8 * seconds / (time.perf_counter() - begin)))


def _steps(scene: Driven, worlds: int, threads: int) -> Callable[[int], None]:
    world = World(scene.model, worlds, num_threads=threads)
    path = scene.path(_FRAMES, worlds)
    return lambda k: world.step(FRAME, scene.substeps, path[k % _FRAMES])


def report(rows: Sequence[Row]) -> str:
    """Return both series as markdown."""
    parts = [
        "Nanoseconds for one particle and substep of one world in the fastest round, one thread, "
        f"about {_PARTICLES} particles in all worlds:",
        _growing_bodies([row for row in rows if row.series == "particles"]),
        "The same for more and more worlds; in brackets how many times faster two threads are than "
        "one, by the clock on the wall:",
        _growing_batches([row for row in rows if row.series in ("worlds", "threads")]),
        _sharing_nothing(rows),
    ]
    return "\n\n".join(filter(None, parts))


def _growing_bodies(rows: Sequence[Row]) -> str:
    lines = [
        [
            row.scene, str(row.particles), f"{row.constraints / row.particles:.2f}",
            str(row.worlds), str(row.substeps), f"{row.least:.2f}",
            f"{row.least * row.particles / row.constraints:.2f}",
        ]
        for row in rows
    ]  # fmt: skip
    head = ["scene", "particles", "constraints each", "worlds", "substeps", "cost [ns]"]
    return table([*head, "of a constraint [ns]"], lines)


def _growing_batches(rows: Sequence[Row]) -> str:
    cost = {(row.series, row.scene, row.worlds, row.threads): row.least for row in rows}
    scenes = list(dict.fromkeys((row.scene, row.particles) for row in rows))
    lines = []
    for worlds in sorted({row.worlds for row in rows}):
        line = [str(worlds)]
        for scene, _ in scenes:
            one, two = (cost.get(("threads", scene, worlds, threads)) for threads in (1, 2))
            gain = f" ({one / two:.2f})" if one and two else ""
            line.append(f"{cost['worlds', scene, worlds, 1]:.2f}{gain}")
        lines.append(line)
    return table(["worlds", *(f"{name}, {count} particles [ns]" for name, count in scenes)], lines)


def _sharing_nothing(rows: Sequence[Row]) -> str:
    """Say what two threads are worth where each has worlds of its own."""
    parts = []
    for row in rows:
        if row.series == "apart":
            one = next(
                other.least
                for other in rows
                if (other.series, other.scene, other.worlds, other.threads)
                == ("threads", row.scene, _APART, 1)
            )
            parts.append(f"{one / row.least:.2f} (a {row.scene})")
    if not parts:
        return ""
    return (
        f"Two threads that share nothing, {_APART} worlds each, are together {' and '.join(parts)} "
        "times as fast as one alone: what the machine had to give at that time."
    )


def draw_figure(rows: Sequence[Row], path: Path) -> bool:
    """Draw cost over particles and over worlds; return whether matplotlib is there."""
    try:
        import matplotlib
    except ImportError:
        return False
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
    for axis, series in zip(axes, ("particles", "worlds"), strict=True):
        for scene, colour in _COLOURS.items():
            line = [row for row in rows if (row.series, row.scene) == (series, scene)]
            places, costs = [getattr(row, series) for row in line], [row.least for row in line]
            axis.loglog(places, costs, "-o", color=colour, label=scene, markersize=4)
        axis.set_xlabel(series)
        axis.grid(which="both", alpha=0.3)
        axis.legend(fontsize=8, frameon=False)
    axes[0].set_ylabel("ns per particle, substep and world")
    figure.savefig(path, dpi=100)
    plt.close(figure)
    return True


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure; write CSV, table and figure."""
    parser = benchmark_parser(__doc__, rounds=15, seconds=0.02, quick="few sizes, briefly")
    options = parser.parse_args(arguments)
    ropes, cloths, worlds = _ROPES, _CLOTHS, _WORLDS
    if options.quick:
        options.rounds, options.seconds = 2, 0.01
        ropes, cloths, worlds = ropes[:3], (), worlds[:4]
    scenes = (*map(rope, ropes), *map(driven_cloth, cloths))
    bodies = [(scene, _batch(scene), 1) for scene in scenes]
    batches = [rope(32)] if options.quick else [rope(32), driven_cloth(16)]
    rows = measure("particles", bodies, options.rounds, options.seconds)
    for scene in batches:
        alone = [(scene, count, 1) for count in worlds]
        rows += measure("worlds", alone, options.rounds, options.seconds)
        both = [(scene, count, threads) for count in worlds if count > 32 for threads in (1, 2)]
        rows += measure("threads", both, options.rounds, options.seconds)
        if not options.quick:
            rows.append(measure_apart(scene, options.rounds, options.seconds))
    write(options.out, "scaling", rows, report(rows))
    draw(draw_figure, rows, options.out / "scaling.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""What a substep of a rope and of a cloth costs, by particles, worlds and threads.

The bare `World.step` of the driven scenes. First the size of the body grows, in as many worlds as
make about the same number of particles, on one thread; then the number of worlds, on one thread and
on two. All settings of a series have their turn in each round; as other processes can only slow a
step down, the fastest round counts.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
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
_COLOURS = {"rope": "#0072b2", "cloth": "#d55e00"}


class Row(NamedTuple):
    """One setting.

    Attributes:
        series: What grows: "particles", "worlds", or "threads" at several numbers of worlds.
        scene: "rope" or "cloth".
        particles: Of a world.
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
        particles, name = scene.model.num_particles, scene.name.split()[0]
        share = 1e9 / (worlds * particles * scene.substeps)
        costs = (share * value for value in spread)
        rows.append(Row(series, name, particles, scene.substeps, worlds, threads, *costs))
    return rows


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
        _growing_batches([row for row in rows if row.series != "particles"]),
    ]
    return "\n\n".join(parts)


def _growing_bodies(rows: Sequence[Row]) -> str:
    lines = [
        [row.scene, str(row.particles), str(row.worlds), str(row.substeps), f"{row.least:.2f}"]
        for row in rows
    ]
    return table(["scene", "particles", "worlds", "substeps", "cost [ns]"], lines)


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
    write(options.out, "scaling", rows, report(rows))
    draw(draw_figure, rows, options.out / "scaling.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Ours beside the packages one would pick instead, in one run.

Ours is stepped through the Gymnasium interface and complete: actions in; observation, reward, info
and autoreset out. Engines without environments are bare. In each scene all have their turn in each
round, with as many threads as they can use. Before the clock starts, every one runs the scene once:
how far it stretches what it should not, and how far a rope's end is from its exact motion, stand
beside its speed. Packages that are not installed are left out.
"""

from __future__ import annotations

import os

# before any engine is loaded: pyPBD is slower with more threads than this in bodies this small
os.environ["OMP_NUM_THREADS"] = "1"

import importlib.util
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from accuracy_cloth import worst_strain
from motions import FRAMES, Contender, Motion
from peer_bodies import ROPE, cloths, ropes, single_ropes
from peer_figure import draw_figure
from peer_pendulums import double_pendulums, lone_pendulums, single_pendulums
from records import benchmark_parser, draw, in_turn, table, write

_MODULES = {
    "MuJoCo": ("mujoco",), "pyPBD": ("pypbd",), "pymunk": ("pymunk",), "newton": ("newton",),
    "gymnax": ("gymnax",), "EnvPool": ("envpool",), "gymnasium[mujoco]": ("mujoco", "imageio"),
}  # fmt: skip
_THREADS = 2
SCENES: dict[str, Callable[[], Iterator[Contender]]] = {
    "rope": partial(ropes, _THREADS),
    "one rope": single_ropes,
    "cloth 16x16": partial(cloths, 16, _THREADS),
    "cloth 32x32": partial(cloths, 32, _THREADS),
    "pendulum": partial(single_pendulums, _THREADS),
    "double pendulum": partial(double_pendulums, _THREADS),
    "one pendulum": lone_pendulums,
}


class Row(NamedTuple):
    """One contender in one scene.

    Attributes:
        scene: Name.
        engine: Name.
        setting: In words.
        worlds: That were stepped together.
        threads: On which.
        strain: Greatest stretch of a link or thread: within 4 s, of a cloth after 2 s; or NaN.
        error: Root mean square distance of a rope's end from its exact motion in 1 s [m], or NaN.
        median: Control steps per second of all worlds.
        least: In the slowest round.
        greatest: In the fastest round.
    """

    scene: str
    engine: str
    setting: str
    worlds: int
    threads: int
    strain: float
    error: float
    median: float
    least: float
    greatest: float


def measure(scene: str, contenders: Sequence[Contender], rounds: int, seconds: float) -> list[Row]:
    """Run the scene once with each contender, then time them in turn."""
    motions, found = [], []
    for one in contenders:
        print(f"{scene}: preparing {one.engine}, {one.setting}", file=sys.stderr)
        motions.append(one.prepare(one.worlds))
        for k in range(2):  # compiles; JAX again in the second, whose arrays are its own
            motions[-1].step(k)
        compared = motions[-1].places is not None
        # in a batch all worlds are alike
        found.append(quality(scene, one.prepare(1) if compared else motions[-1]))
    print(f"{scene}: {rounds} rounds of {len(motions)} x {seconds} s", file=sys.stderr)
    spreads = in_turn({n: one.step for n, one in enumerate(motions)}, rounds, seconds)
    rows = []
    for number, spread in spreads.items():
        one = contenders[number]
        speeds = (one.worlds / value for value in (spread.median, spread.greatest, spread.least))
        told = (one.engine, one.setting, one.worlds, one.threads)
        rows.append(Row(scene, *told, *found[number], *speeds))
    return rows


def quality(scene: str, motion: Motion) -> tuple[float, float]:
    """Return the worst strain within an episode, and the error of a rope's end [m]."""
    if motion.places is None:
        return np.nan, np.nan
    worst, ends = 0.0, []
    begin = FRAMES // 2 if scene.startswith("cloth") else 0  # until then the flat sheet buckles
    for k in range(FRAMES - 1):  # an environment begins anew after the last one
        motion.step(k)
        x = np.array(motion.places(), dtype=np.float64)
        if k >= begin:
            worst = max(worst, _strain(scene, x))
        ends.append(x[-1])
    return worst, ROPE.error(np.array(ends[: ROPE.frames])) if "rope" in scene else np.nan


def _strain(scene: str, x: np.ndarray) -> float:
    """Return the greatest stretch of a link or thread; x is (N, dim)."""
    if "cloth" in scene:
        size = round(len(x) ** 0.5)
        return worst_strain(x.reshape(size, size, 3))
    lengths = np.sqrt(np.sum(np.diff(x, axis=0) ** 2, axis=1))
    return float((lengths / ROPE.lengths - 1.0).max())


def report(rows: Sequence[Row]) -> str:
    """Return the comparison as markdown."""
    lines = []
    for row in rows:
        ours = max(r.median for r in rows if r.scene == row.scene and r.engine == "pbd_gym")
        lines.append([
            row.scene, f"{row.engine}: {row.setting}", str(row.worlds), str(row.threads),
            "" if np.isnan(row.strain) else f"{100.0 * row.strain:.2f} %",
            "" if np.isnan(row.error) else f"{row.error:.3f}",
            f"{row.median:,.0f}", f"{row.least:,.0f} to {row.greatest:,.0f}",
            "" if row.engine == "pbd_gym" else f"{ours / row.median:.1f}",
        ])  # fmt: skip
    head = ["scene", "by", "worlds", "threads", "worst strain", "error [m]", "control steps/s"]
    return (
        "Control steps per second over all worlds, median over the rounds, with the slowest and "
        "the fastest round; last how many times faster ours is:\n\n"
        + table([*head, "rounds", "times"], lines)
    )


def installed(contenders: Sequence[Contender]) -> list[Contender]:
    """Return those whose package can be loaded; name the others on stderr."""
    missing = {
        one.engine
        for one in contenders
        if not all(map(importlib.util.find_spec, _MODULES.get(one.engine, ())))
    }
    for engine in sorted(missing):
        print(f"{engine} is left out: pip install {engine.lower()}", file=sys.stderr)
    return [one for one in contenders if one.engine not in missing]


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure; write CSV, table and figure."""
    parser = benchmark_parser(
        __doc__, rounds=5, seconds=0.3, quick="one pendulum without peers' engines, briefly"
    )
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=list(SCENES))
    options = parser.parse_args(arguments)
    if options.quick:
        options.rounds, options.seconds, options.scenes = 2, 0.02, ["one pendulum"]
    rows = []
    for scene in options.scenes:
        contenders = installed(list(SCENES[scene]()))
        rows += measure(scene, contenders, options.rounds, options.seconds)
    write(options.out, "peers", rows, report(rows))
    draw(draw_figure, rows, options.out / "peers.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())

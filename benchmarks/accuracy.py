"""Error against cost: this package in each integrator beside MuJoCo, pyPBD and pymunk, in one run.

Chains of point masses (a pendulum, a double pendulum, a driven rope) are compared with their exact
motion; a cloth driven at a corner is asked not to stretch. Cost is the time one core takes for one
world and 1/60 s, ours in a batch. Settings of all engines are run in turn, round after round, and
the median is given. Peers that are not installed are left out: pip install mujoco pypbd pymunk.
"""

from __future__ import annotations

import os

# before any engine is loaded: one thread for all
os.environ["OMP_NUM_THREADS"] = "1"

import argparse
import csv
import statistics
import sys
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from tqdm import tqdm

from accuracy_cloth import CLOTH_ENGINES, FRAMES
from accuracy_engines import ENGINES, Entry, is_installed
from accuracy_figure import draw_figure
from accuracy_scenes import SCENES, ChainScene
from machine import describe_machine

RESULTS = Path(__file__).parent / "results"
CLOTH = "hanging cloth"
# Errors at which costs are compared: [m], and for the cloth the share by which a link is stretched.
TOLERANCES = {
    "pendulum": (1e-2, 1e-3, 1e-4),
    "double pendulum": (1e-2, 1e-3, 1e-4),
    "driven rope": (5e-2, 3e-2, 1e-2),
    CLOTH: (5e-2, 2e-2, 1e-2),
}


class Row(NamedTuple):
    """One setting of one engine in one scene.

    Attributes:
        scene: Name.
        engine: Name.
        setting: In words.
        error: RMS distance of the last point from its exact motion [m]; cloth: worst stretch.
        microseconds: Of one core for one world and 1/60 s, median over the rounds.
        least: Of the fastest round.
        greatest: Of the slowest round.
    """

    scene: str
    engine: str
    setting: str
    error: float
    microseconds: float
    least: float
    greatest: float


def measure(engines: Sequence[str], scenes: Sequence[str], rounds: int) -> list[Row]:
    """Run every setting of the engines in every scene, `rounds` times in turn."""
    rows = []
    for scene in SCENES:
        if scene.name in scenes:
            entries = [entry for name in engines for entry in ENGINES[name]()]
            rows += _measure_chain(scene, entries, rounds)
    if CLOTH in scenes:
        rows += _measure_cloth([name for name in engines if name in CLOTH_ENGINES], rounds)
    return rows


def _measure_chain(scene: ChainScene, entries: Sequence[Entry], rounds: int) -> list[Row]:
    runs = [(entry, entry.prepare(scene)) for entry in entries]
    errors, times = {}, defaultdict(list)
    for _ in range(rounds):
        for entry, run in tqdm(runs, desc=scene.name, leave=False):
            tip, seconds = run()
            key = (entry.engine, entry.setting)
            errors[key] = scene.error(tip)
            times[key].append(1e6 * seconds / scene.frames)
    return _rows(scene.name, errors, times)


def _measure_cloth(engines: Sequence[str], rounds: int) -> list[Row]:
    runs = [(entry, entry.prepare()) for name in engines for entry in CLOTH_ENGINES[name]()]
    errors, times = {}, defaultdict(list)
    for _ in range(rounds):
        for entry, run in tqdm(runs, desc=CLOTH, leave=False):
            strain, seconds = run()
            key = (entry.engine, entry.setting)
            errors[key] = strain
            times[key].append(1e6 * seconds / (FRAMES / 2))
    return _rows(CLOTH, errors, times)


def _rows(
    scene: str, errors: dict[tuple[str, str], float], times: dict[tuple[str, str], list[float]]
) -> list[Row]:
    return [
        Row(scene, *key, error, statistics.median(times[key]), min(times[key]), max(times[key]))
        for key, error in errors.items()
    ]


def comparison(rows: Sequence[Row]) -> str:
    """Return, scene by scene, each engine's cheapest setting within a tolerance, as markdown."""
    lines = ["| scene | error below | engine | setting | us per 1/60 s | times ours |"]
    lines.append("|---|---:|---|---|---:|---:|")
    for scene, tolerances in TOLERANCES.items():
        for tolerance in tolerances:
            within = [row for row in rows if row.scene == scene and row.error <= tolerance]
            own = [row.microseconds for row in within if row.engine.startswith("pbd_gym")]
            families = dict.fromkeys(row.engine.split()[0] for row in rows if row.scene == scene)
            for family in families:
                entries = [row for row in within if row.engine.split()[0] == family]
                if not entries:
                    lines.append(f"| {scene} | {tolerance:g} | {family} | none | | |")
                    continue
                best = min(entries, key=lambda row: row.microseconds)
                ratio = f"{best.microseconds / min(own):.1f}" if own else ""
                lines.append(
                    f"| {scene} | {tolerance:g} | {best.engine} | {best.setting} | "
                    f"{best.microseconds:.2f} | {ratio} |"
                )
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure; write CSV, table and figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    scenes = [*(scene.name for scene in SCENES), CLOTH]
    parser.add_argument("--engines", nargs="+", choices=ENGINES, default=list(ENGINES))
    parser.add_argument("--scenes", nargs="+", choices=scenes, default=scenes)
    parser.add_argument("--rounds", type=int, default=3, help="repeats of every setting")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder of the results")
    arguments = parser.parse_args()
    if arguments.rounds < 1:
        parser.error(f"--rounds is {arguments.rounds}; allowed: from 1 up")
    arguments.out.mkdir(parents=True, exist_ok=True)
    engines = [name for name in arguments.engines if is_installed(name)]
    for name in set(arguments.engines) - set(engines):
        print(f"{name} is left out: it is not installed", file=sys.stderr)
    rows = measure(engines, arguments.scenes, arguments.rounds)
    with (arguments.out / "accuracy.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(Row._fields)
        writer.writerows(rows)
    text = f"Measured on {describe_machine()}.\n\n{comparison(rows)}"
    (arguments.out / "accuracy.md").write_text(text, encoding="utf-8")
    print(text)
    draw_figure(rows, arguments.out / "accuracy.png")


if __name__ == "__main__":
    main()

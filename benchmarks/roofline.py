"""Our stepping kernel beside plain C of the same arithmetic, compiled on the spot.

Both advance the same worlds by the same control steps on one thread, state loaded and stored, in
turn, round after round; the results are asserted to be equal bit for bit. C is given with scalar
code and with several numbers of lanes, each as `cc -O3 -march=native` compiles it; the fastest
is what ours is compared with. Times are of the thread, so that other processes count little.
"""

from __future__ import annotations

import functools
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from accuracy_scenes import FRAME
from driven import Driven, driven_cloth, driven_rope
from native import COMPILER, FLAGS, NativeWorld, compiler_version, has_compiler
from pbd_gym.physics import World
from records import benchmark_parser, in_turn, table, write

_C_LANES = (8, 16, 32, 64)
_FRAMES = 60


class Row(NamedTuple):
    """One way to step one scene.

    Attributes:
        scene: Name.
        worlds: That are stepped.
        code: "pbd_gym" or "C".
        lanes: Worlds side by side; 1 is scalar code.
        microseconds: Of the thread for a control step of one world, median over the rounds.
        least: In the fastest round.
        greatest: In the slowest round.
    """

    scene: str
    worlds: int
    code: str
    lanes: int
    microseconds: float
    least: float
    greatest: float


def measure(scene: Driven, worlds: int, rounds: int, seconds: float) -> list[Row]:
    """Step so many worlds of a scene, ours and C."""
    native = {lanes: _native(scene, worlds, lanes) for lanes in (1, *_C_LANES) if lanes <= worlds}
    ours = World(scene.model, worlds, num_threads=1)
    calls = {("C", lanes): _steps(scene, world) for lanes, world in native.items()}
    calls["pbd_gym", ours.lanes] = _steps(scene, ours)
    if ours.lanes > 1:
        scalar = World(scene.model, worlds, num_threads=1, lanes=1)
        calls["pbd_gym", 1] = _steps(scene, scalar)
    _assert_equal(ours, native, calls)
    spreads = in_turn(calls, rounds, seconds, time.thread_time)
    return [
        Row(scene.name, worlds, *code, *(1e6 * value / worlds for value in spread))
        for code, spread in spreads.items()
    ]


def _native(scene: Driven, worlds: int, lanes: int) -> NativeWorld:
    return NativeWorld(scene.model, worlds, FRAME, scene.substeps, lanes=lanes, dtype=np.float32)


def _steps(scene: Driven, world: World | NativeWorld) -> Callable[[int], None]:
    path = scene.path(_FRAMES, len(world.x))
    if isinstance(world, NativeWorld):
        return lambda k: world.step(path[k % _FRAMES])
    return lambda k: world.step(FRAME, scene.substeps, path[k % _FRAMES])


def _assert_equal(
    ours: World, native: dict[int, NativeWorld], calls: dict[Any, Callable[[int], None]]
) -> None:
    """Take a second of steps with all of them, and compare every bit."""
    for k in range(_FRAMES):
        for call in calls.values():
            call(k)
    for lanes, world in native.items():
        same = np.array_equal(world.x, ours.x) and np.array_equal(world.v, ours.v)
        if not same:
            raise AssertionError(f"C with {lanes} lanes differs from ours: not the same work")


def report(rows: Sequence[Row]) -> str:
    """Return the comparison as markdown."""
    lines = []
    for scene, worlds in dict.fromkeys((row.scene, row.worlds) for row in rows):
        own = [row for row in rows if (row.scene, row.worlds) == (scene, worlds)]
        scalar = next(row for row in own if (row.code, row.lanes) == ("C", 1))
        best = min((row for row in own if row.code == "C"), key=lambda row: row.microseconds)
        for row in own:
            if row.code == "pbd_gym":
                rival = best if row.lanes > 1 or worlds == 1 else scalar
                lines.append([
                    scene, str(worlds), str(row.lanes), f"{row.microseconds:.2f}",
                    f"{rival.microseconds:.2f} ({rival.lanes})",
                    f"{rival.microseconds / row.microseconds:.2f}",
                ])  # fmt: skip
    head = ["scene", "worlds", "lanes", "pbd_gym [µs]", "C [µs] (its lanes)", "share of C's speed"]
    spread = max((row.greatest - row.least) / row.microseconds for row in rows)
    return (
        f"Microseconds of one thread for a control step of one world, beside C by "
        f"{compiler_version()} ({COMPILER} {' '.join(FLAGS)}), all results equal bit for bit; "
        f"slowest and fastest round differ by up to {spread:.0%} of the median:\n\n"
        + table(head, lines)
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure; write CSV and table."""
    parser = benchmark_parser(__doc__, rounds=9, seconds=0.1, quick="the rope alone, briefly")
    options = parser.parse_args(arguments)
    if not has_compiler():
        print(f"left out: no C compiler `{COMPILER}`: apt-get install gcc", file=sys.stderr)
        return 0
    scenes = [(driven_rope(), 512), (driven_rope(), 1)]
    if options.quick:
        options.rounds, options.seconds, scenes = 2, 0.01, [(driven_rope(), 32)]
    else:
        scenes += [(driven_cloth(), 64), (driven_cloth(), 1)]
    take = functools.partial(measure, rounds=options.rounds, seconds=options.seconds)
    rows = [row for scene, worlds in scenes for row in take(scene, worlds)]
    write(options.out, "roofline", rows, report(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())

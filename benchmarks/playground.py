"""How many particles the playground simulates and draws, and how soon the windows move.

Pictures per second are those of one core's own time, so that a busy machine does not disturb the
measurement. The start is that of a fresh process, with the compiled kernels on disk, up to the
first picture in motion; beside what passes on the clock stands the processor's time.

python benchmarks/playground.py
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np

from pbd_gym.playground.drawing import Drawing, Settings
from pbd_gym.playground.files import at_rest
from pbd_gym.playground.scenes import ball_pit, net

SIZE = (1180, 760)
_PLAYGROUND = """
import time
from pbd_gym.playground.app import App
from pbd_gym.playground.files import at_rest
from pbd_gym.playground.scenes import SCENES
app = App(at_rest(SCENES["Rope"]()))
while app.stage is None or app.stage.simulation.time == 0.0:
    app.frame()
    time.sleep(0.005)
"""
_PLAY = """
import time
import pbd_gym
from pbd_gym.play import Play
program = Play("PBDRope-v0")
while not (program.is_ready and program.steps):
    program.frame()
    time.sleep(0.005)
"""


def open_scene(drawing: Drawing):
    """Return the program in a window that nobody sees, as soon as it moves."""
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    from pbd_gym.playground.app import App

    app = App(at_rest(drawing), size=SIZE)
    while app.stage is None:
        app.frame()
        time.sleep(0.01)
    return app


def measure(drawing: Drawing, pictures: int) -> tuple[float, float]:
    """Return the median core times of a picture and of the physics within it [s]."""
    app = open_scene(drawing)
    assert app.stage is not None
    simulation = app.stage.simulation
    frames, steps = [], []
    for index in range(pictures + 5):
        start = time.process_time()
        app.frame()
        middle = time.process_time()
        simulation.step()
        end = time.process_time()
        if index >= 5:  # the first ones load what is used for the first time
            frames.append(middle - start)
            steps.append(end - middle)
    app.close()
    return float(np.median(frames)), float(np.median(steps))


def measure_start(program: str, repeats: int = 5) -> tuple[float, float]:
    """Return the median time on the clock and of the processor until a program moves [s]."""
    hidden = os.environ | {"SDL_VIDEODRIVER": "dummy"}
    clock, processor = [], []
    for turn in range(repeats + 1):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        start = time.perf_counter()
        subprocess.run([sys.executable, "-c", program], env=hidden, check=True, capture_output=True)
        passed = time.perf_counter() - start
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        if turn > 0:  # the first one may have to compile
            clock.append(passed)
            processor.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return float(np.median(clock)), float(np.median(processor))


def main() -> None:
    """Measure and print two tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pictures", type=int, default=60, help="per scene (default: %(default)s)")
    arguments = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    coarse = Settings(substeps=4)
    scenes = {
        "cloth 32 x 32": net(32),
        "1000 balls": ball_pit(1000),
        "cloth 100 x 100": net(100),
        "cloth 100 x 100, 4 substeps": replace(net(100), settings=coarse),
    }
    print(f"window {SIZE[0]} x {SIZE[1]}, one core")
    print("| scene | particles | pictures per second | picture [ms] | physics in it [ms] |")
    print("| --- | ---: | ---: | ---: | ---: |")
    for name, drawing in scenes.items():
        picture, physics = measure(drawing, arguments.pictures)
        count = len(drawing.particles)
        row = f"| {name} | {count} | {1.0 / picture:.0f} | {1e3 * picture:.1f} | "
        print(row + f"{1e3 * physics:.1f} |", flush=True)
    print(
        "\n| program | first picture in motion after [s] | processor [s] |\n| --- | ---: | ---: |"
    )
    for name, program in (("playground", _PLAYGROUND), ("play", _PLAY)):
        clock, processor = measure_start(program)
        print(f"| {name} | {clock:.2f} | {processor:.2f} |", flush=True)


if __name__ == "__main__":
    main()

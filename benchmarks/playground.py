"""How many particles the playground simulates and draws, in pictures per second of one core.

What counts is the core's own time, so that a busy machine does not disturb the measurement.

python benchmarks/playground.py
"""

from __future__ import annotations

import argparse
import os
import time
from dataclasses import replace

import numpy as np

from pbd_gym.playground.drawing import Drawing, Settings
from pbd_gym.playground.files import at_rest
from pbd_gym.playground.scenes import ball_pit, net

SIZE = (1180, 760)


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


def main() -> None:
    """Measure and print a table."""
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


if __name__ == "__main__":
    main()

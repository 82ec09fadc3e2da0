"""What a step costs, in lines of the method that are executed, not in seconds."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np

import pbd_gym

# Without compilation the kernels are Python, and every line that they execute can be counted.
COUNT = """
import sys
from pathlib import Path
from scenes import pendulum_2d, rope_2d, world
import pbd_gym.physics

lines = 0
kernels = str(Path(pbd_gym.physics.__file__).parent / "kernels")

def trace(frame, event, argument):
    global lines
    if not frame.f_code.co_filename.startswith(kernels):
        return None
    lines += event == "line"
    return trace

def work(model, substeps):
    global lines
    state = world(model)
    state.step(0.01 * substeps, substeps)
    lines = 0
    sys.settrace(trace)
    state.step(0.01 * substeps, substeps)
    sys.settrace(None)
    return lines

def rope(particles, **settings):
    return rope_2d(particles, pins=[0], rope={"bending_stiffness": 1e-3}, **settings)

print(*(work(rope(n), 1) for n in (10, 20, 40, 80)))
print(*(work(rope(n, integrator="rattle"), 1) for n in (10, 20, 40, 80)))
print(*(work(rope(10), n) for n in (1, 2, 4, 8)))
print(*(work(rope(10, iterations=n), 1) for n in (1, 2, 3, 4)))
"""


def test_a_step_costs_time_in_proportion_to_particles_substeps_and_iterations():
    folders = [Path(__file__).parent, Path(pbd_gym.__file__).parents[1]]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(map(str, folders)),
        "NUMBA_DISABLE_JIT": "1",
    }
    result = subprocess.run(
        [sys.executable, "-c", COUNT], env=environment, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    table = np.array([row.split() for row in result.stdout.splitlines()], dtype=int)
    pbd, rattle, substeps, iterations = table
    assert (table > 1000).all()  # the lines were counted
    for work in (pbd, rattle):
        # work = a + b N exactly: each doubling of N = 10, 20, 40, 80 adds twice as much
        np.testing.assert_array_equal(np.diff(work)[1:], 2 * np.diff(work)[:-1])
    np.testing.assert_array_equal(np.diff(substeps)[1:], 2 * np.diff(substeps)[:-1])
    # the first iteration projects the bends as well
    assert np.diff(iterations, 2).tolist() == [0, 0]

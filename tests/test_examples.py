"""Every example runs alone, as its docstring says."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


def run(name, *arguments, folder):
    """Run an example in a folder of its own and return what it prints."""
    done = subprocess.run(
        [sys.executable, EXAMPLES / name, *arguments],
        cwd=folder,
        env=os.environ | {"COLUMNS": "100"},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_quickstart_plays_an_episode(tmp_path):
    assert re.match(r"success: (True|False), \d+\.\d cm", run("quickstart.py", folder=tmp_path))


def test_pixels_shows_stacked_pictures(tmp_path):
    options = ("--size", "32", "--frames", "2", "--steps", "3")
    assert "(2, 32, 32, 3) uint8" in run("pixels.py", *options, folder=tmp_path)


def test_a_custom_task_is_trained(tmp_path):
    pytest.importorskip("stable_baselines3")
    printed = run("custom_task.py", "--steps", "512", "--worlds", "8", folder=tmp_path)
    assert [line.split(":")[0] for line in printed.splitlines() if "return" in line] == [
        "untrained",
        "trained",
    ]


def test_a_custom_task_equals_its_batch(tmp_path):
    program = """
import gymnasium, numpy as np
make = lambda mode: gymnasium.make_vec("custom_task:Crane-v0", num_envs=3, vectorization_mode=mode)
single, batch = make("sync"), make("vector_entry_point")
assert np.array_equal(single.reset(seed=0)[0], batch.reset(seed=0)[0])
for _ in range(125):
    actions = single.action_space.sample()
    for one, other in zip(single.step(actions)[:4], batch.step(actions)[:4]):
        assert np.array_equal(one, other)
"""
    place = {"PYTHONPATH": str(EXAMPLES)}
    subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, env=os.environ | place, check=True
    )


def test_an_episode_is_planned(tmp_path):
    pytest.importorskip("imageio_ffmpeg")
    small = "--candidates 32 --horizon 10 --iterations 1 --steps 12 --video plan.mp4"
    printed = run("plan.py", *small.split(), folder=tmp_path)
    assert re.search(r"return \d+\.\d in 12 steps", printed)
    assert re.search(r"real-time factor of planning: \d+\.\d\d", printed)
    assert (tmp_path / "plan.mp4").stat().st_size > 0


@pytest.mark.parametrize("name", ["custom_task.py", "pixels.py", "plan.py", "record_video.py"])
def test_examples_with_options_explain_them(name, tmp_path):
    assert "--help" in run(name, "--help", folder=tmp_path)


def test_no_example_is_forgotten():
    tested = {"custom_task.py", "pixels.py", "plan.py", "quickstart.py", "record_video.py"}
    assert {path.name for path in EXAMPLES.glob("*.py")} == tested

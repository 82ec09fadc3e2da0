"""What docs/performance.md says of machine code and cost can be measured anywhere."""

import csv
import subprocess
import sys
from pathlib import Path

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


def run(script, *options):
    """Run a benchmark in a process of its own; return what it prints."""
    command = [sys.executable, BENCHMARKS / script, *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_hot_loops_over_the_lanes_are_vector_code():
    lines = [line.split("|") for line in run("simd_report.py", "--scenes", "rope").splitlines()]
    counts = {cells[1].strip(" `"): list(map(int, cells[2:6])) for cells in lines[4:] if cells[1:]}
    hot = ("_eliminate_current", "_apply", "_bend", "_distance", "_predict", "_shorten")
    for kernel in hot:
        (found,) = (row for name, row in counts.items() if name.split(".")[1] == kernel)
        bits, packed, scalar, calls = found
        # 32 lanes are 4 vectors of 8, or 2 of 16 with half the instructions; a scalar loop has as
        # many scalar ones
        assert bits >= 128, (kernel, found)
        assert packed >= min(32, 32 * 256 // bits), (kernel, found)
        assert scalar < packed / 4, (kernel, found)
        assert calls == 0, (kernel, found)


def test_a_quick_run_of_scaling_writes_all_files(tmp_path):
    printed = run("scaling.py", "--quick", "--out", tmp_path)
    assert (tmp_path / "scaling.md").read_text(encoding="utf-8") in printed
    assert (tmp_path / "scaling.png").stat().st_size > 0
    with open(tmp_path / "scaling.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert {row["series"] for row in rows} == {"particles", "worlds", "threads"}
    assert all(0.0 < float(row["least"]) <= float(row["median"]) for row in rows)


def test_a_quick_run_of_sb3_frames_compares_all_ways_to_step(tmp_path):
    options = ("--ids", "PBDPendulum-v0", "--worlds", "4", "--rounds", "1", "--out", tmp_path)
    printed = run("sb3_frames.py", *options)
    assert (tmp_path / "sb3_frames.md").read_text(encoding="utf-8") in printed
    with open(tmp_path / "sb3_frames.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    ways = {"pbd_gym.sb3", "nothing", "DummyVecEnv", "SubprocVecEnv"}
    assert {row["worlds"] for row in rows} == ways
    assert all(float(row[name]) > 0.0 for row in rows for name in ("collecting", "training"))


def test_the_shares_of_a_step_add_up_to_the_whole(tmp_path):
    printed = run("budget.py", "--quick", "--out", tmp_path)
    assert (tmp_path / "budget.md").read_text(encoding="utf-8") in printed
    with open(tmp_path / "budget.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for worlds in ("1", "64"):
        own = {row["part"]: float(row["microseconds"]) for row in rows if row["worlds"] == worlds}
        whole = own.pop("step")
        assert set(own) == {"actions", "kernel", "reward", "observation", "reset", "Python"}
        assert 0.0 < own["kernel"] < whole
        assert sum(own.values()) >= 0.99 * whole  # "Python" is what is left, but not below 0

"""The throughput benchmark measures what it says, and its committed results are whole."""

import csv
import subprocess
import sys
from pathlib import Path

import gymnasium

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import throughput
from records import RESULTS
from report import markdown


def read(folder):
    """Return the rows of a results file."""
    with open(folder / "throughput.csv", newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_quick_run_prints_a_table_and_writes_all_files(tmp_path):
    options = ["--quick", "--ids", "PBDPendulum-v0", "--out", tmp_path / "new"]
    done = subprocess.run(
        [sys.executable, throughput.__file__, *options], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "| `PBDPendulum-v0` |" in done.stdout
    rows = read(tmp_path / "new")
    cases = {(row["measure"], row["worlds"], row["threads"]) for row in rows}
    expected = {("make", "1", "1")}
    for measure in ("make_vec", "kernel"):
        expected |= {(measure, "1", "1"), (measure, "64", "1"), (measure, "64", "2")}
    assert cases == expected
    for row in rows:
        assert 0.0 < float(row["least"]) <= float(row["median"]) <= float(row["greatest"])
    assert (tmp_path / "new/throughput.md").read_text(encoding="utf-8") in done.stdout


def test_speed_counts_the_steps_of_all_worlds():
    # 10 ms asleep per step: no machine does more than 100 steps a second, a busy one does fewer
    case = throughput.Case("make_vec", 64, 1, lambda k: throughput.time.sleep(0.01))
    assert 0.2 * 6400 < throughput.measure(case, 0.05) <= 6400


def test_episodes_of_a_batch_end_at_staggered_times(monkeypatch):
    made = []
    make_vec = gymnasium.make_vec
    monkeypatch.setattr(
        gymnasium, "make_vec", lambda *a, **k: made.append(make_vec(*a, **k)) or made[0]
    )
    case = throughput.vector_case("PBDRope-v0", 10, 1)
    for k in range(10):
        case.step(k)
    assert sorted(made[0].unwrapped.get_state().elapsed) == list(range(0, 100, 10))


def test_start_up_is_timed_with_an_empty_and_a_full_cache():
    cold, warm = throughput.measure_start_up("pbd_gym:PBDRope-v0", 1, repeats=1)
    assert cold > 1.5 * warm > 0.0  # compiling takes several times as long as starting Python


def test_the_table_gives_medians_and_shares_of_the_kernel():
    rows = [
        throughput.Row("A-v0", "make", 1, 1, 9_990.0, 9e3, 1.1e4, 3),
        throughput.Row("A-v0", "make_vec", 64, 2, 1.234e6, 1e6, 1.3e6, 3),
        throughput.Row("A-v0", "kernel", 64, 2, 2.468e6, 2e6, 3e6, 3),
        throughput.Row("A-v0", "cold", 1, 1, 12.34, 12.34, 12.34, 1),
        throughput.Row("A-v0", "warm", 1, 1, 1.234, 1.234, 1.234, 1),
    ]
    text = markdown(rows, "a machine")
    assert "| `A-v0` | 9.99 k | 1.23 M |" in text
    assert "| `A-v0` | 2.47 M (50%) |" in text
    assert "| `A-v0` | 1 | 12.3 | 1.23 |" in text


def test_the_committed_results_cover_every_environment():
    rows = read(RESULTS)
    assert {row["id"] for row in rows} == set(throughput.task_ids())
    assert {int(row["worlds"]) for row in rows if row["measure"] == "make_vec"} == set(
        throughput.WORLDS
    )

"""The comparison of policies over seeds: its statistics, what it skips, and what it writes."""

import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
sys.path.insert(0, str(Path(__file__).parents[1] / "train"))

import benchmark
import comparison
from cells import ENVIRONMENTS, Cell
from curves import LearningCurve, Point, read_csv, write_csv
from scores import Score, interquartile_mean, overall_table, read_scores, table, write_scores

NOTHING = (math.nan,) * 5
EARNED = ("success_rate", "normalized_performance", "return")


def score(env="PBDRope-v0", policy="ppo", seed=0, performance=0.5, training=NOTHING):
    return Score(env, policy, seed, 100, 0.25, performance, 12.5, *training)


def test_the_interquartile_mean_leaves_out_the_outer_quarters():
    estimate = interquartile_mean(np.array([-1000.0, 1.0, 2.0, 3.0, 1000.0]))
    assert estimate.mean == 2.0
    assert estimate.low <= 2.0 <= estimate.high


def test_the_interval_of_equal_runs_is_a_point():
    estimate = interquartile_mean(np.full(5, 0.7), np.full(5, 0.7))
    assert [estimate.mean, estimate.low, estimate.high] == pytest.approx([0.7] * 3)


def test_runs_are_resampled_within_their_environment():
    # drawn from all ten values at random, the mean would now and then be far from one half
    estimate = interquartile_mean(np.zeros(5), np.ones(5))
    assert (estimate.low, estimate.mean, estimate.high) == (0.5, 0.5, 0.5)


def test_scores_and_curves_come_back_from_their_files(tmp_path):
    scores = [score(), score(seed=1, training=(1e6, 60.0, math.inf, math.inf, math.inf))]
    write_scores(tmp_path / "scores.csv", scores)
    assert repr(read_scores(tmp_path / "scores.csv")) == repr(scores)
    curve = LearningCurve([Point(10, 0.5, 1.0, math.nan)], [Point(20, 1.5, 2.0, 0.25)])
    write_csv(tmp_path / "curve.csv", curve)
    assert repr(read_csv(tmp_path / "curve.csv")) == repr(curve)


def test_the_table_tells_medians_and_what_was_not_reached():
    times = [(1e5, 9.0, 5e4, 4.0, 6.0), (1e5, 9.0, 7e4, 5.0, math.inf)]
    times += [(1e5, 9.0, 9e4, 7.0, math.inf)]
    runs = [score(seed=seed, training=training) for seed, training in enumerate(times)]
    line = table([*runs, score(policy="noop")]).splitlines()
    assert line[2].endswith("| 12.5 [12.5, 12.5] | 70 k | 5 s | not reached |")
    assert line[3] == "| `PBDRope-v0` | noop | 0.25 | 0.50 | 12.5 |  |  |  |"


def test_performance_over_all_environments_is_told_by_policy():
    scores = [score(env, "sac", seed, level) for seed in range(3) for env, level in
              (("PBDRope-v0", 0.2), ("PBDCloth-v0", 0.4))]  # fmt: skip
    assert overall_table(scores).splitlines()[-1] == "| sac | 0.30 [0.30, 0.30] |"


def test_the_table_goes_between_its_marks_and_nowhere_else(tmp_path):
    readme = tmp_path / "README.md"
    readme.write_text("before\n<!-- baselines -->\nold\n<!-- /baselines -->\nafter\n")
    comparison.put_into(readme, "new")
    expected = "before\n<!-- baselines -->\nnew\n<!-- /baselines -->\nafter\n"
    assert readme.read_text() == expected
    readme.write_text("no marks\n")
    with pytest.raises(ValueError, match="has no <!-- baselines -->"):
        comparison.put_into(readme, "new")
    assert readme.read_text() == "no marks\n"


def test_all_environments_that_were_trained_are_drawn_in_one_figure(tmp_path):
    (tmp_path / "results").mkdir()
    cells = [Cell(env, "ppo", seed) for env in ENVIRONMENTS[:2] for seed in range(2)]
    summary = {"episodes": 100} | {key: {"mean": 0.5} for key in EARNED}
    for number, cell in enumerate(cells, start=1):
        cell.run(tmp_path).path.mkdir()
        evaluations = [Point(10, 0.5, 1.0, 0.0), Point(20, 1.5 * number, 2.0, 1.0)]
        write_csv(cell.run(tmp_path).curve_table, LearningCurve([], evaluations))
        cell.run(tmp_path).evaluation.write_text(json.dumps(summary))
        comparison.report(cells, tmp_path, tmp_path / "results", None)
        drawn = {file.stem for file in (tmp_path / "results").glob("*.png")}
        # one environment has its own figure, which shows as much
        assert drawn == set(ENVIRONMENTS[:1] if number < 3 else [*ENVIRONMENTS[:2], "success"])


def test_the_table_in_the_readme_is_of_the_scores_beside_it():
    root = Path(__file__).parents[1]
    readme = (root / "README.md").read_text(encoding="utf-8")
    shown = readme.split(comparison.MARKS[0])[1].split(comparison.MARKS[1])[0].strip()
    assert shown == table(read_scores(root / "docs/results/baselines.csv"))


def test_a_benchmark_skips_what_is_done_and_goes_on_where_it_was_stopped(tmp_path, monkeypatch):
    runs, results = tmp_path / "runs", tmp_path / "results"
    options = ["--env", "PBDPendulum-v0", "--policy", "noop", "ppo", "--seeds", "1"]
    options += ["--episodes", "2", "--total-timesteps", "4096"]
    options += ["--log-dir", str(runs), "--results", str(results)]
    assert benchmark.main(options) == 0
    scores = read_scores(results / "baselines.csv")
    assert [(row.policy, row.episodes) for row in scores] == [("noop", 2), ("ppo", 100)]
    assert scores[1].timesteps == 4096
    assert (results / "PBDPendulum-v0.png").read_bytes().startswith(b"\x89PNG")

    asked = []
    monkeypatch.setattr(benchmark, "run_script", lambda script, quiet: asked.append(script))
    assert benchmark.main(options) == 0
    assert not asked
    (runs / "PBDPendulum-v0-ppo-0" / "evaluation.json").unlink()
    assert benchmark.main(options) == 0
    assert asked[0][-2:] == ["--resume", str(runs / "PBDPendulum-v0-ppo-0")]
    # what could not be run again stays in the table
    assert read_scores(results / "baselines.csv")[1] == scores[1]


def test_imitation_is_asked_for_where_it_is_possible(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(benchmark, "run_script", lambda script, quiet: asked.append(script))
    options = ["--env", "PBDTriplePendulum-v0", "PBDRope-v0", "--policy", "imitate", "--seeds", "1"]
    options += ["--log-dir", str(tmp_path / "runs"), "--results", str(tmp_path)]
    assert benchmark.main(options) == 0
    (script,) = asked
    assert script[0].endswith("imitate.py")
    assert script[script.index("--env") + 1] == "pbd_gym:PBDTriplePendulum-v0"


def test_jobs_at_once_give_the_same_table(tmp_path):
    tables = []
    for jobs in ("1", "2"):
        folder = tmp_path / jobs
        options = ["--env", "PBDPendulum-v0", "--policy", "noop", "random", "--seeds", "2"]
        options += ["--episodes", "2", "--jobs", jobs]
        options += ["--log-dir", str(folder / "runs"), "--results", str(folder)]
        assert benchmark.main(options) == 0
        tables.append((folder / "baselines.csv").read_text(encoding="utf-8"))
    assert tables[0] == tables[1]
    assert len(tables[0].splitlines()) == 5


def test_jobs_share_the_cores_and_none_is_without():
    cores = benchmark.shares_of_cores(1)[0]
    for jobs in (1, 2, 3, len(cores) + 1):
        shares = benchmark.shares_of_cores(jobs)
        assert len(shares) == jobs
        assert all(shares)
        assert set.union(*shares) == cores


def test_a_job_that_fails_stops_the_benchmark_and_tells_why(tmp_path, monkeypatch, capsys):
    script = ["-c", "import sys; sys.exit('the disk is full')"]
    monkeypatch.setattr(benchmark, "command", lambda cell, options: script)
    options = ["--env", "PBDPendulum-v0", "--policy", "noop", "--jobs", "2"]
    options += ["--log-dir", str(tmp_path / "runs"), "--results", str(tmp_path)]
    with pytest.raises(SystemExit):
        benchmark.main(options)
    assert "the disk is full" in capsys.readouterr().err


@pytest.mark.parametrize("option", ["seeds", "jobs"])
def test_a_number_below_one_is_refused(capsys, option):
    with pytest.raises(SystemExit):
        benchmark.main([f"--{option}", "0"])
    assert f"--{option} must be at least 1" in capsys.readouterr().err

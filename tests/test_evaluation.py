"""What train/evaluate.py measures, and its intervals."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from countdown import Countdown

pytest.importorskip("stable_baselines3")
sys.path.insert(0, str(Path(__file__).parents[1] / "train"))

import evaluate
from intervals import bootstrap_mean, wilson_rate
from pbd_gym.planning import SETTINGS
from rollouts import run_episodes


def test_the_scripted_policy_is_measured_above_noop_and_random(tmp_path):
    means = {}
    for policy in ("noop", "random", "scripted"):
        file = tmp_path / f"{policy}.json"
        assert evaluate.main([policy, "--episodes", "20", "--json", str(file)]) == 0
        summary = json.loads(file.read_text())
        assert summary["episodes"] == 20
        assert summary["steps_per_second"] > 0
        means[policy] = summary["return"]["mean"]
    assert means["scripted"] > max(means["noop"], means["random"])


def test_the_planner_is_measured_like_any_policy(tmp_path, monkeypatch):
    small = {"horizon": 4, "knots": 2, "candidates": 8, "iterations": 1, "replan": 4}
    monkeypatch.setitem(SETTINGS, "PBDRope-v0", small)
    file = tmp_path / "planner.json"
    assert evaluate.main(["planner", "--episodes", "2", "--json", str(file)]) == 0
    first = json.loads(file.read_text())["return"]
    assert evaluate.main(["planner", "--episodes", "2", "--json", str(file)]) == 0
    assert json.loads(file.read_text())["return"] == first


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["trained.zip"], "policy must be noop, random, scripted, planner or a file"),
        (["noop", "--episodes", "0"], "--episodes must be at least 1"),
        (["noop", "--json", "no_such_folder/out.json"], "no folder no_such_folder"),
        (["noop", "--env", "pbd_gym:PBDRobe-v0"], "PBDRobe"),
    ],
)
def test_an_evaluation_refuses_bad_arguments(capsys, arguments, message):
    with pytest.raises(SystemExit) as exit_info:
        evaluate.main(arguments)
    assert exit_info.value.code == 2
    assert message in capsys.readouterr().err


def test_a_file_that_is_no_model_is_refused(tmp_path, capsys):
    file = tmp_path / "model.zip"
    file.write_text("not a zip archive")
    with pytest.raises(SystemExit):
        evaluate.main([str(file)])
    assert "no model saved by stable-baselines3" in capsys.readouterr().err


def test_every_world_counts_one_episode_however_short():
    episodes = run_episodes(Countdown(5), lambda observation: observation, seed=0)
    length = np.arange(5) + 2
    np.testing.assert_array_equal(episodes.lengths, length)
    np.testing.assert_array_equal(episodes.returns, length * (length + 1) / 2)
    np.testing.assert_array_equal(episodes.successes, length > 2)
    np.testing.assert_array_equal(episodes.performances, length / 10)


def test_the_wilson_interval_agrees_with_its_closed_form_and_never_closes():
    rate = wilson_rate(np.arange(10) < 4)
    # Wilson's score interval of 4 in 10, from the published formula with z = 1.959964.
    np.testing.assert_allclose((rate.mean, rate.low, rate.high), (0.4, 0.1682, 0.6873), atol=1e-4)
    all_ten, none = wilson_rate(np.ones(10, dtype=bool)), wilson_rate(np.zeros(10, dtype=bool))
    assert all_ten.high == pytest.approx(1.0)
    assert all_ten.low == pytest.approx(1 - 0.2775, abs=1e-4)
    assert none.high == pytest.approx(0.2775, abs=1e-4)


def test_the_bootstrap_interval_is_that_of_the_normal_distribution_for_many_values():
    values = np.random.default_rng(0).normal(3.0, 2.0, 400)
    estimate = bootstrap_mean(values)
    half = 1.96 * values.std() / 20
    assert estimate.mean == values.mean()
    # 10 000 resamples place a quantile to about 2 % of the half width.
    assert estimate.low == pytest.approx(values.mean() - half, abs=0.1 * half)
    assert estimate.high == pytest.approx(values.mean() + half, abs=0.1 * half)

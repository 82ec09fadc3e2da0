import errno
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import gymnasium
import numpy as np
import pytest
import yaml
from countdown import Countdown

pytest.importorskip("stable_baselines3")
sys.path.insert(0, str(Path(__file__).parents[1] / "train"))

import evaluate
import torch
from callbacks import ProgressBar
from checkpoint import load_checkpoint
from config import load_config
from files import write_atomically
from intervals import bootstrap_mean, wilson_rate
from policies import NO_HINDSIGHT
from rollouts import run_episodes
from stable_baselines3 import PPO, SAC

import pbd_gym
import train
from pbd_gym.hyperparams import ALGORITHMS, algorithm_arguments, load_hyperparameters
from pbd_gym.planning import SETTINGS
from pbd_gym.sb3 import make_sb3_vec_env

SCRIPT = Path(__file__).parents[1] / "train/train.py"
ROPE = "pbd_gym:PBDRope-v0"
SMALL = {
    "ppo": ["n_steps:8", "batch_size:16", "n_epochs:2", "policy_kwargs:{'net_arch':[8]}"],
    "sac": ["learning_starts:40", "gradient_steps:2", "buffer_size:500", "batch_size:16"],
}


def small_run(folder, algo="ppo", total=256, **hyperparameters):
    """Give the arguments of a run of a second: 4 worlds, evaluated and saved several times."""
    extra = [f"{name}:{value}" for name, value in hyperparameters.items()]
    options = "--num-envs 4 --eval-freq 100 --eval-episodes 3 --checkpoint-freq 64 --no-video"
    return [
        *("--algo", algo, "--log-dir", str(folder), "--total-timesteps", str(total)),
        *options.split(),
        *("--hyperparameters", *SMALL[algo], *extra),
    ]


def interrupt_after(monkeypatch, steps):
    """Press Ctrl-C once in a training, somewhere within an update."""
    shown = ProgressBar._on_rollout_end

    def press(self):
        shown(self)
        if steps <= self.model.num_timesteps < steps + 4 * 8:
            monkeypatch.setattr(ProgressBar, "_on_rollout_end", shown)
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(ProgressBar, "_on_rollout_end", press)


def assert_same(first, second):
    if isinstance(first, dict):
        assert first.keys() == second.keys()
        for key in first:
            assert_same(first[key], second[key])
    elif isinstance(first, list):
        assert len(first) == len(second)
        for one, other in zip(first, second, strict=True):
            assert_same(one, other)
    elif torch.is_tensor(first):
        assert torch.equal(first, second)
    else:
        assert first == second


def assert_same_run(first, second, algorithm):
    for file in ("model.zip", "best_model.zip"):
        models = [
            algorithm.load(run / file, device="cpu", custom_objects=NO_HINDSIGHT)
            for run in (first, second)
        ]
        assert models[0].num_timesteps == models[1].num_timesteps
        assert_same(models[0].get_parameters(), models[1].get_parameters())  # and optimizers
    evaluations = [np.load(run / "evaluations.npz") for run in (first, second)]
    assert set(evaluations[0]) == {"timesteps", "results", "ep_lengths", "successes"}
    for name in evaluations[0]:
        np.testing.assert_array_equal(evaluations[0][name], evaluations[1][name])


@pytest.mark.parametrize(("algo", "algorithm"), [("ppo", PPO), ("sac", SAC)])
def test_an_interrupted_training_resumes_to_the_same_bits(
    tmp_path, monkeypatch, capsys, algo, algorithm
):
    straight, broken = (tmp_path / name / f"PBDRope-v0-{algo}-0" for name in ("a", "b"))
    assert train.main(small_run(straight.parent, algo)) == 0
    interrupt_after(monkeypatch, steps=130)
    assert train.main(small_run(broken.parent, algo)) == 130
    assert f"--resume {broken}" in capsys.readouterr().out
    assert not (broken / "evaluation.json").exists()
    assert (broken / "learning_curve.png").read_bytes().startswith(b"\x89PNG")
    assert evaluate.main([str(broken / "model.zip"), "--episodes", "2"]) == 0
    assert train.main(["--resume", str(broken), "--no-video"]) == 0
    assert_same_run(straight, broken, algorithm)


def test_a_training_killed_at_a_random_moment_resumes_to_the_same_bits(tmp_path):
    straight, broken = (tmp_path / name / "PBDRope-v0-ppo-0" for name in ("a", "b"))
    assert train.main(small_run(straight.parent, total=1024)) == 0

    rng = np.random.default_rng(0)
    checkpoint, last = broken / "checkpoint.pkl", None
    process = subprocess.Popen(
        [sys.executable, SCRIPT, *small_run(broken.parent, total=1024)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    for _ in range(rng.integers(2, 12)):  # of 17 checkpoints
        while not checkpoint.exists() or checkpoint.stat().st_mtime_ns == last:
            assert process.poll() is None
            time.sleep(0.001)
        last = checkpoint.stat().st_mtime_ns
    time.sleep(rng.uniform(0.0, 0.05))  # [s], about the time to the next checkpoint
    process.kill()
    assert process.wait() == -signal.SIGKILL
    assert not (broken / "evaluation.json").exists()

    assert train.main(["--resume", str(broken), "--no-video"]) == 0
    assert_same_run(straight, broken, PPO)


def test_a_training_that_breaks_off_before_its_first_update_resumes_to_the_same_bits(
    tmp_path, monkeypatch
):
    straight, broken = (tmp_path / name / "PBDRope-v0-ppo-0" for name in ("a", "b"))
    assert train.main(small_run(straight.parent)) == 0

    def break_off(*arguments, **keywords):
        raise RuntimeError("no update is reached")

    with monkeypatch.context() as patch:
        patch.setattr(PPO, "collect_rollouts", break_off)
        with pytest.raises(RuntimeError, match="no update is reached"):
            train.main(small_run(broken.parent))
    assert train.main(["--resume", str(broken), "--no-video"]) == 0
    assert_same_run(straight, broken, PPO)


def test_a_folder_that_cannot_be_made_is_told_before_the_training(tmp_path, capsys):
    (tmp_path / "runs").touch()
    with pytest.raises(SystemExit) as exit_info:
        train.main(small_run(tmp_path / "runs"))
    assert exit_info.value.code == 2
    assert "Not a directory" in capsys.readouterr().err


def test_a_file_that_cannot_be_written_is_told_before_the_training(tmp_path):
    """The limit of the size of files stands for a disk that is full after some kilobytes."""
    done = subprocess.run(
        [sys.executable, SCRIPT, *small_run(tmp_path)],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (8192, 8192)),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 1
    run = tmp_path / "PBDRope-v0-ppo-0"
    assert f"cannot write to {run}: [Errno {errno.EFBIG}]" in done.stderr
    assert "Traceback" not in done.stderr
    assert {file.name for file in run.iterdir()} == {"config.yml", "tensorboard"}


def test_a_disk_without_room_for_a_second_checkpoint_is_told_before_the_training(
    tmp_path, monkeypatch, capsys
):
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage._replace(free=1000))
    assert train.main(small_run(tmp_path)) == 1
    captured = capsys.readouterr()
    assert "0.0 MB are free" in captured.err
    assert "--resume" in captured.out
    monkeypatch.undo()
    assert train.main(["--resume", str(tmp_path / "PBDRope-v0-ppo-0"), "--no-video"]) == 0


def test_a_disk_that_fills_up_leaves_the_older_checkpoint(tmp_path, monkeypatch, capsys):
    straight, broken = (tmp_path / name / "PBDRope-v0-ppo-0" for name in ("a", "b"))
    assert train.main(small_run(straight.parent)) == 0

    def no_room(descriptor):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    shown = ProgressBar._on_rollout_end

    def fill_up(self):
        shown(self)
        if self.model.num_timesteps >= 96:
            monkeypatch.setattr(os, "fsync", no_room)

    monkeypatch.setattr(ProgressBar, "_on_rollout_end", fill_up)
    assert train.main(small_run(broken.parent)) == 1
    monkeypatch.undo()
    captured = capsys.readouterr()
    assert f"cannot write to {broken}: [Errno 28] No space left on device" in captured.err
    assert f"--resume {broken}" in captured.out
    assert not list(broken.glob("*.partial"))
    assert train.main(["--resume", str(broken), "--no-video"]) == 0
    assert_same_run(straight, broken, PPO)


def test_a_training_from_hindsight_resumes_to_the_same_bits(tmp_path, monkeypatch):
    straight, broken = (tmp_path / name / "PBDRopeGoal-v0-sac-0" for name in ("a", "b"))
    goal = ["--env", "pbd_gym:PBDRopeGoal-v0", "--env-kwargs", "max_episode_steps:10"]
    assert train.main([*small_run(straight.parent, "sac"), *goal]) == 0
    interrupt_after(monkeypatch, steps=130)
    assert train.main([*small_run(broken.parent, "sac"), *goal]) == 130
    assert train.main(["--resume", str(broken), "--no-video"]) == 0
    assert_same_run(straight, broken, SAC)


def test_worlds_that_train_have_arguments_of_their_own_after_a_resumption_too(
    tmp_path, monkeypatch
):
    straight, broken = (tmp_path / name / "PBDRope-v0-ppo-0" for name in ("a", "b"))
    short = ["--train-env-kwargs", "max_episode_steps:10"]
    assert train.main([*small_run(straight.parent), *short]) == 0
    interrupt_after(monkeypatch, steps=130)
    assert train.main([*small_run(broken.parent), *short]) == 130
    assert train.main(["--resume", str(broken), "--no-video"]) == 0
    assert_same_run(straight, broken, PPO)
    # after 64 steps of each world
    assert load_checkpoint(broken / "checkpoint.pkl")["worlds"]["lengths"].max() < 10
    assert (np.load(broken / "evaluations.npz")["ep_lengths"] == 100).all()


def test_n_steps_and_n_more_are_two_n_steps(tmp_path):
    straight, extended = (tmp_path / name / "PBDRope-v0-ppo-0" for name in ("a", "b"))
    constant = {"learning_rate": 0.001}  # a falling rate would fall to 0 after the first n
    assert train.main(small_run(straight.parent, total=256, **constant)) == 0
    assert train.main(small_run(extended.parent, total=128, **constant)) == 0
    assert train.main(["--resume", str(extended), "--total-timesteps", "256", "--no-video"]) == 0
    assert load_config(extended / "config.yml")[0].total_timesteps == 256
    assert_same_run(straight, extended, PPO)


def test_a_training_leaves_model_curve_evaluation_and_video(tmp_path, capsys):
    arguments = [option for option in small_run(tmp_path) if option != "--no-video"]
    assert train.main(arguments) == 0
    run = tmp_path / "PBDRope-v0-ppo-0"
    files = {file.name for file in run.iterdir()}
    assert files == {
        *("config.yml", "checkpoint.pkl", "model.zip", "best_model.zip", "tensorboard"),
        *("learning_curve.png", "learning_curve.csv", "evaluations.npz"),
        *("evaluation.json", "video.mp4"),
    }
    assert (run / "learning_curve.png").read_bytes().startswith(b"\x89PNG")
    assert b"ftyp" in (run / "video.mp4").read_bytes()[:16]
    summary = json.loads((run / "evaluation.json").read_text())
    assert summary["episodes"] == 100
    assert summary["return"]["low"] <= summary["return"]["mean"] <= summary["return"]["high"]
    assert "success rate" in capsys.readouterr().out

    with pytest.raises(SystemExit):
        train.main(small_run(tmp_path))
    assert "--overwrite" in capsys.readouterr().err
    assert evaluate.main([str(run), "--episodes", "4", "--json", str(tmp_path / "e.json")]) == 0
    assert json.loads((tmp_path / "e.json").read_text())["policy"].endswith("best_model.zip")
    with pytest.raises(SystemExit):
        evaluate.main([str(run), "--env-kwargs", "observation:keypoints"])
    assert "was trained on observations of shape" in capsys.readouterr().err


def test_overwriting_replaces_a_run_but_no_other_folder(tmp_path, capsys):
    run = tmp_path / "PBDRope-v0-ppo-0"
    run.mkdir()
    (run / "thesis.txt").write_text("years of work")
    with pytest.raises(SystemExit):
        train.main([*small_run(tmp_path), "--overwrite"])
    assert "is no training run" in capsys.readouterr().err
    assert (run / "thesis.txt").exists()
    (run / "config.yml").touch()
    assert train.main([*small_run(tmp_path, total=32), "--overwrite"]) == 0
    assert not (run / "thesis.txt").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--env", "pbd_gym:PBDRobe-v0"], "PBDRobe"),
        (["--env", "no_such_module:PBDRope-v0"], "no_such_module"),
        (["--env", "gymnasium:Pendulum-v1"], "no native vector environment"),
        (["--env-kwargs", "observation"], "takes key:value"),
        (["--env-kwargs", "observation:smells"], "observation"),
        (["--env-kwargs", "no_such_keyword:1"], "no_such_keyword"),
        (["--algo", "dqn"], "invalid choice"),
        (["--hyperparameters", "n_stebs:8"], "unknown hyperparameter of ppo: n_stebs"),
        (["--hyperparameters", "use_sde:True"], "use_sde"),
        (["--hyperparameters", "learning_rate:cosine_1"], "learning_rate must be"),
        (["--hyperparameters", "policy_kwargs:dict(a=open('x'))"], "policy_kwargs must be"),
        (
            ["--algo", "sac", "--hyperparameters", "replay_buffer_class:Heap"],
            "replay_buffer_class must be 'HerReplayBuffer', got 'Heap'",
        ),
        (["--num-envs", "0"], "num_envs must be an integer of at least 1"),
        (["--total-timesteps", "-5"], "total_timesteps must be"),
        (["--eval-freq", "-1"], "eval_freq must be"),
        (["--seed", "-1"], "seed must be"),
        (["--threads", "0"], "threads must be"),
        (["--device", "abacus"], "device must be"),
        (["--resume", "no_such_run"], "cannot resume no_such_run"),
        (["--resume", "no_such_run", "--overwrite"], "not allowed with"),
    ],
)
def test_bad_arguments_are_refused_before_anything_is_created(
    tmp_path, monkeypatch, capsys, arguments, message
):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as exit_info:
        train.main(arguments)
    assert exit_info.value.code == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_resumed_run_keeps_its_settings(tmp_path, capsys):
    assert train.main(small_run(tmp_path, total=32)) == 0
    run = str(tmp_path / "PBDRope-v0-ppo-0")
    for arguments, message in (
        (["--seed", "3"], "--seed cannot be given with --resume"),
        (["--total-timesteps", "31"], "must be at least 32"),
    ):
        with pytest.raises(SystemExit):
            train.main(["--resume", run, *arguments])
        assert message in capsys.readouterr().err


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


def test_a_write_that_breaks_off_leaves_the_old_file(tmp_path):
    path = tmp_path / "checkpoint.pkl"
    path.write_bytes(b"old")
    with pytest.raises(TypeError), write_atomically(path) as file:
        file.writelines([b"half of the n", None])
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]
    with write_atomically(path) as file:
        file.write(b"new")
    assert path.read_bytes() == b"new"


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_the_hyperparameter_files_serve_every_environment(algo):
    path = Path(pbd_gym.__path__[0]) / "hyperparams" / f"{algo}.yml"
    entries = yaml.safe_load(path.read_text())
    registered = {name for name in gymnasium.registry if name.startswith("PBD")}
    apart = entries.pop("train_env_kwargs", {})
    assert set(entries) - {"default"} | set(apart) <= registered
    # rl_zoo3 hands unknown entries to the algorithm, which refuses them
    assert not any("train_env_kwargs" in entry for entry in entries.values())
    for name in registered:
        hyperparameters = load_hyperparameters(algo, f"pbd_gym:{name}")
        assert hyperparameters["n_timesteps"] > 0
        assert hyperparameters["n_envs"] > 0
        assert "policy" in algorithm_arguments(algo, hyperparameters)
        assert hyperparameters.get("train_env_kwargs", {}) == apart.get(name, {})
        make_sb3_vec_env(f"pbd_gym:{name}", 1, **apart.get(name, {})).close()


def test_schedules_and_policies_given_as_text_are_read_as_rl_zoo3_reads_them():
    arguments = algorithm_arguments(
        "ppo",
        {
            "n_envs": 8,
            "learning_rate": "lin_0.002",
            "policy_kwargs": "dict(net_arch=[64, 64], activation_fn=nn.ReLU)",
        },
    )
    assert set(arguments) == {"learning_rate", "policy_kwargs"}
    assert [arguments["learning_rate"](remaining) for remaining in (1.0, 0.25)] == [0.002, 0.0005]
    assert arguments["policy_kwargs"] == {"net_arch": [64, 64], "activation_fn": torch.nn.ReLU}

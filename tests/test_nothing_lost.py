"""What interrupts, kills and full disks leave of a training: all but the last moments."""

import errno
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
pytest.importorskip("sb3_contrib")
sys.path.insert(0, str(Path(__file__).parents[1] / "train"))

from sb3_contrib import CrossQ
from stable_baselines3 import PPO, SAC

import evaluate
import train
from callbacks import ProgressBar
from checkpoint import load_checkpoint
from config import load_config
from files import write_atomically
from runs import SCRIPT, assert_same_run, interrupt_after, small_run


@pytest.mark.parametrize(("algo", "algorithm"), [("ppo", PPO), ("sac", SAC), ("crossq", CrossQ)])
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

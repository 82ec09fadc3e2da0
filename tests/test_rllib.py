"""train/rllib.py as far as it goes without Ray; `make rllib-smoke` tests the rest on a cluster."""

import csv
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "train"))

import rllib
from run_directory import RunDirectory


class Algorithm:
    """Stands for RLlib's: an iteration is 10 steps, a checkpoint is their number."""

    env_runner_group = SimpleNamespace(num_healthy_remote_workers=lambda: 1)

    def __init__(self, steps=0, disk=100):
        self.steps, self.disk = steps, disk

    def train(self):
        self.steps += 10
        seen = {"episode_return_mean": self.steps / 2, "success_rate": 0.0}
        return {"num_env_steps_sampled_lifetime": self.steps, "env_runners": seen}

    def save_to_path(self, path):
        Path(path).mkdir()
        (Path(path) / "steps").write_text(str(self.steps))
        if self.steps > self.disk:
            raise OSError("No space left on device")


def config_of(total):
    return rllib.RllibConfig(total_timesteps=total, num_envs=10, checkpoint_freq=20)


def checkpoints(run):
    return [(path.name, (path / "steps").read_text()) for path in run.path.glob("checkpoint-*")]


def test_a_training_keeps_its_last_checkpoint_alone(tmp_path, capsys):
    run = RunDirectory(tmp_path)
    config = config_of(50)
    assert rllib.learn(Algorithm(), run, config, 0)
    assert checkpoints(run) == [("checkpoint-000000000050", "50")]
    assert rllib.steps_of(tmp_path / "checkpoint-000000000050") == 50
    longer = config_of(70)
    assert rllib.learn(Algorithm(50), run, longer, 50)
    rows = list(csv.DictReader((tmp_path / "progress.csv").read_text().splitlines()))
    assert [int(row["timesteps"]) for row in rows] == [10, 20, 30, 40, 50, 60, 70]
    assert "50 steps" in capsys.readouterr().out


def test_a_checkpoint_that_cannot_be_written_leaves_the_older_one(tmp_path):
    run = RunDirectory(tmp_path)
    config = config_of(100)
    with pytest.raises(OSError, match="No space left"):
        rllib.learn(Algorithm(disk=70), run, config, 0)
    assert checkpoints(run) == [("checkpoint-000000000060", "60")]
    assert not (tmp_path / "partial").exists()


def test_a_full_disk_is_told_before_the_training(tmp_path):
    algorithm = Algorithm(disk=-1)
    config = config_of(100)
    with pytest.raises(OSError, match="No space left"):
        rllib.learn(algorithm, RunDirectory(tmp_path), config, 0)
    assert algorithm.steps == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "pip install -c constraints-rllib.txt 'pbd-gym[rllib]'"),
        (["--env", "pbd_gym:PBDRobe-v0"], "PBDRobe"),
        (["--env", "gymnasium:Pendulum-v1"], "no native vector environment"),
        (["--num-envs", "0"], "num_envs must be an integer of at least 1"),
        (["--num-env-runners", "-1"], "num_env_runners must be"),
        (["--resume", "no_such_run"], "cannot resume no_such_run"),
        (["--resume", "no_such_run", "--seed", "1"], "--seed cannot be given with --resume"),
    ],
)
def test_bad_arguments_and_a_missing_ray_are_told(
    tmp_path, monkeypatch, capsys, arguments, message
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(SystemExit) as exit_info:
        rllib.main(arguments)
    assert exit_info.value.code == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []

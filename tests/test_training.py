import json
import sys
from pathlib import Path

import gymnasium
import pytest
import yaml

pytest.importorskip("stable_baselines3")
sys.path.insert(0, str(Path(__file__).parents[1] / "train"))

import torch

import evaluate
import pbd_gym
import train
from pbd_gym.hyperparams import ALGORITHMS, algorithm_arguments, load_hyperparameters
from pbd_gym.sb3 import make_sb3_vec_env
from runs import small_run


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

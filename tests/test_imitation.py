"""train/imitate.py: the exact model, the regulators, the student, and the script itself."""

import signal
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
sys.path.insert(0, str(Path(__file__).parents[1] / "train"))

import evaluate
import imitate
from curves import read_csv
from imitation import Imitation, Student
from pbd_gym.hyperparams import algorithm_arguments, algorithm_class
from pbd_gym.sb3 import make_sb3_vec_env
from pendulum_model import PendulumModel
from regulator import Regulator, regulate_top
from run_directory import RunDirectory

IDS = ("PBDPendulum-v0", "PBDDoublePendulum-v0", "PBDTriplePendulum-v0")


def model_of(id):
    return PendulumModel(gymnasium.make(f"pbd_gym:{id}").unwrapped.task)


def some_states(model, count=20, seed=0):
    random = np.random.default_rng(seed)
    states = random.normal(0.0, 0.5, (count, model.size))
    states[:, model.angles] *= 3.0
    return states, random.uniform(-0.2, 0.2, count)


@pytest.mark.parametrize("id", IDS)
def test_a_state_is_read_back_from_its_observation(id):
    model = model_of(id)
    states, _ = some_states(model)
    read = model.read(model.observe(states))
    np.testing.assert_allclose(model.difference(read, states), 0.0, atol=1e-5)


def test_the_model_steps_as_the_environment_does():
    env = gymnasium.make("pbd_gym:PBDTriplePendulum-v0")
    model = PendulumModel(env.unwrapped.task)
    observation, _ = env.reset(seed=3)
    states = model.read(observation[None])
    for action in (0.15, 0.3, -0.1):
        observation, *_ = env.step(np.array([action], dtype=np.float32))
        states = model.step(states, model.push(states, np.array([action])))
    np.testing.assert_allclose(model.observe(states)[0], observation, atol=1e-4)


@pytest.mark.parametrize("id", IDS)
def test_the_linearisation_predicts_the_exact_step(id):
    model = model_of(id)
    states, pushes = some_states(model)
    joint = model.linearise(states, pushes)
    shift = np.random.default_rng(1).normal(0.0, 0.01, (len(states), model.size + 1))
    moved = model.step(states + shift[:, :-1], pushes + shift[:, -1]) - model.step(states, pushes)
    predicted = np.einsum("wij,wj->wi", joint, shift)
    assert np.abs(moved - predicted).max() < 0.05 * np.abs(moved).max()


@pytest.mark.parametrize("id", IDS)
def test_the_regulator_holds_the_top(id):
    model = model_of(id)
    feedback = regulate_top(model).feedback
    states = np.tile(model.top, (10, 1))
    states[:, model.angles] += np.random.default_rng(0).uniform(-0.02, 0.02, (10, 1))
    for _ in range(300):
        pushes = model.difference(states, model.top) @ feedback
        states = model.step(states, model.possible(states, pushes))
    assert np.abs(model.difference(states, model.top)).max() < 0.05


def some_motion(model, steps=60):
    states, pushes = [np.zeros((1, model.size))], 0.1 * np.sin(0.15 * np.arange(steps))
    for push in pushes:
        states.append(model.step(states[-1], np.array([push])))
    return np.concatenate(states), pushes


def test_a_point_of_a_motion_is_in_its_own_phase_and_keeps_its_push():
    model = model_of("PBDDoublePendulum-v0")
    states, pushes = some_motion(model)
    command = Regulator(model, states, pushes, hold=0)(states)
    np.testing.assert_allclose(command.phase[5:], np.arange(5, 61), atol=0.01)
    np.testing.assert_allclose(command.push[5:-1], pushes[5:], atol=1e-3)
    np.testing.assert_allclose(command.cost, 0.0, atol=1e-4)


def test_between_two_points_the_phase_is_between():
    model = model_of("PBDDoublePendulum-v0")
    states, pushes = some_motion(model)
    regulator = Regulator(model, states, pushes, hold=0)
    phase = regulator(0.75 * states[20:40] + 0.25 * states[21:41]).phase
    np.testing.assert_allclose(phase, np.arange(20, 40) + 0.25, atol=0.02)


def test_a_model_of_stable_baselines3_acts_as_the_student():
    env = make_sb3_vec_env("pbd_gym:PBDDoublePendulum-v0", 64, seed=0)
    seen = env.reset()
    for _ in range(5):
        seen, *_ = env.step(np.random.default_rng(0).uniform(-1, 1, (64, 1)).astype(np.float32))
    student = Student(seen, hidden=6, scale=0.2)
    kwargs = "dict(net_arch={'pi': [8, 8], 'vf': [8]}, activation_fn=nn.SiLU)"
    settings = {"policy": "MlpPolicy", "policy_kwargs": kwargs}
    ppo = algorithm_class("ppo")(env=env, **algorithm_arguments("ppo", settings))
    student.copy_to(ppo.policy)
    actions = ppo.predict(seen, deterministic=True)[0][:, 0]
    np.testing.assert_allclose(actions, np.clip(student.act(seen), -1, 1), atol=1e-5)


def small_run(folder, *options):
    return [
        *("--env", "pbd_gym:PBDPendulum-v0", "--log-dir", str(folder), "--no-video"),
        *("--candidates", "4", "--iterations", "40", "--rounds", "2", "--updates", "30"),
        *("--num-envs", "16", "--eval-episodes", "5", *options),
    ]


def test_a_run_leaves_model_curve_and_evaluation(tmp_path, capsys):
    assert imitate.main(small_run(tmp_path)) == 0
    run = RunDirectory(tmp_path / "PBDPendulum-v0-imitate-0")
    names = {file.name for file in run.path.iterdir()}
    curve = {"learning_curve.png", "learning_curve.csv"}
    assert names == {"config.yml", "imitation.yml", "model.zip", "evaluation.json"} | curve
    assert "the regulator succeeds in 100% of episodes" in capsys.readouterr().out
    point = read_csv(run.curve_table).evaluations[-1]
    assert point.timesteps > 16 * 450  # what was planned and imitated
    assert evaluate.main([str(run.path), "--episodes", "3"]) == 0
    with pytest.raises(SystemExit):
        imitate.main(small_run(tmp_path))
    assert "--overwrite" in capsys.readouterr().err


def test_ctrl_c_keeps_what_was_learned(tmp_path, monkeypatch, capsys):
    fit = Imitation._fit

    def press(self, student, progress):
        signal.raise_signal(signal.SIGINT)
        fit(self, student, progress)

    monkeypatch.setattr(Imitation, "_fit", press)
    assert imitate.main(small_run(tmp_path)) == 130
    assert "the policy is kept" in capsys.readouterr().out
    assert evaluate.main([str(tmp_path / "PBDPendulum-v0-imitate-0"), "--episodes", "3"]) == 0


def test_only_pendulums_are_imitated(tmp_path, capsys):
    for options in (["--env", "pbd_gym:PBDRope-v0"], ["--rounds", "0"], ["--env-kwargs", "mas:2"]):
        with pytest.raises(SystemExit):
            imitate.main([*options, "--no-video", "--log-dir", str(tmp_path)])
    said = capsys.readouterr().err
    for text in ("PBDRope-v0 is no pendulum", "rounds must be an integer of at least 1", "mas"):
        assert text in said
    assert not list(tmp_path.iterdir())

import runpy
import subprocess
import sys
import time
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from display import DRIVERS, choose_display, hand_on
from pbd_gym.play import Play, load_agent, main

EXAMPLE = Path(__file__).parents[1] / "examples/record_video.py"


@pytest.fixture(params=DRIVERS)
def play(request, monkeypatch):
    """A function that opens an environment and returns the program with a mouse."""
    pygame = pytest.importorskip("pygame")
    choose_display(request.param, monkeypatch)

    def open_env(name, agent=None, **options):
        program = Play(name, agent, size=400, **options)
        deadline = time.monotonic() + 300.0  # kernels may have to be compiled
        while not program.is_ready:
            program.frame()
            assert time.monotonic() < deadline
            time.sleep(0.01)
        return program, hand_on(request.param, pygame, program.frame), pygame

    yield open_env
    pygame.display.quit()


def gripper(program):
    return program._env.get_wrapper_attr("get_state")().worlds.x[0, 0]


def hold(pygame, program, name, frames):
    """Hold a key for some pictures."""
    key = pygame.key.key_code(name)
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=key))
    for _ in range(frames):
        program.frame()
    pygame.event.post(pygame.event.Event(pygame.KEYUP, key=key))
    program.frame()


def test_keys_drive_the_gripper(play):
    program, _, pygame = play("PBDRope-v0")
    start = gripper(program).copy()
    hold(pygame, program, "left", 10)
    assert gripper(program)[0] < start[0] - 0.1
    assert gripper(program)[1] == pytest.approx(start[1], abs=1e-6)  # float32


def test_the_gripper_comes_to_where_the_mouse_is_held(play):
    program, hand, _ = play("PBDRope-v0")
    target = (150, 120)
    hand.press(target)
    for _ in range(40):
        program.frame()
    pixels, _ = program._seer.project(gripper(program)[None].astype(float))
    assert np.abs(pixels[0] - target).max() < 3.0
    hand.release(target)
    assert not program.by_hand().any()


def test_the_agent_takes_over_and_gives_back(play):
    asked = []

    def agent(observation):
        asked.append(observation)
        return np.ones(2, dtype=np.float32)

    program, hand, _ = play("PBDRope-v0", agent)
    program.frame()
    assert len(asked) == 1
    hand.key("a")
    count = len(asked)
    program.frame()
    assert len(asked) == count


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    """A function that saves an untrained model of an environment and returns its path."""
    ppo = pytest.importorskip("stable_baselines3").PPO
    folder = tmp_path_factory.mktemp("models")

    def save(name, **options):
        path = folder / f"{name}-{'-'.join(options.values())}.zip"
        if not path.exists():
            env = gymnasium.make(name, **options)
            network = {"net_arch": [4]}
            ppo("MlpPolicy", env, n_steps=8, batch_size=8, policy_kwargs=network, seed=0).save(path)
        return str(path)

    return save


def test_a_saved_model_acts_on_the_observation_that_it_was_trained_on(models, play):
    for kind in ("particles", "keypoints"):
        path = models("PBDRope-v0", observation=kind)
        agent, options = load_agent(path, "ppo", "PBDRope-v0")
        assert options == {"observation": kind}
    program, hand, _ = play("PBDRope-v0", agent, **options)
    program.frame()
    assert program.by_agent
    assert program.steps == 1
    hand.key("a")
    assert not program.by_agent


def test_a_model_of_another_task_is_refused(models, capsys):
    with pytest.raises(SystemExit):
        main(["PBDCloth-v0", "--policy", models("PBDRope-v0", observation="particles")])
    assert "it was trained on another task" in capsys.readouterr().err


def test_the_example_films_a_saved_model(models, tmp_path, monkeypatch, capsys):
    pytest.importorskip("imageio_ffmpeg")
    path = models("PBDRope-v0", observation="keypoints")
    film = tmp_path / "film.mp4"
    options = ["--policy", path, "--grid", "1x2", "--size", "64", "--out", str(film)]
    monkeypatch.setattr(sys, "argv", ["record_video.py", *options])
    runpy.run_path(str(EXAMPLE), run_name="__main__")
    assert "of 2 episodes succeeded" in capsys.readouterr().out
    assert film.stat().st_size > 1_000


def test_reward_and_its_terms_are_shown_and_the_episode_ends_and_begins_again(play):
    program, _, pygame = play("PBDRope-v0", load_agent("scripted", "ppo", "PBDRope-v0")[0])
    plain = pygame.surfarray.array3d(pygame.display.get_surface())
    for _ in range(100):
        program.frame()
    assert program.ended == "Success"
    assert program.total > 10.0
    shown = pygame.surfarray.array3d(pygame.display.get_surface())
    assert (plain[400:] != shown[400:]).any(axis=2).mean() > 0.01
    for _ in range(70):  # the pause, and a little more
        program.frame()
    assert not program.ended
    assert program.steps < 20


def test_one_gripper_of_two_can_be_driven(play):
    program, hand, pygame = play("PBDCloth-v0")
    hand.key("tab")
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_UP))
    program.frame()
    np.testing.assert_array_equal(program.by_hand(), [0, 0, 1, 0, 0, 0])


def test_leaving_closes_the_window(play):
    program, _, pygame = play("PBDRope-v0")
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    program.run()
    assert not pygame.display.get_init()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["CartPole-v1"], "allowed: PBDPendulum-v0"),
        (["PBDRope-v0", "--size", "401"], "even numbers"),
        (["PBDRope-v0", "--policy", "nowhere.zip"], "nowhere.zip"),
    ],
)
def test_what_cannot_be_played_is_said(arguments, words, capsys):
    with pytest.raises(SystemExit):
        main(arguments)
    assert words in capsys.readouterr().err


def test_both_programs_explain_themselves_without_a_display():
    for program in ("pbd_gym.play", "pbd_gym.playground"):
        told = subprocess.run(
            [sys.executable, "-m", program, "--help"], capture_output=True, text=True, check=True
        )
        assert "usage: python -m " + program in told.stdout

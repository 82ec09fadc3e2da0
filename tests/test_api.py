"""Each id keeps the contracts of Gymnasium and of Stable-Baselines3."""

import copy
import pickle
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import AddRenderObservation, RecordVideo

from episodes import IDS, VARIANTS, episode, make, make_vec, nothing, parts, play, random_actions


def starts_and_steps(env, starts=4, steps=60):
    """Observations, rewards and infos of random actions from several starts."""
    observations, rewards, infos = [], [], []
    for seed in range(starts):
        (observation, _), *rest = episode(env, seed, steps)
        observations += [observation, *(step[0] for step in rest)]
        rewards += [step[1] for step in rest]
        infos += [step[4] for step in rest]
    return observations, rewards, infos


@pytest.mark.parametrize("id", IDS)
def test_gymnasium_finds_nothing_to_complain_about(id, no_screen):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(make(id, render_mode="rgb_array", render_size=(64, 64)).unwrapped)


@pytest.mark.parametrize("id", IDS)
def test_stable_baselines3_finds_nothing_to_complain_about(id):
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = make(id, render_mode="rgb_array", render_size=(64, 64))
        checker.check_env(env.unwrapped, skip_render_check=False)


@pytest.mark.parametrize("id", IDS)
def test_spaces_are_finite_float32_boxes(id):
    env = make(id)
    for space in (*parts(env.observation_space).values(), env.action_space):
        assert space.dtype == np.float32
        assert np.isfinite(space.low).all()
        assert np.isfinite(space.high).all()
    assert (env.action_space.low == -1.0).all()
    assert (env.action_space.high == 1.0).all()


@pytest.mark.parametrize("observation", ["particles", "keypoints"])
@pytest.mark.parametrize("id", IDS)
def test_every_observed_number_varies_and_stays_within_the_space(id, observation):
    env = make(id, observation=observation)
    observations, _, _ = starts_and_steps(env)
    assert all(env.observation_space.contains(one) for one in observations)
    for name in parts(observations[0]):
        varies = np.ptp([parts(one)[name] for one in observations], axis=0) > 0.0
        if (id, name) == ("PBDClothGoal-v0", "desired_goal"):
            varies[2::3] = True  # a cloth should always lie at the height of the table
        assert varies.all(), f"numbers {np.flatnonzero(~varies)} of {name} never change"


@pytest.mark.parametrize("id", VARIANTS[1:])
def test_keypoints_are_fewer_numbers_than_particles(id):
    many, few = (make(id, observation=kind) for kind in ("particles", "keypoints"))
    assert few.observation_space.shape < many.observation_space.shape


@pytest.mark.parametrize("id", IDS)
def test_rewards_are_floats_between_0_and_1(id):
    _, rewards, _ = starts_and_steps(make(id))
    assert {type(reward) for reward in rewards} == {float}
    assert min(rewards) >= 0.0
    assert max(rewards) <= 1.0


@pytest.mark.parametrize("id", IDS)
def test_info_holds_python_scalars_and_how_the_task_stands(id):
    _, _, infos = starts_and_steps(make(id), starts=1)
    for info in infos:
        assert {type(value) for value in info.values()} <= {bool, float, int}
        assert type(info["is_success"]) is bool
        assert type(info["normalized_performance"]) is float
        assert info["normalized_performance"] <= 1.0
        assert info.keys() == infos[0].keys()


@pytest.mark.parametrize("id", IDS)
def test_an_episode_is_truncated_by_the_registered_limit(id):
    env = make(id)
    _, *steps = episode(env, seed=0)
    ends = [step[2:4] for step in steps]
    assert ends[:-1] == [(False, False)] * (env.spec.max_episode_steps - 1)
    assert ends[-1] == (False, True)


@pytest.mark.parametrize("id", IDS)
def test_a_video_plays_at_the_control_rate(id):
    env = make(id)
    assert env.metadata["render_fps"] == env.unwrapped.task.control_rate
    assert make(id, control_rate=25.0).metadata["render_fps"] == 25
    assert make_vec(id, 2).metadata["render_fps"] == env.unwrapped.task.control_rate


@pytest.mark.parametrize("id", VARIANTS)
def test_a_frame_is_a_fresh_picture_of_the_asked_size(id):
    env = make(id, render_mode="rgb_array", render_size=(96, 64))
    env.reset(seed=0)
    first, second = env.render(), env.render()
    assert first.shape == (64, 96, 3)
    assert first.dtype == np.uint8
    assert first.flags.c_contiguous
    assert not np.shares_memory(first, second)
    np.testing.assert_array_equal(first, second)
    play(env, np.ones((5, *env.action_space.shape), dtype=np.float32))
    assert (env.render() != first).any()


def test_a_frame_can_be_drawn_before_the_first_reset():
    env = make("PBDRope-v0", render_mode="rgb_array").unwrapped
    assert env.render().shape == (512, 512, 3)


@pytest.mark.parametrize("id", VARIANTS)
def test_a_batch_renders_a_tuple_of_what_its_worlds_look_like(id):
    batch = make_vec(id, 2, render_mode="rgb_array", render_size=(64, 64))
    batch.reset(seed=3)
    frames = batch.render()
    assert type(frames) is tuple
    for index, frame in enumerate(frames):
        one = make(id, render_mode="rgb_array", render_size=(64, 64))
        one.reset(seed=3 + index)
        np.testing.assert_array_equal(frame, one.render())


@pytest.mark.parametrize("id", VARIANTS)
def test_frames_are_collected_where_a_list_is_asked_for(id):
    env = make(id, render_mode="rgb_array_list", render_size=(64, 64))
    env.reset(seed=0)
    play(env, random_actions(env, 3))
    frames = env.render()
    assert len(frames) == 4
    assert {frame.shape for frame in frames} == {(64, 64, 3)}


@pytest.mark.parametrize("id", VARIANTS)
def test_a_window_shows_the_episode(id, no_screen):
    env = make(id, render_mode="human", render_size=(64, 64))
    env.reset(seed=0)
    play(env, random_actions(env, 3))
    assert env.render() is None
    env.close()


@pytest.mark.parametrize("faces", [make, lambda id: make_vec(id, 2)])
def test_rendering_without_a_render_mode_warns_and_gives_nothing(faces):
    env = faces("PBDRope-v0").unwrapped
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="render_mode"):
        assert env.render() is None


def test_gymnasium_records_a_video(tmp_path):
    pytest.importorskip("moviepy")
    env = RecordVideo(
        make("PBDRope-v0", render_mode="rgb_array", render_size=(64, 64), max_episode_steps=5),
        str(tmp_path / "video"),
    )
    env.reset(seed=0)
    play(env, random_actions(env, 5))
    env.close()
    (video,) = (tmp_path / "video").glob("*.mp4")
    assert video.stat().st_size > 0


def test_pictures_can_be_the_observation():
    env = AddRenderObservation(make("PBDRope-v0", render_mode="rgb_array", render_size=(64, 64)))
    observation, _ = env.reset(seed=0)
    assert observation.shape == (64, 64, 3)
    assert env.observation_space.contains(env.step(nothing(env))[0])


@pytest.mark.parametrize("clone", [lambda env: pickle.loads(pickle.dumps(env)), copy.deepcopy])
@pytest.mark.parametrize("faces", [make, lambda id, **keywords: make_vec(id, 2, **keywords)])
@pytest.mark.parametrize("id", VARIANTS)
def test_a_copy_of_an_environment_that_has_rendered_goes_on_alone(id, faces, clone):
    env = faces(id, render_mode="rgb_array", render_size=(64, 64))
    env.reset(seed=0)
    env.render()
    twin = clone(env)
    np.testing.assert_array_equal(env.render(), twin.render())
    before = twin.unwrapped.get_state().worlds.x
    play(env, random_actions(env, 2))
    np.testing.assert_array_equal(twin.unwrapped.get_state().worlds.x, before)


@pytest.mark.parametrize("faces", [make, lambda id, **keywords: make_vec(id, 2, **keywords)])
def test_an_environment_can_be_closed_twice(faces):
    env = faces("PBDRope-v0", render_mode="rgb_array", render_size=(64, 64))
    env.reset(seed=0)
    env.render()
    env.close()
    env.close()


def test_a_window_can_be_closed_twice_and_opens_again(no_screen):
    env = make("PBDRope-v0", render_mode="human", render_size=(64, 64))
    for _ in range(2):
        env.reset(seed=0)
        env.close()
        env.close()


@pytest.mark.parametrize("id", IDS)
def test_a_specification_survives_json(id):
    spec = make(id, gravity=1.62).spec
    read = gymnasium.envs.registration.EnvSpec.from_json(spec.to_json())
    assert gymnasium.make(read).unwrapped.task == make(id, gravity=1.62).unwrapped.task


def test_metadata_of_one_environment_is_its_own():
    make("PBDRope-v0", render_mode="rgb_array_list", control_rate=10.0)
    assert make("PBDRope-v0").metadata["render_modes"] == ["rgb_array", "human"]
    assert make("PBDRope-v0").metadata["render_fps"] == 30

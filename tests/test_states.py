"""A state of get_state branches an episode exactly, in one world and in many."""

import dataclasses
import pickle

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from episodes import (
    IDS,
    MODES,
    VARIANTS,
    FragileRope,
    assert_same,
    make,
    make_vec,
    nothing,
    play,
    random_actions,
)


@pytest.mark.parametrize("id", IDS)
def test_an_episode_branches_exactly_and_so_does_the_next(id):
    env = make(id, max_episode_steps=-1)
    actions = random_actions(env, 12)
    env.reset(seed=3)
    play(env, actions[:5])
    state = env.unwrapped.get_state()
    first = [*play(env, actions[5:]), env.reset(), *play(env, actions)]
    env.unwrapped.set_state(state)
    assert_same([*play(env, actions[5:]), env.reset(), *play(env, actions)], first)


@pytest.mark.parametrize("id", VARIANTS)
def test_a_state_continues_in_another_instance(id):
    env, other = make(id, max_episode_steps=-1), make(id, max_episode_steps=-1).unwrapped
    actions = random_actions(env, 12)
    env.reset(seed=3)
    play(env, actions[:5])
    other.set_state(pickle.loads(pickle.dumps(env.unwrapped.get_state())))
    assert_same(play(other, actions[5:]), play(env, actions[5:]))
    assert_same(other.reset(), env.reset())


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("id", VARIANTS)
def test_a_batch_branches_exactly_across_its_resets(id, mode):
    env = make_vec(id, 3, max_episode_steps=6, autoreset_mode=mode)
    actions = random_actions(env, 30)
    env.reset(seed=3)
    play(env, actions[:4])
    env.reset(options={"reset_mask": np.array([False, True, False])})
    state = pickle.loads(pickle.dumps(env.unwrapped.get_state()))
    first = [*play(env, actions[4:]), env.reset()]
    env.unwrapped.set_state(state)
    assert_same([*play(env, actions[4:]), env.reset()], first)
    other = make_vec(id, 3, max_episode_steps=6, autoreset_mode=mode)
    other.unwrapped.set_state(state)
    assert_same([*play(other, actions[4:]), other.reset()], first)


@pytest.mark.parametrize("mode", MODES)
def test_a_state_knows_which_episodes_have_ended(mode):
    env = make_vec("PBDRope-v0", 4, task=FragileRope, autoreset_mode=mode)
    env.reset(seed=11)
    for action in random_actions(env, 60):
        *_, terminated, _, _ = env.step(action)
        if terminated.any():
            break
    state = env.unwrapped.get_state()
    np.testing.assert_array_equal(state.ended, terminated & (mode is not AutoresetMode.SAME_STEP))
    other = make_vec("PBDRope-v0", 4, task=FragileRope, autoreset_mode=mode)
    other.unwrapped.set_state(state)
    if mode is AutoresetMode.DISABLED:
        with pytest.raises(RuntimeError, match="ended"):
            other.step(action)
    else:
        assert_same(other.step(action), env.step(action))


@pytest.mark.parametrize("faces", [make, lambda id: make_vec(id, 2)])
def test_a_state_from_before_the_first_reset_still_asks_for_one(faces):
    env = faces("PBDRope-v0").unwrapped
    state = env.get_state()
    env.reset(seed=0)
    env.set_state(state)
    with pytest.raises(RuntimeError, match="reset"):
        env.step(nothing(env))
    first = env.reset()
    env.set_state(state)
    assert_same(env.reset(), first)


@pytest.mark.parametrize("faces", [make, lambda id: make_vec(id, 2)])
def test_a_state_is_a_copy_that_later_steps_leave_alone(faces):
    env = faces("PBDCloth-v0").unwrapped
    env.reset(seed=0)
    play(env, random_actions(env, 2))
    state = env.get_state()
    copied = pickle.loads(pickle.dumps(state))
    play(env, random_actions(env, 2))
    env.reset()
    assert_same(state, copied)
    env.set_state(state)
    play(env, random_actions(env, 2))
    env.reset()
    assert_same(state, copied)


def test_a_single_environment_continues_a_world_of_a_batch_of_one():
    batch, alone = make_vec("PBDRope-v0", 1), make("PBDRope-v0").unwrapped
    batch.reset(seed=3)
    actions = random_actions(batch, 6)
    play(batch, actions[:3])
    alone.set_state(batch.unwrapped.get_state())
    for action in actions[3:]:
        assert_same(batch.step(action)[0][0], alone.step(action[0])[0])


def foreign_states():
    """States that an environment of three ropes must refuse, by what is foreign in them."""
    states = {}
    for name, other in {
        "another model": make_vec("PBDRope-v0", 3, particles=30),
        "another task": make_vec("PBDPendulum-v0", 3),
        "another mass": make_vec("PBDRope-v0", 3, mass=0.3),
        "fewer worlds": make_vec("PBDRope-v0", 2),
        "more worlds": make_vec("PBDRope-v0", 4),
        "a single world": make("PBDRope-v0").unwrapped,
    }.items():
        other.reset(seed=8)
        states[name] = other.unwrapped.get_state()
    own = make_vec("PBDRope-v0", 3)
    own.reset(seed=8)
    state = own.unwrapped.get_state()
    states["fewer generators"] = dataclasses.replace(state, generators=state.generators[:2])
    states["fewer counters"] = dataclasses.replace(state, elapsed=state.elapsed[:2])
    states["nothing remembered"] = dataclasses.replace(state, variables={})
    goal = state.variables["goal"][:2]
    states["fewer goals"] = dataclasses.replace(state, variables=state.variables | {"goal": goal})
    return states


@pytest.mark.parametrize("foreign", sorted(foreign_states()))
def test_a_foreign_state_is_refused_and_nothing_changes(foreign):
    env = make_vec("PBDRope-v0", 3).unwrapped
    env.reset(seed=3)
    play(env, random_actions(env, 3))
    before = env.get_state()
    with pytest.raises(ValueError, match=r"the state|the snapshot"):
        env.set_state(foreign_states()[foreign])
    assert_same(env.get_state(), before)


def test_a_single_environment_refuses_a_batch_and_nothing_changes():
    env, batch = make("PBDRope-v0").unwrapped, make_vec("PBDRope-v0", 3)
    env.reset(seed=3)
    batch.reset(seed=3)
    before = env.get_state()
    with pytest.raises(ValueError, match="3 worlds"):
        env.set_state(batch.unwrapped.get_state())
    assert_same(env.get_state(), before)


@pytest.mark.parametrize("faces", [make, lambda id: make_vec(id, 2)])
@pytest.mark.parametrize("value", [None, {}, b"state"])
def test_what_is_no_state_is_refused(faces, value):
    env = faces("PBDRope-v0").unwrapped
    env.reset(seed=3)
    with pytest.raises(TypeError, match="EpisodeState"):
        env.set_state(value)

"""The same seed and actions give the same bits: again, elsewhere, alone or among many."""

import copy
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import pbd_gym
from episodes import (
    IDS,
    VARIANTS,
    assert_same,
    digest,
    episode,
    flat,
    make,
    make_vec,
    play,
    random_actions,
)

# What numpy may choose at run time on some processor; those that this one lacks are left out, as
# numpy warns of them. Names of numpy >= 2.4 first, then of those before it.
NUMPY_FEATURES = ("X86_V3", "X86_V4", "AVX512_ICL", "AVX512_SPR")
NUMPY_FEATURES += ("AVX2", "FMA3", "AVX512F", "AVX512CD", "AVX512_SKX", "AVX512_CLX", "AVX512_CNL")


@pytest.mark.parametrize("id", IDS)
def test_two_instances_play_the_same_episode(id):
    assert_same(episode(make(id), 3), episode(make(id), 3))


@pytest.mark.parametrize("id", IDS)
def test_an_episode_does_not_depend_on_the_one_before(id):
    env = make(id)
    first = episode(env, 3)
    episode(env, 4, steps=env.spec.max_episode_steps // 3)
    assert_same(episode(env, 3), first)


@pytest.mark.parametrize("id", IDS)
def test_another_seed_plays_another_episode(id):
    assert digest(make(id), 3) != digest(make(id), 4)


@pytest.mark.parametrize("id", IDS)
def test_a_reset_without_a_seed_draws_on(id):
    env, twin = make(id), make(id)
    starts = [env.reset(seed=3)[0], env.reset()[0], env.reset()[0]]
    assert_same(starts, [twin.reset(seed=3)[0], twin.reset()[0], twin.reset()[0]])
    assert len({flat(start).tobytes() for start in starts}) == 3


@pytest.mark.parametrize("clone", [lambda env: pickle.loads(pickle.dumps(env)), copy.deepcopy])
@pytest.mark.parametrize("id", IDS)
def test_a_copy_made_within_an_episode_continues_to_the_last_bit(id, clone):
    env = make(id, max_episode_steps=20)
    actions = random_actions(env, 20)
    env.reset(seed=3)
    play(env, actions[:7])
    twin = clone(env)
    assert_same(play(env, actions[7:]), play(twin, actions[7:]))
    assert_same(env.reset(), twin.reset())


@pytest.mark.parametrize("id", VARIANTS)
def test_a_copy_of_a_batch_continues_to_the_last_bit(id):
    env = make_vec(id, 3, max_episode_steps=10)
    actions = random_actions(env, 20)
    env.reset(seed=3)
    play(env, actions[:7])
    twin = pickle.loads(pickle.dumps(env))
    assert_same(play(env, actions[7:]), play(twin, actions[7:]))


@pytest.mark.parametrize("id", VARIANTS)
def test_a_thousand_worlds_on_one_thread_or_two_play_as_one_alone(id):
    one_thread, two_threads = (make_vec(id, 1000, num_threads=count) for count in (1, 2))
    actions = random_actions(one_thread, 12)
    start, _ = one_thread.reset(seed=3)
    steps = play(one_thread, actions)
    assert_same(start, two_threads.reset(seed=3)[0])
    assert_same(steps, play(two_threads, actions))
    for world in (0, 31, 32, 500, 999):
        alone = make(id)
        np.testing.assert_array_equal(alone.reset(seed=3 + world)[0], start[world])
        for action, (observation, reward, *_) in zip(actions, steps, strict=True):
            seen, earned, *_ = alone.step(action[world])
            np.testing.assert_array_equal(seen, observation[world])
            assert earned == reward[world]


def test_numpy_without_vector_instructions_plays_the_same_episodes():
    available = [name for name in NUMPY_FEATURES if numpy_dispatches(name)]
    result = run_digests(NPY_DISABLE_CPU_FEATURES=" ".join(available))
    assert result == [digest(make(id)) for id in VARIANTS]


def run_digests(**environment):
    """Digests of an episode of each variant, from a process of its own."""
    code = f"from episodes import digest, make\nfor id in {VARIANTS}: print(digest(make(id)))"
    folders = [Path(__file__).parent, Path(pbd_gym.__file__).parents[1]]
    path = os.pathsep.join(map(str, folders))
    result = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        env={**os.environ, "PYTHONPATH": path, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout.split()


def numpy_dispatches(feature):
    """Whether numpy chooses the feature at run time here."""
    try:
        from numpy._core import _multiarray_umath as core
    except ImportError:  # numpy < 2
        from numpy.core import _multiarray_umath as core
    return feature in core.__cpu_dispatch__ and core.__cpu_features__[feature]

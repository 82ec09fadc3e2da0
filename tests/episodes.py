"""Episodes that the tests of tasks and faces play."""

import hashlib
from dataclasses import dataclass
from typing import ClassVar

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import pbd_gym  # noqa: F401, registers the ids
from pbd_gym.tasks.rope import Rope

IDS = tuple(id for id in gymnasium.registry if id.startswith("PBD"))
# one of each kind of kernel: second-order pendulum, rope, cloth in space
VARIANTS = ("PBDPendulum-v0", "PBDRope-v0", "PBDCloth-v0")
MODES = tuple(AutoresetMode)


@dataclass(frozen=True, kw_only=True)
class FragileRope(Rope):
    """A rope that counts as diverged a little outside the middle, so that worlds end apart."""

    sanity_bound: ClassVar[float] = 1.05


def make(id, **keywords):
    """One world, through the name that works in every process."""
    return gymnasium.make(f"pbd_gym:{id}", **keywords)


def make_vec(id, num_envs, **keywords):
    """Worlds in one batch."""
    return gymnasium.make_vec(
        f"pbd_gym:{id}", num_envs, vectorization_mode="vector_entry_point", **keywords
    )


def make_sync(id, num_envs, autoreset_mode=AutoresetMode.NEXT_STEP, **keywords):
    """Worlds in environments of their own, stepped one after the other by Gymnasium."""
    makers = [lambda: make(id, **keywords)] * num_envs
    return SyncVectorEnv(makers, autoreset_mode=autoreset_mode)


def random_actions(env, steps, seed=0):
    """Actions (steps, *shape) of which some go beyond the space and are clipped."""
    shape = (steps, *env.action_space.shape)
    return np.random.default_rng(seed).uniform(-1.2, 1.2, shape).astype(np.float32)


def play(env, actions):
    """What the steps return, in one list."""
    return [env.step(action) for action in actions]


def episode(env, seed, steps=None, options=None):
    """Play from a seed with random actions; the observations and what the steps return."""
    first = env.reset(seed=seed, options=options)
    steps = steps or env.spec.max_episode_steps
    return [first, *play(env, random_actions(env, steps, seed))]


def digest(env, seed=5):
    """Hash of all observations and rewards of an episode."""
    (observation, _), *steps = episode(env, seed)
    observations = [flat(observation), *(flat(step[0]) for step in steps)]
    arrays = [*observations, np.array([step[1] for step in steps])]
    return hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()


def assert_same(a, b):
    """Assert that two nested results are equal in type, keys and every bit."""
    assert type(a) is type(b), (a, b)
    if isinstance(a, dict):
        assert a.keys() == b.keys()
        assert_same([a[key] for key in a], [b[key] for key in a])
    elif isinstance(a, list | tuple):
        assert len(a) == len(b)
        for one, other in zip(a, b, strict=True):
            assert_same(one, other)
    elif hasattr(a, "detach"):  # a tensor
        assert_same(a.detach().numpy(), b.detach().numpy())
    elif isinstance(a, np.ndarray) and a.dtype == object:
        assert_same(list(a), list(b))
    elif isinstance(a, np.ndarray):
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b)
    elif hasattr(a, "__dataclass_fields__"):
        assert_same(vars(a), vars(b))
    else:
        assert a == b, (a, b)


def parts(observation):
    """The arrays of an observation by name, or the boxes of its space; most have only one."""
    return dict(observation.items()) if hasattr(observation, "items") else {"": observation}


def flat(observation):
    """All numbers of an observation (..., size), those of its parts one after the other."""
    return np.concatenate(list(parts(observation).values()), axis=-1)


def nothing(env):
    """The action that asks for no motion."""
    return np.zeros(env.action_space.shape, dtype=np.float32)


def outcomes(env, policy, seed):
    """Mean reward (W,) and the last info of an episode in all worlds."""
    observation, _ = env.reset(seed=seed)
    rewards = []
    for _ in range(env.unwrapped.max_episode_steps):
        observation, reward, _, _, info = env.step(policy(observation))
        rewards.append(reward)
    return np.mean(rewards, axis=0), info


def pins(env):
    """Positions of the pins, (W, P, dim) [m]."""
    return env.unwrapped.get_state().worlds.x[:, env.unwrapped.task.model.pins].astype(np.float64)

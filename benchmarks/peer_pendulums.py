"""Swing-up of one and of two links as other packages offer it, each as its users would step it.

The tasks are not the same: one link turned by a torque or two by the torque between them, mostly in
explicit steps of the minimal coordinates; ours move the pivot. All steps are complete (observation,
reward and ends as numpy arrays), but for MuJoCo's, which is bare.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable, Iterator
from functools import partial
from importlib import resources
from typing import Any

import gymnasium
import numpy as np

from motions import Contender, Motion
from throughput import single_case, vector_case

_ACTIONS = 32


def single_pendulums(threads: int) -> Iterator[Contender]:
    """Yield ways to step pendulums of one link."""
    yield from _ours("PBDPendulum-v0", threads)
    yield Contender("gymnax", "Pendulum, numpy in and out", 4096, threads, _gymnax("Pendulum-v1"))
    yield Contender("EnvPool", "Pendulum", 1024, 1, _envpool("Pendulum-v1"))
    yield Contender("gymnasium", "Pendulum, SyncVectorEnv", 64, 1, _gymnasium("Pendulum-v1"))


def double_pendulums(threads: int) -> Iterator[Contender]:
    """Yield ways to step pendulums of two links."""
    yield from _ours("PBDDoublePendulum-v0", threads)
    yield Contender("gymnax", "Acrobot, numpy in and out", 4096, threads, _gymnax("Acrobot-v1"))
    yield Contender("EnvPool", "Acrobot", 1024, 1, _envpool("Acrobot-v1"))
    yield Contender("EnvPool", "AcrobotSwingup (dm_control)", 64, 1, _envpool("AcrobotSwingup-v1"))
    yield Contender("gymnasium", "Acrobot, SyncVectorEnv", 64, 1, _gymnasium("Acrobot-v1"))
    yield Contender("MuJoCo", "Batch, InvertedDoublePendulum, RK4", 1024, threads, _mujoco(threads))


def lone_pendulums() -> Iterator[Contender]:
    """Yield ways to step one world through `gymnasium.make`."""
    ids = {"PBDPendulum-v0": "pbd_gym", "PBDDoublePendulum-v0": "pbd_gym"}
    ids |= {"Pendulum-v1": "gymnasium", "Acrobot-v1": "gymnasium"}
    ids["InvertedDoublePendulum-v5"] = "gymnasium[mujoco]"
    for id, engine in ids.items():
        yield Contender(engine, f"make, {id}", 1, 1, partial(_alone, id=id))


def _ours(id: str, threads: int) -> Iterator[Contender]:
    for count in sorted({1, threads}):
        make = partial(_together, id=id, threads=count)
        yield Contender("pbd_gym", f"make_vec, {id}", 4096, count, make)


def _alone(worlds: int, id: str) -> Motion:
    return Motion(single_case(id).step)


def _together(worlds: int, id: str, threads: int) -> Motion:
    return Motion(vector_case(id, worlds, threads).step)


def _drawn(space: Any) -> list[Any]:
    """Return actions, drawn before the clock starts."""
    space.seed(0)
    return [space.sample() for _ in range(_ACTIONS)]


def _gymnasium(id: str) -> Callable[[int], Motion]:
    def prepare(worlds: int) -> Motion:
        env: Any = gymnasium.make_vec(id, num_envs=worlds, vectorization_mode="sync")
        env.reset(seed=0)
        actions = _drawn(env.action_space)
        return Motion(lambda k: env.step(actions[k % _ACTIONS]))

    return prepare


def _envpool(id: str) -> Callable[[int], Motion]:
    def prepare(worlds: int) -> Motion:
        envpool = importlib.import_module("envpool")
        # one thread: with two, worlds as small as these are slower
        env = envpool.make(id, env_type="gymnasium", num_envs=worlds, num_threads=1)
        env.reset()
        space = gymnasium.vector.utils.batch_space(env.action_space, worlds)
        actions = [a.astype(env.action_space.dtype) for a in _drawn(space)]
        return Motion(lambda k: env.step(actions[k % _ACTIONS]))

    return prepare


def _gymnax(id: str) -> Callable[[int], Motion]:
    def prepare(worlds: int) -> Motion:
        os.environ.setdefault("JAX_PLATFORMS", "cpu")
        jax, gymnax = (importlib.import_module(name) for name in ("jax", "gymnax"))
        env, parameters = gymnax.make(id)
        key = jax.random.PRNGKey(0)
        over_worlds = jax.vmap(env.reset, (0, None))
        _, state = over_worlds(jax.random.split(key, worlds), parameters)
        draw = jax.vmap(env.action_space(parameters).sample)
        keys = jax.random.split(key, _ACTIONS)
        actions = [np.asarray(draw(jax.random.split(each, worlds))) for each in keys]
        advance = jax.vmap(env.step, (0, 0, 0, None))

        @jax.jit
        def steps(key: Any, state: Any, action: Any) -> Any:
            key, used = jax.random.split(key)
            observation, state, *outcome = advance(
                jax.random.split(used, worlds), state, action, parameters
            )
            return key, state, (observation, *outcome[:2])

        def step(k: int) -> None:
            nonlocal key, state
            key, state, outcome = steps(key, state, actions[k % _ACTIONS])
            for part in outcome:
                np.asarray(part)

        return Motion(step)

    return prepare


def _mujoco(threads: int) -> Callable[[int], Motion]:
    def prepare(worlds: int) -> Motion:
        mujoco, batches = (importlib.import_module(name) for name in ("mujoco", "mujoco.batch"))
        assets = resources.files(gymnasium) / "envs/mujoco/assets"
        scene = (assets / "inverted_double_pendulum.xml").read_text(encoding="utf-8")
        model = mujoco.MjModel.from_xml_string(scene)
        batch = batches.Batch(model, worlds, threads)
        batch.reset()
        state, control = [batch.bind(name) for name in ("qpos", "qvel")], batch.bind("ctrl")
        pushes = np.random.default_rng(0).uniform(-1.0, 1.0, (_ACTIONS, *control.shape))

        def step(k: int) -> None:
            control[:] = pushes[k % _ACTIONS]
            batch.step(nstep=5)
            np.concatenate(state, axis=1, dtype=np.float32)

        return Motion(step)

    return prepare

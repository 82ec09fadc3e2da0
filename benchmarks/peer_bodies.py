"""Ropes and cloths as peers step them: the scenes of `driven.py`, in batches where there are any.

What ours does in each control step beside the physics (observation, reward, info, autoreset) is not
asked of the peers: positions are read, as float32, and that is all.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from functools import partial
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

from accuracy_cloth import mujoco_cloth, pypbd_cloth
from accuracy_engines import mujoco_chain, peer, pymunk_chain, pypbd_chain
from accuracy_scenes import FRAME, SCENES
from driven import driven_cloth
from driven_tasks import FRAMES, DrivenCloth, DrivenRope
from motions import Contender, Motion, frame
from peer_newton import newton_rope

ROPE = SCENES[-1]
_HINGES = "hinges in a plane, Euler, dt 1/120"


def ropes(threads: int) -> Iterator[Contender]:
    """Yield ways to step the driven rope of 32 particles, in settings about as exact as ours."""
    for count in sorted({1, threads}):
        make = partial(_ours, threads=count, id="PBDRope-v0", task=DrivenRope())
        yield Contender("pbd_gym", "make_vec, 5 substeps", 4096, count, make)
    yield Contender(
        "MuJoCo", f"Batch, {_HINGES}", 256, threads, partial(_mujoco_rope, threads=threads)
    )  # fmt: skip
    yield Contender(
        "MuJoCo", "Batch, ball joints, implicitfast, dt 1/60", 64, threads,
        partial(_mujoco_balls, threads=threads),
    )  # fmt: skip
    yield from _unbatched_ropes()
    yield Contender("newton", "XPBD, 10 substeps x 10", 64, 1, newton_rope)


def single_ropes() -> Iterator[Contender]:
    """Yield ways to step one driven rope: ours through `gymnasium.make`, complete."""
    yield Contender("pbd_gym", "make, 5 substeps", 1, 1, lambda _: _ours_alone())
    yield Contender("MuJoCo", _HINGES, 1, 1, lambda _: _mujoco_rope(1, 1))
    yield from _unbatched_ropes()


def _unbatched_ropes() -> Iterator[Contender]:
    yield Contender("pyPBD", "10 substeps x 5", 1, 1, lambda _: _pypbd_rope(10, 5))
    yield Contender("pymunk", "30 steps x 10", 1, 1, lambda _: _pymunk_rope(30, 10))


def cloths(size: int, threads: int) -> Iterator[Contender]:
    """Yield ways to step the driven cloth of size x size particles."""
    worlds = 65_536 // size**2
    for count in sorted({1, threads}):
        task = DrivenCloth(particles=size)
        make = partial(_ours, threads=count, id="PBDCloth-v0", task=task)
        yield Contender("pbd_gym", "make_vec, 16 substeps", worlds, count, make)
    for solver in ("Newton", "CG"):
        yield Contender(
            "MuJoCo", f"Batch, FEM, discrete, {solver}, dt 1/60", 16, threads,
            partial(_mujoco_cloth, threads=threads, size=size, solver=solver),
        )  # fmt: skip
    yield Contender("pyPBD", "20 substeps x 1", 1, 1, lambda _: _pypbd_cloth(size, 20, 1))


def actions_along(task: Any) -> np.ndarray:
    """Return the actions (FRAMES, size) that move the pins of a driven task along their path."""
    targets = task.scene.targets
    places = np.array([targets(k * FRAME) for k in range(FRAMES + 1)])
    moves = np.diff(places, axis=0) / (FRAME * task.max_speed)
    return moves.reshape(FRAMES, -1).astype(np.float32)


def _ours(worlds: int, threads: int, id: str, task: Any) -> Motion:
    """Step environments, complete; their episodes end at staggered times."""
    env: Any = gymnasium.make_vec(
        id,
        num_envs=worlds,
        vectorization_mode="vector_entry_point",
        autoreset_mode=AutoresetMode.SAME_STEP,
        num_threads=threads,
        stagger=True,
        task=type(task),
        particles=task.particles,
        max_episode_steps=FRAMES,
    )
    env.reset(seed=0)
    actions, ages = actions_along(task), np.zeros(worlds, dtype=np.int64)

    def step(_: int) -> None:
        _, _, terminated, truncated, _ = env.step(actions[ages])
        ages[:] = np.where(terminated | truncated, 0, ages + 1)

    return Motion(step, lambda: env.unwrapped.get_state().worlds.x[0])


def _ours_alone() -> Motion:
    """Step one environment through `gymnasium.make`, complete."""
    env: Any = gymnasium.make("PBDRope-v0", task=DrivenRope, max_episode_steps=FRAMES)
    env.reset(seed=0)
    actions = list(actions_along(DrivenRope()))

    def step(k: int) -> None:
        _, _, terminated, truncated, _ = env.step(actions[k % FRAMES])
        if terminated or truncated:
            env.reset()

    return Motion(step, lambda: env.unwrapped.get_state().worlds.x[0])


def _batch(model: Any, worlds: int, threads: int) -> Any:
    """Return MuJoCo's native batch of a model."""
    batch = importlib.import_module("mujoco.batch").Batch(model, worlds, threads)
    batch.reset()
    return batch


def _mujoco_rope(worlds: int, threads: int) -> Motion:
    """Step chains of hinges. Their pivot stays, and everything is pushed the other way."""
    # the longest steps, and the least damping and armature, at which the chain outlives the scene
    steps = 2
    model = mujoco_chain(ROPE, "Euler", steps, 'damping="1e-3" armature="1e-5"')
    batch = _batch(model, worlds, threads)
    angles, gravity = batch.bind("qpos"), batch.expand("opt.gravity")
    times = (np.arange(FRAMES * steps) + 0.5) * (FRAME / steps)
    push = [-ROPE.pivot_acceleration(at) for at in times]
    latest = 0

    def step(k: int) -> None:
        nonlocal latest
        latest = frame(k)
        for part in range(steps):
            gravity[:, 0] = push[latest * steps + part]
            batch.step()
        angles.astype(np.float32)

    def places() -> np.ndarray:
        turned = np.cumsum(angles[0])
        links = ROPE.lengths[:, None] * np.stack([np.sin(turned), -np.cos(turned)], 1)
        pivot = [[ROPE.pivot((latest + 1) * FRAME), 0.0]]
        return np.cumsum(np.concatenate([pivot, links]), axis=0)

    return Motion(step, places)


def _mujoco_balls(worlds: int, threads: int) -> Motion:
    """Step capsules on ball joints in space, which an armature keeps stable at 1/60 s."""
    mujoco = peer("MuJoCo")
    link, bodies = ROPE.lengths[0], ""
    for index, mass in enumerate(ROPE.masses):
        bodies += (
            f'<body pos="0 0 {-link if index else 0}"><joint type="ball" damping="3e-3" '
            f'armature="1e-4"/><geom type="capsule" fromto="0 0 0 0 0 {-link}" size="0.005" '
            f'mass="{mass}"/>'
        )
    site = f'<site name="end" pos="0 0 {-link}"/>'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{FRAME}" integrator="implicitfast"><flag contact="disable"/>'
        '</option><worldbody><body><joint name="along" type="slide" axis="1 0 0"/><geom size="0.02"'
        f' mass="100"/>{bodies}{site}{"</body>" * len(ROPE.masses)}</body></worldbody><actuator>'
        f'<velocity joint="along" kv="{80.0 / FRAME}"/></actuator></mujoco>'
    )
    batch = _batch(model, worlds, threads)
    speeds = np.diff([ROPE.pivot(k * FRAME) for k in range(FRAMES + 1)]) / FRAME
    control, x, end = batch.bind("ctrl"), batch.bind("xpos"), batch.bind("site_xpos")

    def step(k: int) -> None:
        control[:, 0] = speeds[frame(k)]
        batch.step(stage=mujoco.mjtStage.mjSTAGE_POS)
        x.astype(np.float32)

    return Motion(step, lambda: np.concatenate([x[0, 2:], end[0]])[:, [0, 2]])


def _pypbd_rope(substeps: int, iterations: int) -> Motion:
    simulation = pypbd_chain(ROPE, FRAME, iterations, substeps)
    model, stepper = simulation.getModel(), simulation.getTimeStep()
    points = model.getParticles()
    pivots = [(ROPE.pivot((k + 1) * FRAME), 0.0, 0.0) for k in range(FRAMES)]

    def places() -> np.ndarray:
        return np.array(points.getVertices(), dtype=np.float32)

    def step(k: int) -> None:
        points.setPosition(0, pivots[frame(k)])
        stepper.step(model)
        places()

    return Motion(step, lambda: places()[:, :2])


def _pymunk_rope(steps: int, iterations: int) -> Motion:
    space, bodies = pymunk_chain(ROPE, iterations, 1e-20)
    dt = FRAME / steps
    speeds = np.diff([ROPE.pivot(k * dt) for k in range(FRAMES * steps + 1)]) / dt

    def places() -> np.ndarray:
        return np.array([body.position for body in bodies], dtype=np.float32)

    def step(k: int) -> None:
        for part in range(steps):
            bodies[0].velocity = (speeds[frame(k) * steps + part], 0.0)
            space.step(dt)
        places()

    return Motion(step, places)


def _mujoco_cloth(worlds: int, threads: int, size: int, solver: str) -> Motion:
    model = mujoco_cloth(size, 1, solver)
    batch = _batch(model, worlds, threads)
    corner, x = batch.bind("mocap_pos"), batch.bind("flexvert_xpos")
    targets = driven_cloth(size).targets
    path = [targets((k + 1) * FRAME)[1] for k in range(FRAMES)]

    def step(k: int) -> None:
        corner[:, 1] = path[frame(k)]
        batch.step()
        x.astype(np.float32)

    return Motion(step, lambda: x[0])


def _pypbd_cloth(size: int, substeps: int, iterations: int) -> Motion:
    simulation = pypbd_cloth(size, FRAME, iterations, substeps)
    model, stepper = simulation.getModel(), simulation.getTimeStep()
    points = model.getParticles()
    targets = driven_cloth(size).targets
    path = [targets((k + 1) * FRAME)[1] for k in range(FRAMES)]

    def places() -> np.ndarray:
        return np.array(points.getVertices(), dtype=np.float32)

    def step(k: int) -> None:
        along, across, _ = path[frame(k)]
        points.setPosition(size - 1, (along, 0.0, across))
        stepper.step(model)
        places()

    return Motion(step, places)

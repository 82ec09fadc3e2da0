"""The engines that run the accuracy scenes: ours, and each peer as its users would set it up.

An engine prepares a scene and returns a function that runs it from the start: it returns where the
last point is after every 1/60 s, (frames, 2), and the seconds that one of its worlds took.
"""

from __future__ import annotations

import importlib
import importlib.util
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from accuracy_scenes import FRAME, GRAVITY, ChainScene
from pbd_gym.physics import ModelBuilder, World

Run = Callable[[], tuple[np.ndarray, float]]
# Worlds of our batch and of MuJoCo's: enough for full vector registers.
_WORLDS = 256
_MODULES = {"MuJoCo": "mujoco", "pyPBD": "pypbd", "pymunk": "pymunk"}


@dataclass(frozen=True)
class Entry:
    """One way to run one scene.

    Attributes:
        engine: Its name in the figure.
        setting: What was chosen, in words.
        prepare: Builds the scene and returns what runs it.
    """

    engine: str
    setting: str
    prepare: Callable[[ChainScene], Run]


def peer(engine: str) -> Any:
    """Return the module of a peer; typed loosely, as few of them carry types."""
    return importlib.import_module(_MODULES[engine])


def is_installed(engine: str) -> bool:
    """Tell whether an engine can be loaded."""
    return engine not in _MODULES or importlib.util.find_spec(_MODULES[engine]) is not None


def ours() -> Iterator[Entry]:
    """Yield both integrators of this package, in a batch on one thread."""
    choices = [("pbd", np.float32, 1), ("rattle", np.float32, 1), ("rattle", np.float64, 2)]
    for integrator, dtype, iterations in choices:
        for substeps in (1, 2, 4, 8, 16, 32, 64):
            yield Entry(
                f"pbd_gym {integrator} {np.dtype(dtype)}",
                f"{substeps} substeps x {iterations}",
                lambda scene, s=substeps, i=integrator, n=iterations, d=dtype: _ours(
                    scene, i, s, n, d
                ),
            )


def _ours(scene: ChainScene, integrator: str, substeps: int, iterations: int, dtype: Any) -> Run:
    builder = ModelBuilder(2)
    start = scene.start
    points = [builder.add_particles(start[0], 1.0, pinned=True)[0]]
    for place, mass in zip(start[1:], scene.masses, strict=True):
        points.append(builder.add_particles(place, mass)[0])
    builder.add_chain(points, rest=scene.lengths)
    model = builder.build(gravity=(0.0, -GRAVITY), integrator=integrator, iterations=iterations)
    world = World(model, _WORLDS, num_threads=1, dtype=dtype)
    # the pivot's path is followed in straight pieces, at most four substeps long
    pieces = -(-substeps // 4) if scene.amplitude else 1
    targets = np.zeros((scene.frames * pieces, _WORLDS, 1, 2), dtype=dtype)
    steps = np.arange(1, scene.frames * pieces + 1) * (FRAME / pieces)
    targets[:, :, 0, 0] = np.array([scene.pivot(at) for at in steps])[:, None]

    def run() -> tuple[np.ndarray, float]:
        world.x[:], world.v[:] = start, 0.0
        tip = np.empty((scene.frames, 2))
        began = time.perf_counter()
        for frame in range(scene.frames):
            for piece in range(pieces):
                target = targets[frame * pieces + piece]
                world.step(FRAME / pieces, substeps // pieces, target)
            tip[frame] = world.x[0, -1]
        return tip, (time.perf_counter() - began) / _WORLDS

    world.step(FRAME / pieces, substeps // pieces, targets[0])
    return run


def mujoco() -> Iterator[Entry]:
    """Yield MuJoCo: a chain of hinges, which keeps its length by construction."""
    for integrator in ("Euler", "implicitfast", "RK4"):
        for steps in (1, 2, 4, 8, 16, 32, 64):
            yield Entry(
                "MuJoCo",
                f"{integrator} dt 1/{60 * steps}",
                lambda scene, i=integrator, n=steps: _mujoco(scene, i, n),
            )


def mujoco_chain(scene: ChainScene, integrator: str, steps: int, joint: str = "") -> Any:
    """Return MuJoCo's model of a chain of hinges whose pivot stays, so many steps per 1/60 s."""
    bodies, place = "", "0 0 0"
    for length, mass in zip(scene.lengths, scene.masses, strict=True):
        # MuJoCo wants an inertia: one so small that the links are point masses on rods
        inertia = 1e-6 * mass * length**2
        bodies += (
            f'<body pos="{place}"><joint type="hinge" axis="0 -1 0" {joint}/><inertial '
            f'pos="0 0 {-length}" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>'
        )
        place = f"0 0 {-length}"
    return peer("MuJoCo").MjModel.from_xml_string(
        f'<mujoco><option timestep="{FRAME / steps}" integrator="{integrator}" '
        f'gravity="0 0 {-GRAVITY}"><flag contact="disable" constraint="disable"/></option>'
        f"<worldbody>{bodies}{'</body>' * len(scene.masses)}</worldbody></mujoco>"
    )


def _mujoco(scene: ChainScene, integrator: str, steps: int) -> Run:
    mj = peer("MuJoCo")
    model = mujoco_chain(scene, integrator, steps)
    data = mj.MjData(model)
    times = (np.arange(scene.frames * steps) + 0.5) * (FRAME / steps)
    push = [-scene.pivot_acceleration(at) for at in times]
    pivots = [scene.pivot((frame + 1) * FRAME) for frame in range(scene.frames)]

    def run() -> tuple[np.ndarray, float]:
        mj.mj_resetData(model, data)
        data.qpos[:] = np.diff(np.concatenate([[0.0], scene.angles]))
        turns = np.empty((scene.frames, len(scene.masses)))
        began = time.perf_counter()
        for frame in range(scene.frames):
            if scene.amplitude:
                # the pivot stays and everything is pushed the other way: the same motion
                for step in range(steps):
                    model.opt.gravity[0] = push[frame * steps + step]
                    mj.mj_step(model, data)
            else:
                mj.mj_step(model, data, steps)
            turns[frame] = data.qpos
        seconds = time.perf_counter() - began
        angles = np.cumsum(turns, axis=1)
        tip = np.stack([np.sin(angles) @ scene.lengths, -np.cos(angles) @ scene.lengths], 1)
        tip[:, 0] += pivots
        return tip, seconds

    return run


def pypbd() -> Iterator[Entry]:
    """Yield pyPBD: distance constraints, velocities of first order (the second doubles gravity)."""
    for substeps in (1, 4, 16, 64, 256):
        for iterations in (1, 5, 20):
            yield Entry(
                "pyPBD",
                f"{substeps} substeps x {iterations}",
                lambda scene, s=substeps, n=iterations: _pypbd(scene, s, n),
            )


def pypbd_chain(scene: ChainScene, h: float, iterations: int, substeps: int = 1) -> Any:
    """Return pyPBD's simulation of a chain; its particle 0 is the pivot."""
    simulation = fresh_simulation(peer("pyPBD"), h, iterations, substeps)
    model = simulation.getModel()
    points = model.getParticles()
    for index, (x, y) in enumerate(scene.start):
        points.addVertex(np.array([x, y, 0.0]))
        points.setMass(index, scene.masses[index - 1] if index else 0.0)
    for index in range(len(scene.masses)):
        model.addDistanceConstraint(index, index + 1, 1.0)
    return simulation


def _pypbd(scene: ChainScene, substeps: int, iterations: int) -> Run:
    times = np.arange(1, scene.frames * substeps + 1) * (FRAME / substeps)
    pivots = [(scene.pivot(at), 0.0, 0.0) for at in times]

    def run() -> tuple[np.ndarray, float]:
        simulation = pypbd_chain(scene, FRAME / substeps, iterations)
        model = simulation.getModel()
        points = model.getParticles()
        stepper, last = simulation.getTimeStep(), len(scene.masses)
        stepper.step(model)  # groups the constraints; the run begins after it
        for index, (x, y) in enumerate(scene.start):
            points.setPosition(index, (x, y, 0.0))
            points.setVelocity(index, (0.0, 0.0, 0.0))
        tip = np.empty((scene.frames, 2))
        began = time.perf_counter()
        for frame in range(scene.frames):
            for substep in range(substeps):
                points.setPosition(0, pivots[frame * substeps + substep])
                stepper.step(model)
            tip[frame] = points.getPosition(last)[:2]
        return tip, time.perf_counter() - began

    return run


def fresh_simulation(pbd: Any, h: float, iterations: int, substeps: int = 1) -> Any:
    """Return pyPBD's one simulation, emptied, with a time step and what is done in it.

    A pin can be moved in every substep only where a step has no more than one.
    """
    pbd.Logger.activated = False
    simulation = pbd.Simulation.getCurrent()
    if simulation.getModel() is None:
        simulation.initDefault()
    simulation.getModel().cleanup()
    simulation.getModel().init()
    stepper = simulation.getTimeStep()
    stepper.setValueUInt(pbd.TimeStepController.NUM_SUB_STEPS, substeps)
    stepper.setValueUInt(pbd.TimeStepController.MAX_ITERATIONS, iterations)
    pbd.TimeManager.getCurrent().setTimeStepSize(h)
    return simulation


def pymunk() -> Iterator[Entry]:
    """Yield pymunk: point masses on pin joints."""
    for steps, iterations in product((1, 5, 10, 30, 100), (10, 40)):
        for error_bias in (1e-20, 0.0):
            yield Entry(
                "pymunk",
                f"dt 1/{60 * steps}, {iterations} iterations, error bias {error_bias}",
                lambda scene, s=steps, n=iterations, e=error_bias: _pymunk(scene, s, n, e),
            )


def pymunk_chain(scene: ChainScene, iterations: int, error_bias: float) -> tuple[Any, list[Any]]:
    """Return pymunk's space and bodies of a chain; body 0 is the pivot, to be moved by velocity."""
    pm = peer("pymunk")
    space = pm.Space()
    space.gravity, space.iterations = (0.0, -GRAVITY), iterations
    bodies = [pm.Body(body_type=pm.Body.KINEMATIC)]
    space.add(bodies[0])
    for mass, place in zip(scene.masses, scene.start[1:], strict=True):
        body = pm.Body(mass, float("inf"))
        body.position = tuple(place)
        joint = pm.PinJoint(bodies[-1], body)
        # the share of a length error that is left after a second: the default drifts apart
        joint.error_bias = error_bias
        space.add(body, joint)
        bodies.append(body)
    return space, bodies


def _pymunk(scene: ChainScene, steps: int, iterations: int, error_bias: float) -> Run:
    dt = FRAME / steps
    times = np.arange(1, scene.frames * steps + 1) * dt
    path = np.array([0.0, *(scene.pivot(at) for at in times)])
    speeds = np.diff(path) / dt

    def run() -> tuple[np.ndarray, float]:
        space, bodies = pymunk_chain(scene, iterations, error_bias)
        tip = np.empty((scene.frames, 2))
        began = time.perf_counter()
        for frame in range(scene.frames):
            for step in range(steps):
                bodies[0].velocity = (speeds[frame * steps + step], 0.0)
                space.step(dt)
            tip[frame] = bodies[-1].position
        return tip, time.perf_counter() - began

    return run


ENGINES = {"pbd_gym": ours, "MuJoCo": mujoco, "pyPBD": pypbd, "pymunk": pymunk}

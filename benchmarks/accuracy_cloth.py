"""A cloth that hangs by two corners, one of which is driven: how far its threads are stretched.

No exact motion is known here; a cloth that does not stretch is what all engines are asked for.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any

import numpy as np

from accuracy_engines import fresh_simulation, peer
from accuracy_scenes import FRAME, GRAVITY, ramp
from driven import MASS, driven_cloth
from pbd_gym.physics import World

SIZE = 16
# The corners come together for a second and hang for one, then the driven one swings for two.
_SETTLE, _SWING = 120, 120
FRAMES = _SETTLE + _SWING
_WORLDS = 32

ClothRun = Callable[[], tuple[float, float]]


@dataclass(frozen=True)
class ClothEntry:
    """One way to run the cloth; it returns worst strain and seconds of one world."""

    engine: str
    setting: str
    prepare: Callable[[], ClothRun]


def corner(at: float) -> tuple[float, float]:
    """Return where the driven corner is, seen from the fixed one: along the edge and across [m]."""
    share = ramp(at / 1.0 * 0.5)[0]
    reach = 1.0 - (1.0 - 1.0 / 1.1) * share
    swing = max(at - _SETTLE * FRAME, 0.0)
    angle = 0.25 * ramp(swing)[0] * np.sin(2.0 * np.pi * swing)
    return float(reach * np.cos(angle)), float(reach * np.sin(angle))


def worst_strain(x: np.ndarray) -> float:
    """Return the greatest stretch of a link along a thread of 1 m; x is (..., size, size, 3)."""
    worst = 0.0
    for axis in (-3, -2):
        lengths = np.sqrt(np.sum(np.diff(x, axis=axis) ** 2, axis=-1))
        worst = max(worst, float((lengths * (x.shape[axis] - 1) - 1.0).max()))
    return worst if np.isfinite(x).all() else float("inf")


def _our_entries() -> Iterator[ClothEntry]:
    for substeps in (5, 10, 20, 40):
        yield ClothEntry("pbd_gym pbd float32", f"{substeps} substeps", lambda s=substeps: _ours(s))


def _mujoco_entries() -> Iterator[ClothEntry]:
    for steps, solver in product((1, 2, 4), ("Newton", "CG")):
        setting = f"FEM, discrete, {solver}, dt 1/{60 * steps}"
        yield ClothEntry("MuJoCo", setting, lambda n=steps, s=solver: _mujoco(n, s))


def _pypbd_entries() -> Iterator[ClothEntry]:
    for substeps, iterations in product((10, 20, 40), (1, 5)):
        setting = f"{substeps} substeps x {iterations}"
        yield ClothEntry("pyPBD", setting, lambda s=substeps, n=iterations: _pypbd(s, n))


def _ours(substeps: int) -> ClothRun:
    model = driven_cloth(SIZE).model
    world = World(model, _WORLDS, num_threads=1)
    targets = np.zeros((FRAMES, _WORLDS, 2, 3), dtype=np.float32)
    for frame in range(FRAMES):
        targets[frame, :, 1, :2] = corner((frame + 1) * FRAME)

    def run() -> tuple[float, float]:
        world.x[:], world.v[:] = model.positions, 0.0
        worst, seconds = 0.0, 0.0
        for frame in range(FRAMES):
            began = time.perf_counter()
            world.step(FRAME, substeps, targets[frame])
            if frame >= _SETTLE:
                seconds += time.perf_counter() - began
                x = world.x[0].reshape(SIZE, SIZE, 3).astype(np.float64)
                worst = max(worst, worst_strain(x))
        return worst, seconds / _WORLDS

    return run


def mujoco_cloth(size: int, steps: int, solver: str) -> Any:
    """Return MuJoCo's model of a cloth of 1 m (steps per 1/60 s).

    Mocap body 1 drives a corner. Vertex 0 is the lower left one; the columns run upwards.
    """
    fixed, driven, spacing = size - 1, size * size - 1, 1.0 / (size - 1)
    hold = 'anchor="0 0 0" solref="0.001 1" solimp="0.999 0.9999 0.001"'
    return peer("MuJoCo").MjModel.from_xml_string(
        f'<mujoco><option timestep="{FRAME / steps}" gravity="0 0 {-GRAVITY}" '
        f'integrator="discrete" solver="{solver}" iterations="50">'
        '<flag contact="disable"/></option><worldbody>'
        '<body name="fixed" mocap="true"/><body name="driven" mocap="true" pos="1 0 0"/>'
        f'<flexcomp name="cloth" type="grid" dim="2" count="{size} {size} 1" mass="{MASS}" '
        f'spacing="{spacing} {spacing} {spacing}" radius="0.001" euler="90 0 0" '
        'pos="0.5 0 -0.5"><contact selfcollide="none"/><elasticity young="3e6" poisson="0" '
        'thickness="1e-3" elastic2d="stretch" damping="1e-3"/></flexcomp></worldbody><equality>'
        f'<connect body1="cloth_{fixed}" body2="fixed" {hold}/>'
        f'<connect body1="cloth_{driven}" body2="driven" {hold}/></equality></mujoco>'
    )


def _mujoco(steps: int, solver: str) -> ClothRun:
    mj = peer("MuJoCo")
    model = mujoco_cloth(SIZE, steps, solver)
    data = mj.MjData(model)

    def run() -> tuple[float, float]:
        mj.mj_resetData(model, data)
        worst, seconds = 0.0, 0.0
        for frame in range(FRAMES):
            began = time.perf_counter()
            for step in range(steps):
                data.mocap_pos[1, :2] = corner((frame + (step + 1) / steps) * FRAME)
                mj.mj_step(model, data)
            if frame >= _SETTLE:
                seconds += time.perf_counter() - began
                worst = max(worst, worst_strain(data.flexvert_xpos.reshape(SIZE, SIZE, 3)))
        return worst, seconds

    return run


def pypbd_cloth(size: int, h: float, iterations: int, substeps: int = 1) -> Any:
    """Return pyPBD's simulation of a cloth: rows, columns and soft diagonals.

    The particle that drives a corner is `size - 1`; gravity points along -y.
    """
    simulation = fresh_simulation(peer("pyPBD"), h, iterations, substeps)
    model, spacing = simulation.getModel(), 1.0 / (size - 1)
    points = model.getParticles()
    for row, column in product(range(size), repeat=2):
        points.addVertex(np.array([column * spacing, -row * spacing, 0.0]))
        index = row * size + column
        points.setMass(index, 0.0 if index in (0, size - 1) else MASS / size**2)
    grid = np.arange(size * size).reshape(size, size)
    for thread in (*grid, *grid.T):
        for a, b in pairwise(thread):
            model.addDistanceConstraint(int(a), int(b), 1.0)
    for a, b in ((grid[:-1, :-1], grid[1:, 1:]), (grid[:-1, 1:], grid[1:, :-1])):
        for i, j in zip(a.ravel(), b.ravel(), strict=True):
            model.addDistanceConstraint_XPBD(int(i), int(j), 1e3)
    return simulation


def _pypbd(substeps: int, iterations: int) -> ClothRun:
    def run() -> tuple[float, float]:
        simulation = pypbd_cloth(SIZE, FRAME / substeps, iterations)
        model = simulation.getModel()
        points = model.getParticles()
        stepper = simulation.getTimeStep()
        worst, seconds = 0.0, 0.0
        for frame in range(FRAMES):
            began = time.perf_counter()
            for substep in range(substeps):
                x, y = corner((frame + (substep + 1) / substeps) * FRAME)
                points.setPosition(SIZE - 1, (x, 0.0, y))
                stepper.step(model)
            if frame >= _SETTLE:
                seconds += time.perf_counter() - began
                worst = max(worst, worst_strain(_positions(points)))
        return worst, seconds

    return run


def _positions(points: Any) -> np.ndarray:
    places = [points.getPosition(index) for index in range(SIZE * SIZE)]
    return np.array(places).reshape(SIZE, SIZE, 3)


CLOTH_ENGINES = {"pbd_gym": _our_entries, "MuJoCo": _mujoco_entries, "pyPBD": _pypbd_entries}

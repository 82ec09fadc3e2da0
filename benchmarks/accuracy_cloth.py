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

from pbd_gym.physics import ModelBuilder, World, shapes

SIZE = 16
_MASS = 0.2
_SPACING = 1.0 / (SIZE - 1)
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
    """Return the greatest stretch of a link along a thread; x is (..., SIZE, SIZE, 3)."""
    worst = 0.0
    for axis in (-3, -2):
        lengths = np.sqrt(np.sum(np.diff(x, axis=axis) ** 2, axis=-1))
        worst = max(worst, float((lengths / _SPACING - 1.0).max()))
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
    builder = ModelBuilder(3)
    grid = shapes.cloth(
        builder,
        (0.0, 0.0, 0.0),
        (0.0, 0.0, -1.0),
        (1.0, 0.0, 0.0),
        (SIZE, SIZE),
        mass=_MASS,
        stretch_compliance=0.0,
    )
    builder.pin([grid[0, 0], grid[0, -1]])
    model = builder.build(gravity=(0.0, 0.0, -GRAVITY))
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


def _mujoco(steps: int, solver: str) -> ClothRun:
    mj = peer("MuJoCo")

    # vertex 0 is the lower left one; the columns run upwards
    fixed, driven = SIZE - 1, SIZE * SIZE - 1
    hold = 'anchor="0 0 0" solref="0.001 1" solimp="0.999 0.9999 0.001"'
    model = mj.MjModel.from_xml_string(
        f'<mujoco><option timestep="{FRAME / steps}" gravity="0 0 {-GRAVITY}" '
        f'integrator="discrete" solver="{solver}" iterations="50">'
        '<flag contact="disable"/></option><worldbody>'
        '<body name="fixed" mocap="true"/><body name="driven" mocap="true" pos="1 0 0"/>'
        f'<flexcomp name="cloth" type="grid" dim="2" count="{SIZE} {SIZE} 1" mass="{_MASS}" '
        f'spacing="{_SPACING} {_SPACING} {_SPACING}" radius="0.001" euler="90 0 0" '
        'pos="0.5 0 -0.5"><contact selfcollide="none"/><elasticity young="3e6" poisson="0" '
        'thickness="1e-3" elastic2d="stretch" damping="1e-3"/></flexcomp></worldbody><equality>'
        f'<connect body1="cloth_{fixed}" body2="fixed" {hold}/>'
        f'<connect body1="cloth_{driven}" body2="driven" {hold}/></equality></mujoco>'
    )
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


def _pypbd(substeps: int, iterations: int) -> ClothRun:
    pbd = peer("pyPBD")

    def run() -> tuple[float, float]:
        simulation = fresh_simulation(pbd, FRAME / substeps, iterations)
        model = simulation.getModel()
        points = model.getParticles()
        _weave(model, points)
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


def _weave(model: Any, points: Any) -> None:
    """Add rows, columns and soft diagonals to pyPBD's model; its gravity points along -y."""
    for row in range(SIZE):
        for column in range(SIZE):
            points.addVertex(np.array([column * _SPACING, -row * _SPACING, 0.0]))
            index = row * SIZE + column
            points.setMass(index, 0.0 if index in (0, SIZE - 1) else _MASS / SIZE**2)
    grid = np.arange(SIZE * SIZE).reshape(SIZE, SIZE)
    for thread in (*grid, *grid.T):
        for a, b in pairwise(thread):
            model.addDistanceConstraint(int(a), int(b), 1.0)
    for a, b in ((grid[:-1, :-1], grid[1:, 1:]), (grid[:-1, 1:], grid[1:, :-1])):
        for i, j in zip(a.ravel(), b.ravel(), strict=True):
            model.addDistanceConstraint_XPBD(int(i), int(j), 1e3)


def _positions(points: Any) -> np.ndarray:
    places = [points.getPosition(index) for index in range(SIZE * SIZE)]
    return np.array(places).reshape(SIZE, SIZE, 3)


CLOTH_ENGINES = {"pbd_gym": _our_entries, "MuJoCo": _mujoco_entries, "pyPBD": _pypbd_entries}

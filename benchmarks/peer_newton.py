"""The driven rope in newton's XPBD solver on the CPU, a batch of them in one model."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np

from accuracy_scenes import FRAME, GRAVITY, SCENES, ChainScene
from driven_tasks import FRAMES
from motions import Motion, frame

_ROPE = SCENES[-1]
_SUBSTEPS, _ITERATIONS = 10, 10


def newton_rope(worlds: int) -> Motion:
    """Step ropes of stiff springs; their substeps are captured once and launched as a graph."""
    wp, newton = (importlib.import_module(name) for name in ("warp", "newton"))
    wp.config.quiet = True
    model = _ropes(wp, newton, _ROPE, worlds)
    # by default every particle is sorted into a grid to find contacts, which takes most of the time
    model.particle_grid, model.particle_max_radius = None, 0.0
    solver = newton.solvers.SolverXPBD(model, iterations=_ITERATIONS)
    states, control = [model.state(), model.state()], model.control()
    move = wp.zeros(2, dtype=float, device="cpu")  # of the pivot in this control step, from and to
    count = len(_ROPE.start)

    def place_pivots(q: Any, move: Any, count: int, share: float) -> None:
        q[wp.tid() * count] = wp.vec3(move[0] + (move[1] - move[0]) * share, 0.0, 0.0)

    place_pivots.__annotations__.update(q=wp.array(dtype=wp.vec3), move=wp.array(dtype=float))
    pivots_placed = wp.kernel(place_pivots)

    def advance() -> None:
        before, after = states
        for substep in range(_SUBSTEPS):
            before.clear_forces()
            inputs = [before.particle_q, move, count, (substep + 1) / _SUBSTEPS]
            wp.launch(pivots_placed, worlds, inputs=inputs, device="cpu")
            solver.step(before, after, control, None, FRAME / _SUBSTEPS)
            before, after = after, before

    advance()  # compiles
    with wp.ScopedCapture(device="cpu") as capture:
        advance()
    for state in states:
        state.assign(model.state())
    ends, x = move.numpy(), states[0].particle_q.numpy()
    pivots = [_ROPE.pivot(k * FRAME) for k in range(FRAMES + 1)]

    def step(k: int) -> None:
        ends[:] = pivots[frame(k)], pivots[frame(k) + 1]
        wp.capture_launch(capture.graph)
        x.copy()

    return Motion(step, lambda: x[:count, :2])


def _ropes(wp: Any, newton: Any, scene: ChainScene, worlds: int) -> Any:
    """Return newton's model of so many ropes, one behind the other."""
    builder = newton.ModelBuilder(up_axis=newton.Axis.Y, gravity=(0.0, -GRAVITY, 0.0))
    masses = np.concatenate([[0.0], scene.masses])  # no mass: newton leaves the pivot alone
    for _ in range(worlds):
        first = builder.particle_count
        for (x, y), mass in zip(scene.start, masses, strict=True):
            place = wp.vec3(float(x), float(y), 0.0)
            builder.add_particle(place, wp.vec3(0.0, 0.0, 0.0), float(mass), radius=0.0)
        for index in range(len(scene.masses)):
            builder.add_spring(first + index, first + index + 1, 1e9, 0.0, 0.0)
    return builder.finalize(device="cpu")

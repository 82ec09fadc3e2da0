"""A rope and a cloth of any size, held and driven: the scenes in which speed is compared.

The rope hangs from its first particle, which is moved sideways by 0.25 m at 1 Hz; the cloth hangs
by two corners, one of which swings about the other with a tenth of slack (see accuracy_cloth.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from accuracy_scenes import FRAME, GRAVITY, ramp
from pbd_gym.physics import Model, ModelBuilder, shapes

MASS = 0.2


@dataclass(frozen=True)
class Driven:
    """A model, and where its pins are.

    Attributes:
        name: In words.
        model: Of one world.
        substeps: Of a control step of 1/60 s.
        targets: Positions (P, dim) of the pins at a time [m].
    """

    name: str
    model: Model
    substeps: int
    targets: Callable[[float], np.ndarray]

    def path(self, frames: int, worlds: int, dtype: type = np.float32) -> list[np.ndarray]:
        """Return the targets (worlds, P, dim) of so many control steps [m]."""
        steps = [self.targets((frame + 1) * FRAME) for frame in range(frames)]
        return [np.repeat(at[None].astype(dtype), worlds, axis=0) for at in steps]


def driven_rope(particles: int = 32, *, bends: bool = True, substeps: int = 20) -> Driven:
    """Return a hanging rope of 1 m in a plane: a chain, and bending of each pair of links."""
    builder = ModelBuilder(2)
    rope = shapes.rope(builder, (0.0, 0.0), (0.0, -1.0), particles, mass=MASS)
    builder.pin(rope[0])
    if bends:
        for a, b, c in zip(rope, rope[1:], rope[2:], strict=False):
            builder.add_bend(int(a), int(b), int(c), compliance=1.0)

    def targets(at: float) -> np.ndarray:
        return np.array([[0.25 * ramp(at)[0] * np.sin(2.0 * np.pi * at), 0.0]])

    return Driven(f"rope {particles}", builder.build(gravity=(0.0, -GRAVITY)), substeps, targets)


def driven_cloth(size: int = 16, *, substeps: int = 20) -> Driven:
    """Return a hanging cloth of 1 m: threads as chains, soft shear and bending."""
    builder = ModelBuilder(3)
    grid = shapes.cloth(
        builder,
        (0.0, 0.0, 0.0),
        (0.0, 0.0, -1.0),
        (1.0, 0.0, 0.0),
        (size, size),
        mass=MASS,
        stretch_compliance=0.0,
    )
    builder.pin([grid[0, 0], grid[0, -1]])

    def targets(at: float) -> np.ndarray:
        reach = 1.0 - (1.0 - 1.0 / 1.1) * ramp(0.5 * at)[0]
        angle = 0.25 * ramp(max(at - 1.0, 0.0))[0] * np.sin(2.0 * np.pi * at)
        return np.array([[0.0, 0.0, 0.0], [reach * np.cos(angle), reach * np.sin(angle), 0.0]])

    model = builder.build(gravity=(0.0, 0.0, -GRAVITY))
    return Driven(f"cloth {size}x{size}", model, substeps, targets)

"""The driven rope and cloth as tasks, so that whole environments can step them beside engines.

Nothing is drawn: every episode begins as the engines begin, and actions of a fixed sequence move
the pins along the path that the engines are given. Observation, reward, info and autoreset are
those of `PBDRope-v0` and `PBDCloth-v0`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import gymnasium
import numpy as np

import pbd_gym
from driven import Driven, driven_cloth, driven_rope
from pbd_gym.physics import Model
from pbd_gym.tasks.base import Draw, draw, number
from pbd_gym.tasks.cloth import Cloth
from pbd_gym.tasks.rope import Rope

gymnasium.register_envs(pbd_gym)
FRAMES = 240  # of an episode: 4 s


@dataclass(frozen=True, kw_only=True)
class DrivenRope(Rope):
    """The driven rope: 32 particles in a plane, as `driven.driven_rope` without bending."""

    particles: int = number(32, 10, 1000)
    control_rate: float = number(60.0, 1.0, 1000.0, "Hz")
    substeps: int = number(5, 1, 1000)
    damping: float = number(0.0, 0.0, 100.0, "1/s")

    @property
    def scene(self) -> Driven:
        """Model and path of the pin."""
        return driven_rope(self.particles, bends=False, substeps=self.substeps)

    def declare_draws(self) -> dict[str, Draw]:
        """Begin at the origin, with any goal."""
        return {"gripper": draw(np.zeros(2), np.zeros(2)), "goal": super().declare_draws()["goal"]}


@dataclass(frozen=True, kw_only=True)
class DrivenCloth(Cloth):
    """The driven cloth of `driven.driven_cloth`: 1 m, without table and collisions."""

    particles: int = number(16, 4, 40)
    side: float = number(1.0, 1.0, 1.0, "m")
    control_rate: float = number(60.0, 1.0, 1000.0, "Hz")
    substeps: int = number(16, 1, 1000)
    max_speed: float = number(2.0, 1e-3, 100.0, "m/s")
    max_acceleration: float = number(40.0, 1e-3, 1000.0, "m/s2")

    @property
    def scene(self) -> Driven:
        """Model and path of the pins."""
        return driven_cloth(self.particles, substeps=self.substeps)

    def build(self) -> Model:
        """Take the model of the scene."""
        return self.scene.model

    def span(self) -> float:
        """Let the pins be a side apart, as they begin."""
        return self.side

    @cached_property
    def _hanging(self) -> np.ndarray:
        """Hang flat, as the engines begin; relative to the pins' middle."""
        x = self.model.positions
        return x - 0.5 * (x[0] + x[self.particles - 1])

    def declare_draws(self) -> dict[str, Draw]:
        """Begin with the edge along x, 1 m up and in the middle; the square is where it may be."""
        least = {name: spec.low for name, spec in super().declare_draws().items()}
        least.update(middle=np.zeros(2), height=np.ones(1), yaw=np.zeros(1))
        return {name: draw(low, low) for name, low in least.items()}

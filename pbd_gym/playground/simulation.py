"""What moves: one world of a drawing for each integrator that is shown, and their energies."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from pbd_gym.physics import World, readouts
from pbd_gym.playground.building import build_model
from pbd_gym.playground.drawing import Drawing
from pbd_gym.playground.files import Scene, at_rest

FRAME = 1.0 / 60.0  # time that passes from picture to picture [s]
REMEMBERED = 600  # pictures that the energy curve shows
_SPRING = 12.0  # how fast what is dragged by a spring follows the mouse [rad/s]


@dataclass(frozen=True)
class Grip:
    """What the mouse holds.

    Attributes:
        particle: Index.
        target: Where the mouse is, (dim,) [m].
        spring: Whether it pulls by a spring; else the particle is where the mouse is.
    """

    particle: int
    target: np.ndarray
    spring: bool


class Simulation:
    """A drawing in motion.

    Args:
        scene: The drawing and the state from which it begins.

    Attributes:
        drawing: As it is now.
        worlds: By integrator, "pbd" and "rattle" or one of them.
        energies: By integrator, the latest energies [J].
        time: That has passed [s].
        grip: What the mouse holds, or None.
        revision: Grows whenever there is something else to draw than other positions.

    Raises:
        ValueError: If the drawing cannot be built.
    """

    def __init__(self, scene: Scene) -> None:
        self._first = scene
        self.grip: Grip | None = None
        self.revision = 0
        self.reset()

    def reset(self) -> None:
        """Return to the scene as it was given: whatever was edited since is undone."""
        self.drawing = self._first.drawing
        self.time = 0.0
        self.revision += 1
        self.worlds = {name: self._world(self.drawing, name) for name in shown(self.drawing)}
        self.place(self._first.x, self._first.v)

    def place(self, x: np.ndarray, v: np.ndarray) -> None:
        """Put all worlds into one state: positions [m] and velocities [m/s], (N, dim)."""
        self.grip = None
        for world in self.worlds.values():
            world.x, world.v = x, v
        self._forget_energies()

    def change(self, drawing: Drawing) -> None:
        """Go on with another drawing, whose first particles are those of the present one.

        Raises:
            ValueError: If it cannot be built; nothing has changed then.
        """
        changed = {}
        for name in shown(drawing):
            old = self.worlds.get(name) or next(iter(self.worlds.values()))
            world = self._world(drawing, name)
            kept = min(old.x.shape[1], world.x.shape[1])
            world.x[:, :kept], world.v[:, :kept] = old.x[:, :kept], old.v[:, :kept]
            changed[name] = world
        if replace(drawing, settings=self.drawing.settings) != self.drawing:
            self.revision += 1
        is_same_physics = drawing.settings == self.drawing.settings
        self.worlds, self.drawing = changed, drawing
        if not is_same_physics:
            self._forget_energies()

    def step(self, pace: float = 1.0) -> None:
        """Advance by one picture.

        Args:
            pace: Share of real time; below 1 is slow motion.
        """
        dt = FRAME * pace
        substeps = max(1, round(self.drawing.settings.substeps * pace))
        for name, world in self.worlds.items():
            world.step(dt, substeps, self._targets(world, dt))
            self.energies[name].append(_energy(world))
        self.time += dt

    @property
    def is_compared(self) -> bool:
        """Whether two integrators run side by side."""
        return len(self.worlds) > 1

    def scene(self) -> Scene:
        """Return the drawing and the state of its first world, to be saved."""
        world = next(iter(self.worlds.values()))
        return Scene(self.drawing, world.x[0].copy(), world.v[0].copy())

    def _targets(self, world: World, dt: float) -> np.ndarray:
        """Return where pins go, and grab or pull what the mouse holds."""
        model = world.model
        driven = np.concatenate([model.pins, model.grabbable])
        targets = world.x[:, driven]
        world.grabbed = False
        grip = self.grip
        if grip is None:
            return targets
        at = int(np.flatnonzero(driven == grip.particle)[0])
        is_pin = at < len(model.pins)
        if is_pin or not grip.spring:
            targets[:, at] = grip.target
            if not is_pin:
                world.grabbed[:, at - len(model.pins)] = True
        else:
            _pull(world, grip, dt)
        return targets

    def _world(self, drawing: Drawing, integrator: str) -> World:
        return World(build_model(drawing, integrator), dtype=np.float64, num_threads=1)

    def _forget_energies(self) -> None:
        self.energies = {name: deque(maxlen=REMEMBERED) for name in self.worlds}


def shown(drawing: Drawing) -> tuple[str, ...]:
    """Return the integrators that a drawing asks for."""
    chosen = drawing.settings.integrator
    return ("pbd", "rattle") if chosen == "both" else (chosen,)


def begin(drawing: Drawing) -> Simulation:
    """Return a drawing in motion, from rest."""
    return Simulation(at_rest(drawing))


def _pull(world: World, grip: Grip, dt: float) -> None:
    """Pull a particle to the mouse by a damped spring.

    The spring is as strong as the whole scene is heavy, up to a limit, and its kick is that of
    backward Euler, which no stiffness makes unstable.
    """
    inverse_mass = world.model.inverse_mass
    free = inverse_mass > 0.0
    carried = min(float(np.sum(1.0 / inverse_mass[free])), 100.0 / inverse_mass[grip.particle])
    stiffness = carried * _SPRING**2
    damping = 2.0 * carried * _SPRING
    x, v = world.x[0, grip.particle], world.v[0, grip.particle]
    mass = 1.0 / inverse_mass[grip.particle]
    force = stiffness * (grip.target - x - dt * v) - damping * v
    v += dt * force / (mass + dt * damping + dt * dt * stiffness)


def _energy(world: World) -> float:
    """Return the energy of motion, height and links [J]."""
    model = world.model
    parts = (
        readouts.kinetic_energy(model, world.v),
        readouts.potential_energy(model, world.x),
        readouts.elastic_energy(model, world.x),
    )
    return float(sum(part[0] for part in parts))

"""Throw random models about: finite, below the speed limit, and no energy from nowhere?

`python benchmarks/abuse.py --particle-steps 1e9` is the long run; its table goes into
benchmarks/results/abuse.md. A particle-step is one particle moved by one substep.

Half of the models are calm: they start as built and are thrown about while their pins hold still;
their energy is compared with what went in. The others are wild: pins are thrown at up to 100 m/s,
all together or each for itself, particles grabbed, and bodies begin inside out or on one spot.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from abuse_models import FAMILIES, Family
from machine import describe_machine
from pbd_gym.physics import Model, World, readouts

DT, SUBSTEPS, WORLDS = 1 / 60, 8, 32
_PIN_SPEED = 100.0  # the greatest that a task allows [m/s]
_RESULTS = Path(__file__).parent / "results" / "abuse.md"


class Outcome(NamedTuple):
    """What became of the worlds of one model.

    Attributes:
        particle_steps: Particles times worlds times substeps.
        finite: Whether all was finite at all times.
        speed: Greatest speed of a free particle [m/s].
        gain: Greatest energy above what went in, as a share of it; 0 of wild models.
    """

    particle_steps: float
    finite: bool
    speed: float
    gain: float


def abuse(
    family: Family, seed: Any, *, wild: bool, steps: int = 50, worlds: int = WORLDS
) -> Outcome | None:
    """Build a random model of a family and throw its worlds about; None if it was refused."""
    generator = np.random.default_rng(seed)
    try:
        model = family.build(generator, wild)
    except ValueError:
        return None
    world = World(model, worlds, dtype=family.dtype, num_threads=1)
    free = model.inverse_mass > 0
    world.v[:] = generator.normal(0.0, 2.0, world.v.shape) * free[:, None]
    if wild:
        _disorder(world, generator)
    before = energy(model, world) + readouts.elastic_energy(model, world.x)
    on_hand = energy_on_hand(model, world)
    finite, speed, gain = True, 0.0, 0.0
    for _ in range(steps):
        world.step(DT, SUBSTEPS, _targets(world, generator) if wild else None)
        # what is no number is greater than any speed
        finite = finite and bool(np.isfinite(world.x).all() and np.isfinite(world.v).all())
        square = np.sum(world.v[:, _driven_by_nobody(world)].astype(np.float64) ** 2, axis=2)
        speed = max(speed, float(np.sqrt(square.max(initial=0.0))))
        if not wild:
            gain = max(gain, float(((energy(model, world) - before) / on_hand).max()))
    return Outcome(model.num_particles * worlds * steps * SUBSTEPS, finite, speed, gain)


def energy(model: Model, world: World) -> np.ndarray:
    """Return kinetic energy and potential energy of weight, (W,) [J].

    With "pbd" velocities are those of half a substep ago: in free flight E + h/2 m g.v is constant.
    What is stored elastically comes on top, so that this never exceeds what went in either.
    """
    late = 0.5 * DT / SUBSTEPS if model.integrator == "pbd" else 0.0
    velocity = world.v + late * model.gravity
    return readouts.kinetic_energy(model, velocity) + readouts.potential_energy(model, world.x)


def energy_on_hand(model: Model, world: World) -> np.ndarray:
    """Return what went in: kinetic and elastic energy, and what a fall of a metre sets free [J]."""
    mass = np.sum(1.0 / model.inverse_mass[model.inverse_mass > 0])
    fall = mass * np.sqrt(np.sum(model.gravity**2))
    return readouts.kinetic_energy(model, world.v) + readouts.elastic_energy(model, world.x) + fall


def _disorder(world: World, generator: np.random.Generator) -> None:
    """Turn a third of the worlds inside out, and put a third of them on one spot."""
    model, third = world.model, world.num_worlds // 3
    free = model.inverse_mass > 0
    centre = model.positions.mean(axis=0)
    world.x[:third, free, 0] = 2.0 * centre[0] - world.x[:third, free, 0]
    world.x[third : 2 * third, free] = centre + generator.choice([0.0, 1e-9, 1e-3]) * (
        model.positions[free] - centre
    )


def _targets(world: World, generator: np.random.Generator) -> np.ndarray:
    """Grab at random, and throw what is held: all in one direction, or each in its own."""
    model = world.model
    driven = np.concatenate([model.pins, model.grabbable])
    if len(model.grabbable):
        world.grabbed = generator.uniform(size=world.grabbed.shape) < 0.5
    each = 1 if generator.uniform() < 0.5 else len(driven)
    shape = (world.num_worlds, each, model.dim)
    return (
        world.x[:, driven] + DT * generator.uniform(-1.0, 1.0, shape) * _PIN_SPEED / model.dim**0.5
    )


def _driven_by_nobody(world: World) -> np.ndarray:
    """Return the particles that are free in all worlds at all times."""
    free = world.model.inverse_mass > 0
    free[world.model.grabbable] = False
    return free


class Row(NamedTuple):
    """A row of the table."""

    family: str
    kind: str
    models: int
    refused: int
    particle_steps: float
    infinite: int
    speed: float
    gain: float

    def __str__(self) -> str:
        gain = f"{self.gain:.3g}" if self.kind == "calm" else ""
        return (
            f"| {self.family} | {self.kind} | {self.models:,} | {self.refused:,} "
            f"| {self.particle_steps:.2e} | {self.infinite} | {self.speed:.0f} | {gain} |"
        )


def summarise(name: str, wild: bool, particle_steps: float, seed: int, bar: tqdm) -> Row:
    """Abuse models of a family until enough steps were made."""
    outcomes: list[Outcome] = []
    refused, done = 0, 0.0
    while done < particle_steps:
        key = [seed, list(FAMILIES).index(name), int(wild), len(outcomes) + refused]
        # more worlds and steps per model than in the tests: less time goes into building
        outcome = abuse(FAMILIES[name], key, wild=wild, steps=100, worlds=128)
        if outcome is None:
            refused += 1
            continue
        outcomes.append(outcome)
        done += outcome.particle_steps
        bar.update(outcome.particle_steps)
    return Row(
        name,
        "wild" if wild else "calm",
        len(outcomes),
        refused,
        done,
        sum(not outcome.finite for outcome in outcomes),
        max(outcome.speed for outcome in outcomes),
        max(outcome.gain for outcome in outcomes),
    )


def main() -> None:
    """Abuse every family, print the table and write it down."""
    parser = argparse.ArgumentParser(description="Throw random models about.")
    parser.add_argument("--particle-steps", type=float, default=1e7, help="over all families")
    parser.add_argument("--families", nargs="+", default=list(FAMILIES), choices=list(FAMILIES))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--write", action="store_true", help=f"write {_RESULTS.name}")
    options = parser.parse_args()
    lines = [
        "| family | kind | models | refused | particle-steps | not finite | m/s | energy gained |",
        "|---|---|---:|---:|---:|---:|---:|---:|",
    ]
    with tqdm(total=options.particle_steps, unit_scale=True, unit=" steps") as bar:
        for name in options.families:
            for wild in (False, True):
                share = options.particle_steps / len(options.families) / 2
                lines.append(str(summarise(name, wild, share, options.seed, bar)))
                bar.write(lines[-1])
    table = "\n".join(lines)
    if options.write:
        command = f"benchmarks/abuse.py --particle-steps {options.particle_steps:g}"
        head = f"Ran on {describe_machine()}: `{command} --seed {options.seed}`."
        _RESULTS.write_text(f"{head}\n\n{table}\n", encoding="utf-8")


if __name__ == "__main__":
    main()

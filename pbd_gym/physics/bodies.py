"""What a renderer draws of a model: which particles form a rope, a pendulum, a cloth."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Strand:
    """A rope or chain, drawn as one line: particle indices in order and its radius [m]."""

    particles: tuple[int, ...]
    radius: float


@dataclass(frozen=True)
class Linkage:
    """Rods with a bob at every free end: a pendulum. Particle indices in order, rod radius [m]."""

    particles: tuple[int, ...]
    radius: float


@dataclass(frozen=True)
class Sheet:
    """A rectangular cloth: rows x columns of particle indices, and its half thickness [m]."""

    particles: tuple[tuple[int, ...], ...]
    radius: float


Body = Strand | Linkage | Sheet

"""How a control step is divided into substeps, and what the kernels derive from that."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeGuard

import numpy as np

from pbd_gym.physics import portable
from pbd_gym.physics.compiling import entry
from pbd_gym.physics.model import Model
from pbd_gym.physics.parameters import Timing, as_read

# No particle is ever faster; what a failed solve throws about comes back [m/s].
_SPEED_LIMIT = 1000.0
# Beyond these h or 1/h^2 would leave the range of float32.
_SHORTEST_SUBSTEP = 1e-9
_LONGEST_STEP = 1e3


@dataclass(frozen=True, kw_only=True)
class Adaptive:
    """Substeps that follow the fastest particle of each world (the seed's dynamic time step).

    At the start of a control step a world takes the fewest of least, 2 least, 4 least ... most
    substeps in which nothing moves further than `reach`: free particles with their speed and what
    gravity adds within the control step, pins on their way to their targets. The number depends on
    nothing but the world's own state and targets.

    The compliance of soft constraints and the damping per second do not depend on the number of
    substeps; the dissipation of "pbd", the stretch of iterated constraints and the seed's stiffness
    k do, and "rattle" loses its freedom from drift in energy when the number changes.

    Attributes:
        reach: Way in one substep [m]; a third of the smallest radius or collision distance is safe.
        least: Substeps of a world at rest.
        most: Substeps of the fastest worlds; `least` times a power of two.

    Raises:
        ValueError: If an attribute is out of range.
    """

    reach: float
    least: int = 4
    most: int = 32

    def __post_init__(self) -> None:
        if not (np.isfinite(self.reach) and self.reach > 0.0):
            raise ValueError(f"reach is {self.reach!r}; it must be positive and finite [m]")
        for name, value in (("least", self.least), ("most", self.most)):
            if not is_whole(value) or value < 1:
                raise ValueError(f"{name} is {value!r}; expected a whole number from 1 up")
        if self.most not in self.counts():
            raise ValueError(
                f"most is {self.most}; allowed: least = {self.least} times a power of two"
            )

    def counts(self) -> list[int]:
        """Return the numbers of substeps that are possible, from least to most."""
        counts = [int(self.least)]
        while counts[-1] < self.most:
            counts.append(2 * counts[-1])
        return counts


def timing_of(model: Model, dt: float, substeps: int, dtype: np.dtype) -> Timing:
    """Return what the kernels derive from the time step.

    Raises:
        ValueError: If dt or substeps are out of range.
    """
    if not is_whole(substeps) or substeps < 1:
        raise ValueError(f"substeps is {substeps!r}; expected a whole number from 1 up")
    if not (dt / substeps >= _SHORTEST_SUBSTEP and dt <= _LONGEST_STEP):
        raise ValueError(
            f"dt is {dt} s in {substeps} substeps; allowed: at most {_LONGEST_STEP} s, and at "
            f"least {_SHORTEST_SUBSTEP} s a substep"
        )
    h = dt / substeps
    gravity = float(np.sqrt(np.sum(model.gravity**2)))
    decay = float(portable.exp(-model.damping * h))
    # impacts slower than what gravity gives within two substeps are resting contacts
    rest_speed = 2.0 * gravity * h
    return as_read(Timing(dt, h, 1.0 / h**2, decay, rest_speed, gravity, _SPEED_LIMIT), dtype)


@entry
def count_substeps(
    x: Any,
    v: Any,
    targets: Any,
    free: Any,
    pins: Any,
    grabbable: Any,
    grabbed: Any,
    dt: float,
    gravity: float,
    limits: Any,
    counts: Any,
) -> None:
    """Count the substeps of each world as `Adaptive` says.

    Args:
        x: Positions (W, N, dim) [m].
        v: Velocities (W, N, dim) [m/s].
        targets: (W, P + G, dim) [m].
        free: Particles that are free as built.
        pins: (P,) particles.
        grabbable: (G,) particles.
        grabbed: (W, G) bool.
        dt: Control step [s].
        gravity: Its size [m/s2].
        limits: reach [m], least and most.
        counts: (W,), written.
    """
    reach, least, most = limits
    for world in range(x.shape[0]):
        square = 0.0
        for particle in free:
            total = 0.0
            for k in range(x.shape[2]):
                total += float(v[world, particle, k]) * float(v[world, particle, k])
            square = max(square, total)
        way = (np.sqrt(square) + gravity * dt) * dt if free.shape[0] > 0 else 0.0
        for index in range(pins.shape[0] + grabbable.shape[0]):
            held = index - pins.shape[0]
            if held >= 0 and not grabbed[world, held]:
                continue
            particle = pins[index] if held < 0 else grabbable[held]
            total = 0.0
            for k in range(x.shape[2]):
                move = float(targets[world, index, k]) - float(x[world, particle, k])
                total += move * move
            way = max(way, np.sqrt(total))
        count = least
        while count < most and way > reach * count:
            count *= 2
        counts[world] = count


def is_whole(value: Any) -> TypeGuard[int]:
    """Tell whether a value is a whole number and not a truth value."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)

"""What moves: positions and velocities of n copies of one Model, advanced together."""

from __future__ import annotations

import io
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, TypeGuard

import numpy as np

from pbd_gym.physics import compiling, portable
from pbd_gym.physics.model import Model
from pbd_gym.physics.tables import Parameters, Timing, as_read

# One world runs in scalar code. Below this number of worlds a tile of lanes would be mostly empty.
_FEWEST_FOR_LANES = 8
_BATCH_LANES = 32
# Below this many particles in all worlds, waking a second thread costs more than it brings.
_FEWEST_PARTICLES_FOR_THREADS = 4096
# Candidate pairs of self-collision that a world can hold, per particle.
_PAIRS_PER_PARTICLE = 24
# No particle is ever faster; what a failed solve throws about comes back [m/s].
_SPEED_LIMIT = 1000.0
# Beyond these h or 1/h^2 would leave the range of float32.
_SHORTEST_SUBSTEP = 1e-9
_LONGEST_STEP = 1e3


@dataclass(frozen=True)
class Snapshot:
    """The state of n worlds as plain arrays, with the fingerprint of their model.

    Attributes:
        fingerprint: `Model.fingerprint`.
        x: Positions (W, N, dim) [m].
        v: Velocities (W, N, dim) [m/s].
    """

    fingerprint: str
    x: np.ndarray
    v: np.ndarray

    def to_bytes(self) -> bytes:
        """Return the snapshot as an uncompressed npz archive."""
        buffer = io.BytesIO()
        np.savez(buffer, fingerprint=np.array(self.fingerprint), x=self.x, v=self.v)
        return buffer.getvalue()

    @staticmethod
    def from_bytes(data: bytes) -> Snapshot:
        """Read what `to_bytes` wrote. Nothing is unpickled, so bytes of unknown origin do no harm.

        Raises:
            ValueError: If the bytes are not a snapshot.
        """
        try:
            with np.load(io.BytesIO(data), allow_pickle=False) as archive:
                parts = {name: archive[name] for name in ("fingerprint", "x", "v")}
        except Exception as error:  # zipfile, numpy and zlib raise a dozen kinds
            raise ValueError(f"these {len(data)} bytes are not a snapshot: {error}") from error
        x, v, fingerprint = parts["x"], parts["v"], parts["fingerprint"]
        if fingerprint.dtype.kind != "U" or fingerprint.ndim != 0:
            raise ValueError("these bytes are not a snapshot: the fingerprint is not a string")
        if x.dtype not in (np.float32, np.float64) or x.dtype != v.dtype:
            raise ValueError(f"these bytes are not a snapshot: types {x.dtype} and {v.dtype}")
        if x.ndim != 3 or x.shape != v.shape:
            raise ValueError(f"these bytes are not a snapshot: shapes {x.shape} and {v.shape}")
        return Snapshot(str(fingerprint), x, v)


class World:
    """`num_worlds` copies of a Model: their positions and velocities, and how they move on.

    Args:
        model: What holds in every world.
        num_worlds: Number of copies W.
        dtype: np.float32 (training) or np.float64 (science).
        num_threads: Threads that share the worlds; all cores where None and the batch is worth it.
            The result does not depend on it.
        lanes: Worlds side by side in vector registers; chosen by `num_worlds` where None. The
            result does not depend on it.

    Attributes:
        x: Positions (W, N, dim) [m]; may be written between steps.
        v: Velocities (W, N, dim) [m/s]; a pin's is that of its last move.

    Raises:
        ValueError: If an argument is out of range.
    """

    def __init__(
        self,
        model: Model,
        num_worlds: int = 1,
        *,
        dtype: Any = np.float32,
        num_threads: int | None = None,
        lanes: int | None = None,
    ) -> None:
        counts = {"num_worlds": num_worlds, "num_threads": num_threads, "lanes": lanes}
        for name, value in counts.items():
            if value is None and name != "num_worlds":
                continue
            if not _is_whole(value) or value < 1:
                raise ValueError(f"{name} is {value!r}; expected a whole number from 1 up")
        self.dtype = np.dtype(dtype)
        if self.dtype not in (np.float32, np.float64):
            raise ValueError(f"dtype is {dtype!r}; allowed: float32, float64")
        self.model = model
        self.num_worlds = int(num_worlds)
        self.lanes = lanes or (_BATCH_LANES if num_worlds >= _FEWEST_FOR_LANES else 1)
        tiles = -(-self.num_worlds // self.lanes)
        if num_threads is None:
            worth_it = self.num_worlds * model.num_particles >= _FEWEST_PARTICLES_FOR_THREADS
            num_threads = _cores() if worth_it else 1
        self.num_threads = min(int(num_threads), tiles)
        shape = (self.num_worlds, model.num_particles, model.dim)
        self.x = np.empty(shape, dtype=self.dtype)
        self.x[:] = model.positions
        self.v = np.zeros(shape, dtype=self.dtype)
        self._prepare()

    def _prepare(self) -> None:
        """Load the kernels and allocate their scratch, one set per thread."""
        self._kernels = compiling.load_kernels(self.model.dim, self.lanes)
        self._parameters = as_read(_parameters(self.model), self.dtype)
        tiles = -(-self.num_worlds // self.lanes)
        bounds = np.linspace(0, tiles, self.num_threads + 1).astype(np.int64)
        self._shares = [
            (bounds[i : i + 2].copy(), *self._scratch()) for i in range(self.num_threads)
        ]
        self._timing_key: tuple[float, int] | None = None

    def _scratch(self) -> tuple[Any, ...]:
        """Return the scratch of one thread: work, and that of self-collision or None."""
        shape = (self.model.num_particles + 2, self._kernels.WIDTH)
        work = np.zeros(shape, dtype=self.dtype)
        if self.model.self_collision is None:
            return work, None
        colliding = len(self.model.self_collision.particles)
        pairs = np.zeros((self.lanes, _PAIRS_PER_PARTICLE * colliding, 2), dtype=np.int32)
        return work, (pairs, np.zeros(self.lanes, dtype=np.int64))

    def __getstate__(self) -> dict[str, Any]:
        kept = ("model", "num_worlds", "dtype", "num_threads", "lanes", "x", "v")
        return {name: self.__dict__[name] for name in kept}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._prepare()

    def step(self, dt: float, substeps: int = 10, targets: np.ndarray | None = None) -> None:
        """Advance every world by one control step.

        Args:
            dt: Length of the step [s].
            substeps: Parts into which it is divided.
            targets: Where the pins are at the end of the step, (W, P, dim) [m]; they move there in
                a straight line at constant speed. Where they are now if None.

        Raises:
            ValueError: If dt or substeps are not positive, or the targets' shape is wrong or one
                of them is not finite. Nothing has moved then.
        """
        if (dt, substeps) != self._timing_key:
            self._set_timing(dt, substeps)
        pins = self.model.pins
        if targets is None:
            targets = np.ascontiguousarray(self.x[:, pins])
        else:
            targets = np.ascontiguousarray(targets, dtype=self.dtype)
            expected = (self.num_worlds, len(pins), self.model.dim)
            if targets.shape != expected:
                raise ValueError(f"targets have shape {targets.shape}; expected {expected}")
            if not np.isfinite(targets).all():
                world, pin = np.argwhere(~np.isfinite(targets))[0, :2]
                raise ValueError(f"target of pin {pin} in world {world} is {targets[world, pin]}")
        waiting = [
            _pool(self.num_threads - 1).submit(self._advance, targets, share)
            for share in self._shares[1:]
        ]
        self._advance(targets, self._shares[0])
        for future in waiting:
            future.result()

    def _advance(self, targets: np.ndarray, share: tuple[Any, ...]) -> None:
        self._kernels.advance(
            self.x,
            self.v,
            targets,
            *share,
            self._parameters,
            self._timing,
            self._substeps,
        )

    def _set_timing(self, dt: float, substeps: int) -> None:
        """Check and prepare what depends on the time step; announce a compilation before it."""
        if not _is_whole(substeps) or substeps < 1:
            raise ValueError(f"substeps is {substeps!r}; expected a whole number from 1 up")
        if not (dt / substeps >= _SHORTEST_SUBSTEP and dt <= _LONGEST_STEP):
            raise ValueError(
                f"dt is {dt} s in {substeps} substeps; allowed: at most {_LONGEST_STEP} s, and at "
                f"least {_SHORTEST_SUBSTEP} s a substep"
            )
        h = dt / substeps
        gravity = float(np.sqrt(np.sum(self.model.gravity**2)))
        decay = float(portable.exp(-self.model.damping * h))
        # impacts slower than what gravity gives within two substeps are resting contacts
        timing = Timing(dt, h, 1.0 / h, 1.0 / h**2, decay, 2.0 * gravity * h, gravity, _SPEED_LIMIT)
        self._timing = as_read(timing, self.dtype)
        self._substeps = int(substeps)
        self._warm_up()
        self._timing_key = (dt, substeps)

    def _warm_up(self) -> None:
        """Compile on a world of its own, so that the first real step is like any other."""
        variant = [
            f"{self.model.dim}D",
            self.model.integrator,
            f"{self.lanes} lanes",
            self.dtype.name,
        ]
        kinds = ("self_collision", "ropes", "limits", "rods", "hinges", "folds")
        present = [kind for kind in kinds if getattr(self.model, kind) is not None]
        variant += [kind.replace("_", "-") for kind in present]
        done = compiling.announce_compilation(", ".join(variant))
        none = np.zeros(2, dtype=np.int64)
        targets = np.ascontiguousarray(self.x[:, self.model.pins])
        self._advance(targets, (none, *self._shares[0][1:]))
        done()

    def snapshot(self) -> Snapshot:
        """Return a copy of the state; `restore` continues from it to the last bit."""
        return Snapshot(self.model.fingerprint, self.x.copy(), self.v.copy())

    def restore(self, snapshot: Snapshot) -> None:
        """Return to a snapshot.

        Raises:
            ValueError: If it is of another model, number of worlds or dtype. Nothing changes then.
        """
        if snapshot.fingerprint != self.model.fingerprint:
            raise ValueError(
                f"the snapshot is of model {snapshot.fingerprint[:12]}, "
                f"this world of model {self.model.fingerprint[:12]}"
            )
        for name, array in (("positions", snapshot.x), ("velocities", snapshot.v)):
            if array.shape != self.x.shape or array.dtype != self.dtype:
                raise ValueError(
                    f"the snapshot's {name} are {array.dtype} {array.shape}; "
                    f"this world's are {self.dtype} {self.x.shape}"
                )
        self.x[:] = snapshot.x
        self.v[:] = snapshot.v


def _parameters(model: Model) -> Parameters:
    """Return what of a model the kernels read."""
    return Parameters(
        particles=model.particles,
        chains=model.chains,
        ropes=model.ropes,
        distances=model.distances,
        limits=model.limits,
        bends=model.bends,
        rods=model.rods,
        hinges=model.hinges,
        folds=model.folds,
        room=model.room,
        self_collision=model.self_collision,
        second_order=True if model.integrator == "rattle" else None,
        iterations=model.iterations,
    )


def _is_whole(value: Any) -> TypeGuard[int]:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def _cores() -> int:
    """Number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


_pools: dict[int, ThreadPoolExecutor] = {}
if hasattr(os, "register_at_fork"):
    # the threads of a pool do not live on in a forked child: it makes its own
    os.register_at_fork(after_in_child=_pools.clear)


def _pool(size: int) -> ThreadPoolExecutor:
    """Return the pool of `size` threads that all worlds of this process share."""
    if size not in _pools:
        _pools[size] = ThreadPoolExecutor(size, thread_name_prefix="pbd_gym")
    return _pools[size]

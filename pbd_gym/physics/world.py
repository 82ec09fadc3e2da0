"""What moves: positions and velocities of n copies of one Model, advanced together."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np

from pbd_gym.physics import compiling
from pbd_gym.physics.model import Model
from pbd_gym.physics.parameters import Forces, Parameters, as_read
from pbd_gym.physics.recording import allocate_forces, copy_of_forces
from pbd_gym.physics.scratch import allocate
from pbd_gym.physics.snapshot import Snapshot
from pbd_gym.physics.targets import check_targets
from pbd_gym.physics.threads import Crew, cores
from pbd_gym.physics.tickets import new_tickets
from pbd_gym.physics.timestep import Adaptive, count_substeps, is_whole, timing_of

# One world runs in scalar code. Below this number of worlds a tile of lanes would be mostly empty.
_FEWEST_FOR_LANES = 8
_BATCH_LANES = 32
# Numbers in the model's tables, times worlds: a substep reads each once, so they tell its work.
# Below this, waking a second thread can cost more than it brings.
_FEWEST_NUMBERS_FOR_THREADS = 2**16


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
        forces: `Forces` of the last step if it was recorded, else None.

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
            if not is_whole(value) or value < 1:
                raise ValueError(f"{name} is {value!r}; expected a whole number from 1 up")
        self.dtype = np.dtype(dtype)
        if self.dtype not in (np.float32, np.float64):
            raise ValueError(f"dtype is {dtype!r}; allowed: float32, float64")
        self.model = model
        self.num_worlds = int(num_worlds)
        self.lanes = lanes or (_BATCH_LANES if num_worlds >= _FEWEST_FOR_LANES else 1)
        tiles = -(-self.num_worlds // self.lanes)
        if num_threads is None:
            worth_it = self.num_worlds * _size(model) >= _FEWEST_NUMBERS_FOR_THREADS
            num_threads = cores() if worth_it else 1
        self.num_threads = min(int(num_threads), tiles)
        shape = (self.num_worlds, model.num_particles, model.dim)
        self._x = np.empty(shape, dtype=self.dtype)
        self._x[:] = model.positions
        self._v = np.zeros(shape, dtype=self.dtype)
        self._grabbed = np.zeros((self.num_worlds, len(model.grabbable)), dtype=bool)
        self._prepare()

    def _prepare(self) -> None:
        """Load the kernels and allocate their scratch, one set per thread."""
        model = self.model
        self._kernels = compiling.load_kernels(model.dim, self.lanes)
        self._parameters = as_read(_parameters(model), self.dtype)
        self._driven = np.concatenate([model.pins, model.grabbable])
        width = self._kernels.WIDTH
        self._scratch = [
            allocate(model, self.lanes, width, self.dtype) for _ in range(self.num_threads)
        ]
        driven = (self.num_worlds, len(self._driven), model.dim)
        self._targets = np.zeros(driven, dtype=self.dtype)
        self._substeps_used = np.zeros(self.num_worlds, dtype=np.int64)
        self._settings: tuple[Any, ...] = ()
        self._stepping = threading.Lock()
        self.forces: Forces | None = None

    def __getstate__(self) -> dict[str, Any]:
        kept = ("model", "num_worlds", "dtype", "num_threads", "lanes", "_x", "_v", "_grabbed")
        return {name: self.__dict__[name] for name in kept}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._prepare()

    # The kernels are called without a look at their arguments' types: the arrays stay the same.

    @property
    def x(self) -> np.ndarray:
        """Positions (W, N, dim) [m]; may be written between steps."""
        return self._x

    @x.setter
    def x(self, positions: Any) -> None:
        self._x[:] = positions

    @property
    def v(self) -> np.ndarray:
        """Velocities (W, N, dim) [m/s]; a pin's is that of its last move. May be written."""
        return self._v

    @v.setter
    def v(self, velocities: Any) -> None:
        self._v[:] = velocities

    @property
    def grabbed(self) -> np.ndarray:
        """Which particles of `model.grabbable` are pins now, (W, G) bool; to be written."""
        return self._grabbed

    @grabbed.setter
    def grabbed(self, grabbed: Any) -> None:
        self._grabbed[:] = grabbed

    @property
    def substeps_used(self) -> np.ndarray:
        """Substeps of each world in the last step, (W,)."""
        return self._substeps_used.copy()

    def step(
        self,
        dt: float,
        substeps: int | Adaptive = 10,
        targets: np.ndarray | None = None,
        *,
        record: bool = False,
    ) -> None:
        """Advance every world by one control step.

        Args:
            dt: Length of the step [s].
            substeps: Parts into which it is divided; `Adaptive` to let each world's fastest
                particle decide.
            targets: Where pins and grabbed particles are at the end of the step, those of the P
                pins before those of the G grabbable particles, (W, P + G, dim) [m]; they move there
                in a straight line at constant speed. Targets of particles that are not grabbed are
                not read and may be NaN. Where they are now if None.
            record: Whether to leave the forces of the last substep in `forces`.

        Raises:
            ValueError: If dt or substeps are not positive, or the targets' shape is wrong or one
                of them is not finite. Nothing has moved then.
            RuntimeError: If another thread is stepping this world. That step goes on.
        """
        if not self._stepping.acquire(blocking=False):
            raise RuntimeError("another thread is stepping these worlds; give each its own")
        try:
            self._step(dt, substeps, targets, record)
        finally:
            self._stepping.release()

    def _step(
        self, dt: float, substeps: int | Adaptive, targets: np.ndarray | None, record: bool
    ) -> None:
        if (dt, substeps, record) != self._settings:
            self._set(dt, substeps, record)
        if targets is None:
            self._targets[:] = self._x[:, self._driven]
        else:
            targets = np.ascontiguousarray(targets, dtype=self.dtype)
            if targets.shape != self._targets.shape:
                raise ValueError(
                    f"targets have shape {targets.shape}; expected {self._targets.shape}"
                )
            check_targets(targets, self.model.pins, self._grabbed)
            self._targets[:] = targets
        if isinstance(substeps, Adaptive):
            self._advance_in_groups(dt, substeps)
        else:
            self._crew.work()
        self.forces = copy_of_forces(self.model, self._noted[0][2]) if record else None

    def _advance_in_groups(self, dt: float, substeps: Adaptive) -> None:
        """Advance the worlds that take the same number of substeps together."""
        model, used = self.model, self._substeps_used
        limits = (float(substeps.reach), int(substeps.least), int(substeps.most))
        gravity = float(np.sqrt(np.sum(model.gravity**2)))
        pins, grabbable, free = model.pins, model.grabbable, np.flatnonzero(model.inverse_mass)
        count_substeps(
            self._x,
            self._v,
            self._targets,
            free,
            pins,
            grabbable,
            self._grabbed,
            dt,
            gravity,
            limits,
            used,
        )
        for count in np.unique(used):
            worlds = np.flatnonzero(used == count)
            tiles = -(-len(worlds) // self.lanes)
            Crew(self._compiled, self._arguments(worlds, int(count)), tiles, linger=False).work()

    def _arguments(self, worlds: np.ndarray | None, substeps: int) -> list[tuple[Any, ...]]:
        """Return what each thread hands the kernel after tickets and helper."""
        state = (self._x, self._v, self._targets, worlds)
        grabbed = None if self.model.particles.grabbable is None else self._grabbed
        timing = self._timings[substeps]
        return [
            (*state, *scratch, grabbed, forces, self._parameters, timing, substeps)
            for scratch, forces in zip(self._scratch, self._noted, strict=True)
        ]

    def _set(self, dt: float, substeps: int | Adaptive, record: bool) -> None:
        """Check and prepare what depends on the kind of step."""
        model, dtype = self.model, self.dtype
        adaptive = isinstance(substeps, Adaptive)
        counts = substeps.counts() if adaptive else [substeps]
        timings = {count: timing_of(model, dt, count, dtype) for count in counts}
        self._settings = ()
        self._timings = timings
        self._noted: list[Any] = [None] * self.num_threads
        if record:
            self._noted = allocate_forces(
                model, self.num_worlds, self.lanes, self.num_threads, dtype
            )
        self._substeps_used[:] = counts[0]
        arguments = self._arguments(np.zeros(1, dtype=np.int64) if adaptive else None, counts[0])
        self._compile(arguments[0], adaptive, record)
        self._crew = Crew(self._compiled, arguments, -(-self.num_worlds // self.lanes))
        self._settings = (dt, substeps, record)

    def _compile(self, arguments: tuple[Any, ...], adaptive: bool, record: bool) -> None:
        """Compile by a call without tiles, so that the first real step is like any other."""
        model = self.model
        kinds = (
            "colliders",
            "self_collision",
            "encounters",
            "ropes",
            "limits",
            "rods",
            "hinges",
            "folds",
        )
        present = [kind for kind in kinds if getattr(model, kind) is not None]
        extras = {
            "solids": model.volumes is not None,
            "grabs": model.particles.grabbable is not None,
            "adaptive": adaptive,
            "forces": record,
        }
        variant = [f"{model.dim}D", model.integrator, f"{self.lanes} lanes", self.dtype.name]
        variant += [kind.replace("_", "-") for kind in present]
        variant += [name for name, wanted in extras.items() if wanted]
        done = compiling.announce_compilation(", ".join(variant))
        arguments = (new_tickets(0, 0), -1, *arguments)
        self._kernels.advance(*arguments)
        self._compiled = compiling.compiled_for(self._kernels.advance, arguments)
        done()

    def snapshot(self) -> Snapshot:
        """Return a copy of the state; `restore` continues from it to the last bit."""
        grabbed = self._grabbed.copy() if len(self.model.grabbable) else None
        return Snapshot(self.model.fingerprint, self._x.copy(), self._v.copy(), grabbed)

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
        parts: dict[str, tuple[np.ndarray, np.ndarray]]
        parts = {"positions": (snapshot.x, self._x), "velocities": (snapshot.v, self._v)}
        if snapshot.grabbed is not None or len(self.model.grabbable):
            parts["grabbed particles"] = (np.asarray(snapshot.grabbed), self._grabbed)
        for name, (array, own) in parts.items():
            if array.shape != own.shape or array.dtype != own.dtype:
                raise ValueError(
                    f"the snapshot's {name} are {array.dtype} {array.shape}; "
                    f"this world's are {own.dtype} {own.shape}"
                )
        for array, own in parts.values():
            own[:] = array


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
        volumes=model.volumes,
        shape_matches=model.shape_matches,
        attachments=model.attachments,
        room=model.room,
        colliders=model.colliders,
        self_collision=model.self_collision,
        encounters=model.encounters,
        second_order=True if model.integrator == "rattle" else None,
        iterations=model.iterations,
    )


def _size(model: Model) -> int:
    """Return how many numbers stand in the tables of a model."""
    tables = [table for table in _parameters(model) if isinstance(table, tuple)]
    return sum(np.size(numbers) for table in tables for numbers in table)

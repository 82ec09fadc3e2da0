"""The control step in plain C, compiled on the spot, with the tables of a Model."""

from __future__ import annotations

import ctypes
import functools
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from pbd_gym.physics import Model
from pbd_gym.physics.parameters import as_read
from pbd_gym.physics.timestep import timing_of

SOURCE = Path(__file__).parent / "roofline" / "stepping.c"
# IEEE arithmetic as in our kernels: no contraction; that square roots set no errno and that
# divisions in a branch not taken may run changes no bit, and without it nothing vectorises.
FLAGS = ("-O3", "-march=native", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math")
COMPILER = "cc"

_INTEGERS = ("particles", "pins", "chains", "distances", "bends")
_INDICES = ("pin", "offset", "entry", "pair", "triple")
_REALS = ("inverse_mass", "gravity", "rest", "compliance", "greatest", "length", "softness")
_TIMES = ("dt", "h", "inverse_h2", "decay", "speed_limit")


def has_compiler() -> bool:
    """Tell whether there is a C compiler."""
    return shutil.which(COMPILER) is not None


def compiler_version() -> str:
    """Return the first line that the compiler says of itself."""
    said = subprocess.run([COMPILER, "--version"], capture_output=True, text=True, check=True)
    return said.stdout.splitlines()[0]


@functools.cache
def compiled(dim: int, lanes: int, real: str) -> ctypes.CDLL:
    """Compile the C file for so many axes and lanes, "float" or "double", and load it."""
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "stepping.so"
        constants = [f"-DDIM={dim}", f"-DLANES={lanes}", f"-DREAL={real}"]
        subprocess.run(
            [COMPILER, *FLAGS, *constants, "-shared", "-fPIC", "-o", library, SOURCE, "-lm"],
            check=True,
        )
        return ctypes.CDLL(str(library))


def _model_type(real: type[Any]) -> type[ctypes.Structure]:
    """Return `struct model` of the C file."""
    fields = [(name, ctypes.c_int32) for name in _INTEGERS]
    fields += [(name, ctypes.c_void_p) for name in (*_INDICES, *_REALS, "bend_compliance")]
    fields += [(name, real) for name in _TIMES]
    return type("CModel", (ctypes.Structure,), {"_fields_": fields})


class NativeWorld:
    """`num_worlds` copies of a Model, advanced by the C kernel on one thread.

    Attributes:
        x: Positions (W, N, dim) [m].
        v: Velocities (W, N, dim) [m/s].

    Raises:
        ValueError: If the model has more than chains, distances and bends.
    """

    def __init__(
        self, model: Model, num_worlds: int, dt: float, substeps: int, *, lanes: int, dtype: Any
    ) -> None:
        _check(model)
        self.dtype, self.substeps = np.dtype(dtype), substeps
        real, word = (
            ("float", ctypes.c_float) if self.dtype == np.float32 else ("double", ctypes.c_double)
        )
        library = compiled(model.dim, lanes, real)
        self._advance = library.advance
        self.x = np.repeat(model.positions[None].astype(dtype), num_worlds, axis=0)
        self.v = np.zeros_like(self.x)
        self._tables = self._read(model)
        timing = timing_of(model, dt, substeps, self.dtype)
        values = {name: word(getattr(timing, name)) for name in _TIMES}
        values |= {name: array.ctypes.data for name, array in self._tables.items()}
        counts = (
            model.num_particles,
            len(model.pins),
            len(model.chains.offsets) - 1,
            len(model.distances.rest),
            len(model.bends.compliance),
        )
        values |= dict(zip(_INTEGERS, counts, strict=True))
        self._model = _model_type(word)(**values)
        # on a cache line of its own, as vector loads want it
        size = model.num_particles * library.row_size()
        self._memory = np.zeros(size + 64, dtype=np.uint8)
        self._work = ctypes.c_void_p(-(-self._memory.ctypes.data // 64) * 64)

    def _read(self, model: Model) -> dict[str, np.ndarray]:
        """Return the tables as the C file names and reads them."""
        chains, distances = model.chains, model.distances
        indices = (
            model.pins, chains.offsets, chains.particles, distances.pairs, model.bends.triples,
        )  # fmt: skip
        reals = (
            model.inverse_mass, model.gravity, chains.rest, chains.compliance, chains.greatest,
            distances.rest, distances.compliance, model.bends.compliance,
        )  # fmt: skip
        tables = {n: a.astype(np.int32) for n, a in zip(_INDICES, indices, strict=True)}
        names = (*_REALS, "bend_compliance")
        return tables | {n: as_read(a, self.dtype) for n, a in zip(names, reals, strict=True)}

    def step(self, targets: np.ndarray) -> None:
        """Advance every world by one control step; targets are (W, P, dim) [m]."""
        failed = self._advance(
            ctypes.byref(self._model),
            ctypes.c_int64(len(self.x)),
            ctypes.c_int64(self.substeps),
            self.x.ctypes.data_as(ctypes.c_void_p),
            self.v.ctypes.data_as(ctypes.c_void_p),
            targets.ctypes.data_as(ctypes.c_void_p),
            self._work,
        )
        if failed:
            raise RuntimeError("a world passed the speed limit: the scene is too violent")


def _check(model: Model) -> None:
    """Refuse models of which the C file would leave something out."""
    absent = ("ropes", "limits", "rods", "hinges", "folds", "volumes", "shape_matches")
    absent += ("attachments", "colliders", "self_collision", "encounters")
    present = [name for name in absent if getattr(model, name) is not None]
    if np.isfinite([model.room.lower, model.room.upper]).any():
        present.append("room")
    if model.integrator != "pbd" or model.iterations != 1 or len(model.grabbable):
        present.append("another integrator, more iterations or grabs")
    soft = (model.bends.friction, model.chains.damping, 1.0 - model.distances.stiffness)
    if any(np.any(values) for values in soft):
        present.append("friction, damping or a stiffness below 1")
    if present:
        raise ValueError(f"the C kernel has no {', '.join(present)}")

"""Compiles the kernels, once per (axes, lanes), into a disk cache that cannot go stale.

The kernels package is loaded under one name per pair of compile-time constants, as a C++ template
is instantiated: `kernels` with DIM = 2 and LANES = 1 is the module `kernels_2d_1`. numba would not
notice that a called function in another file changed, so the cache folder is named by a hash of
all kernel sources, of numba's version and of the processor compiled for; within it, the folder of
each package by a hash of its files.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import importlib.util
import operator
import os
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import llvmlite.binding as llvm
import numba
from numba.core import cgutils, ir, types
from numba.core.compiler import Compiler
from numba.core.ir_utils import alias_analysis_extensions
from numba.core.registry import CPUDispatcher
from numba.extending import intrinsic

_SETTINGS: Any = importlib.import_module("numba.core.config")
# whether kernels are run as plain Python (NUMBA_DISABLE_JIT)
DISABLED = bool(_SETTINGS.DISABLE_JIT)
_KERNELS = Path(__file__).parent / "kernels"
# two threads that load the same kernels would see each other's half-loaded modules
_loading = threading.Lock()


def kernel(function: Callable[..., Any], **options: Any) -> Any:
    """Compile a function that other kernels call, to IEEE arithmetic.

    No fastmath: the bits must not depend on the processor. error_model="numpy", as the branch that
    raises ZeroDivisionError would stop the vectoriser. What would unpack the arguments from Python
    objects is left out: for a model's tables it took as long to compile as the function itself.
    """
    dispatcher = _compiled(
        function, no_cpython_wrapper=True, no_cfunc_wrapper=True, _nrt=False, **options
    )
    if not DISABLED:
        dispatcher.__class__ = _Inner
    return dispatcher


def entry(function: Callable[..., Any], **options: Any) -> Any:
    """Compile a kernel that Python calls; it runs without the interpreter lock."""
    return _compiled(function, nogil=True, no_cfunc_wrapper=True, **options)


class _Inner(CPUDispatcher):
    """Refuses calls from Python: they would jump to an address that is not there."""

    def __call__(self, *_: Any) -> Any:
        raise TypeError(f"{self.__name__} is called by kernels only; make it an entry to call it")


def _compiled(function: Callable[..., Any], **options: Any) -> Any:
    """Compile a function with numba, cached on disk if a folder can be written."""
    options["error_model"] = "numpy"
    folder = cache_folder()
    if folder is None:
        return numba.njit(**options)(function)
    # numba names its files after the source file alone: each loaded package needs a folder of its
    # own
    package = function.__module__.split(".")[-2]
    folder /= f"{package}-{_digest_of(Path(function.__code__.co_filename).parent)}"
    before, _SETTINGS.CACHE_DIR = _SETTINGS.CACHE_DIR, str(folder)
    try:
        return numba.njit(cache=True, **options)(function)
    finally:
        _SETTINGS.CACHE_DIR = before


class _Apart(Compiler):
    """Tells LLVM that what is written through one pointer is not read through another."""

    def define_pipelines(self) -> Any:
        self.state.flags.noalias = True
        return super().define_pipelines()


# For what is handed rows of different particles. It vectorises without first comparing where they
# are, and without a second loop for the case that they overlap.
apart = functools.partial(kernel, pipeline_class=_Apart)

# For what Python hands a whole model and what allocates nothing.
borrowing = functools.partial(entry, _nrt=False)

# For what is handed a whole model: in a call its tables would be copied, some hundred words.
in_place = functools.partial(kernel, forceinline=True)


@functools.cache
def _digest_of(package: Path) -> str:
    """Return a hash of the source files of a package: its functions may call each other."""
    digest = hashlib.sha256()
    for source in sorted(package.glob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _row(typing_context: Any, array: Any, index: Any) -> Any:
    """Type and generate `row` (a numba intrinsic)."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        view = context.make_array(signature.args[0])(context, builder, arguments[0])
        stride = cgutils.unpack_tuple(builder, view.strides, 2)[0]
        address = builder.ptrtoint(view.data, stride.type)
        address = builder.add(address, builder.mul(stride, arguments[1]))
        return builder.inttoptr(address, view.data.type)

    return types.CPointer(array.dtype)(array, types.intp), generate


# A bare pointer to a row of a two-dimensional array. A view would be counted as a reference, and
# the atomic counting of three views per constraint takes longer than the arithmetic on 16 lanes.
row: Any = operator.getitem if DISABLED else intrinsic(_row)


def _keep_write(
    write: Any, arguments: Any, typemap: Any, function: Any, aliases: Any, kept: set[str]
) -> None:
    """Have what is written into kept (an extension of numba's analysis of aliases).

    After writing a function into its caller numba throws dead code away, and takes for dead what is
    written into neither an argument nor what is read later. That a pointer of `row` points into an
    argument it cannot know. What is dead indeed LLVM finds.
    """
    kept.add(write.target.name)


alias_analysis_extensions[ir.SetItem] = _keep_write


def load_kernels(dim: int, lanes: int) -> ModuleType:
    """Return the kernels' step module for `dim` axes and `lanes` worlds side by side."""
    with _loading:
        return _load_kernels(dim, lanes)


@functools.cache
def _load_kernels(dim: int, lanes: int) -> ModuleType:
    name = f"{__package__}.kernels_{dim}d_{lanes}"
    spec = importlib.util.spec_from_file_location(
        name, _KERNELS / "__init__.py", submodule_search_locations=[str(_KERNELS)]
    )
    if spec is None or spec.loader is None:
        raise ImportError(f"the kernels are missing at {_KERNELS}")
    package = importlib.util.module_from_spec(spec)
    sys.modules[name] = package
    spec.loader.exec_module(package)
    package.DIM, package.LANES = dim, lanes  # pyright: ignore[reportAttributeAccessIssue]
    return importlib.import_module(f"{name}.step")


def compiled_for(function: Any, arguments: tuple[Any, ...]) -> Callable[..., Any]:
    """Return the machine code of a kernel that was called with arguments of these types before.

    Called through numba's dispatcher, the types of all arrays of a model are found out again in
    every call, which takes as long as a step of a small model. The machine code trusts its caller.
    """
    if DISABLED:
        return function
    return function.get_overload(tuple(map(function.typeof_pyval, arguments)))


def loaded_lanes(dim: int) -> int | None:
    """Return the lanes of kernels that are loaded already, None if there are none.

    A world that is needed once (to let a body settle) takes these and compiles nothing more.
    """
    prefix = f"{__package__}.kernels_{dim}d_"
    lanes = [name[len(prefix) :] for name in sys.modules if name.startswith(prefix)]
    return min((int(text) for text in lanes if text.isdigit()), default=None)


@functools.cache
def cache_folder() -> Path | None:
    """Return the folder of compiled kernels: the first that can be written; None if none can.

    NUMBA_CACHE_DIR is taken before the user's cache folder, then the system's temporary folder.
    """
    digest = hashlib.sha256()
    # what every package may call or be compiled for
    shared = [
        Path(__file__).with_name(name)
        for name in ("compiling.py", "parameters.py", "tables.py", "tickets.py", "portable.py")
    ]
    for source in (*sorted(_KERNELS.glob("*.py")), *shared):
        digest.update(source.read_bytes())
    target = (
        numba.__version__,
        sys.version,
        os.environ.get("NUMBA_CPU_NAME") or llvm.get_host_cpu_name(),
        os.environ.get("NUMBA_CPU_FEATURES"),
        # NUMBA_DISABLE_JIT and other switches change what is compiled
        os.environ.get("NUMBA_BOUNDSCHECK"),
    )
    digest.update(repr(target).encode())
    name = f"kernels-{digest.hexdigest()[:16]}"
    home = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    user = os.getuid() if hasattr(os, "getuid") else "user"
    candidates = [
        os.environ.get("NUMBA_CACHE_DIR"),
        os.path.join(home, "pbd_gym"),
        os.path.join(tempfile.gettempdir(), f"pbd_gym-{user}"),
    ]
    for candidate in filter(None, candidates):
        folder = Path(candidate) / name
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                return folder
        except OSError:
            continue
    return None


def announce_compilation(variant: str) -> Callable[[], None]:
    """Say in one line on stderr that kernels are about to be compiled, if they are.

    Args:
        variant: What tells this compilation from others, in words.

    Returns:
        A function to call when the kernels have run: it notes that they are on disk now.
    """
    folder = cache_folder()
    mark = None if folder is None else folder / f"{variant.replace(', ', '-')}.compiled"
    if mark is not None and mark.exists():
        return lambda: None
    where = "not kept: no cache folder can be written" if folder is None else f"kept in {folder}"
    print(
        f"pbd_gym: compiling kernels ({variant}), about 10 seconds, once; {where}",
        file=sys.stderr,
        flush=True,
    )
    return lambda: mark.touch() if mark is not None and mark.parent.exists() else None

"""Which kernels of the rope and the cloth are vector code, counted in their machine code.

Each kernel is optimised by itself before it is written into its callers, so its own assembly tells
how its loop over the lanes came out. A packed instruction calculates in as many lanes as its vector
is wide, a scalar one in one lane. What stands before the lane loop, as the masses of a constraint,
is a handful of scalar instructions; a loop that was not vectorised, or not to its end, has many.
"""

from __future__ import annotations

import argparse
import os
import platform
import re
import sys
import tempfile
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from numba.core.dispatcher import Dispatcher

from records import table

_ARITHMETIC = r"\tv?(?:add|sub|mul|div|sqrt|fn?m(?:add|sub)\d+)"
_PACKED = re.compile(rf"{_ARITHMETIC}p[sd]\t.*%([xyz])mm")
_SCALAR = re.compile(rf"{_ARITHMETIC}s[sd]\t")
_BITS = {"x": 128, "y": 256, "z": 512}
_SCENES = ("rope", "cloth")


class Row(NamedTuple):
    """The arithmetic of one kernel.

    Attributes:
        kernel: File and function.
        bits: Of the widest vector on which it calculates; 0 if there is none.
        packed: Instructions of vector arithmetic.
        scalar: Instructions of scalar arithmetic.
        calls: Calls of other functions.
    """

    kernel: str
    bits: int
    packed: int
    scalar: int
    calls: int


def measure(scene: str, lanes: int | None = None) -> list[Row]:
    """Compile the kernels for a scene; return those that calculate."""
    # kernels that were loaded from disk cannot be read: `main` has taken an empty folder first
    from driven import driven_cloth, driven_rope
    from pbd_gym.physics import World
    from pbd_gym.physics.compiling import load_kernels

    driven = driven_rope() if scene == "rope" else driven_cloth()
    world = World(driven.model, 64, num_threads=1, lanes=lanes)
    world.step(1.0 / 60.0, driven.substeps)
    package = load_kernels(world.model.dim, world.lanes).__package__
    rows = [_row(kernel) for kernel in _compiled(f"{package}.")]
    return [row for row in rows if row.packed + row.scalar > 0]


def _compiled(package: str) -> Iterator[Dispatcher]:
    """Yield the kernels of a package that were compiled."""
    for name in sorted(sys.modules):
        if name.startswith(package):
            for member in vars(sys.modules[name]).values():
                own = isinstance(member, Dispatcher) and member.py_func.__module__ == name
                if own and member.overloads:
                    yield member


def _row(kernel: Any) -> Row:
    compiled = next(iter(kernel.overloads.values()))
    assembly = compiled.library.get_asm_str()
    begin = assembly.index(f"\n{compiled.fndesc.mangled_name}:")
    body = assembly[begin : assembly.index(".Lfunc_end", begin)]
    vectors = _PACKED.findall(body)
    return Row(
        kernel=f"{kernel.py_func.__module__.split('.')[-1]}.{kernel.py_func.__name__}",
        bits=max((_BITS[vector] for vector in vectors), default=0),
        packed=len(vectors),
        scalar=len(_SCALAR.findall(body)),
        calls=body.count("\tcall"),
    )


def report(rows: Sequence[Row]) -> str:
    """Return the counts as markdown."""
    head = ["kernel", "vector [bit]", "packed", "scalar", "calls"]
    return table(head, [[f"`{row.kernel}`", *map(str, row[1:])] for row in rows])


def main(arguments: Sequence[str] | None = None) -> int:
    """Compile and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="+", choices=_SCENES, default=_SCENES)
    parser.add_argument("--lanes", type=int, help="(default: those of a batch)")
    options = parser.parse_args(arguments)
    if platform.machine() not in ("x86_64", "AMD64"):
        print("left out: reads assembly of x86-64 only", file=sys.stderr)
        return 0
    with tempfile.TemporaryDirectory() as folder:
        os.environ["NUMBA_CACHE_DIR"] = folder
        for scene in options.scenes:
            print(f"{scene}\n\n{report(measure(scene, options.lanes))}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Tiles of worlds, handed out one by one to whichever thread is free.

To wake a sleeping thread takes as long as a step of a thousand small worlds. So helpers stay awake
for a while after a step, and look out for the next; and the thread that was asked for the step
waits for nobody to come: it takes whatever tiles are left. Which thread advances a tile makes no
difference to its bits.
"""

from __future__ import annotations

import operator
import threading
from typing import Any

import numpy as np
from llvmlite import ir as llvm_ir
from numba.core import cgutils, types
from numba.extending import intrinsic

from pbd_gym.physics.compiling import DISABLED, entry, kernel

# Places in the array of tickets, a cache line apart: threads write them at the same time.
_NEXT, _DONE, _COUNT, _LINGER, _HELPERS = 0, 8, 16, 24, 32
_LINE = 8  # numbers
# In a helper's line: whether it is present, and how often in a row it waited in vain.
_PRESENT, _VAIN = 0, 1
# Looks at the tickets before a helper goes to sleep, about half a millisecond.
LINGER = 1 << 20
# Where steps come more slowly than that, only every so many times does a helper wait at all: its
# core may be somebody else's.
_SELDOM = 16
# Looks before the thread that was asked for the step lets others have its core.
_PATIENCE = 1 << 14


def new_tickets(helpers: int, linger: int) -> np.ndarray:
    """Return tickets of no tiles.

    Args:
        helpers: Number of threads that help.
        linger: How often they look for more before they leave.
    """
    tickets = np.zeros(_HELPERS + _LINE * helpers, dtype=np.int64)
    tickets[_LINGER] = linger
    return tickets


def called(tickets: np.ndarray, helper: int) -> bool:
    """Note that a helper is present; return whether it has to be called because it was not."""
    line = _HELPERS + _LINE * helper
    absent = tickets[line + _PRESENT] == 0
    tickets[line + _PRESENT] = 1
    return bool(absent)


def _place(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    array = context.make_array(signature.args[0])(context, builder, arguments[0])
    return cgutils.gep_inbounds(builder, array.data, arguments[1])


def _add(typing_context: Any, array: Any, index: Any) -> Any:
    """Add 1 to a number, whole; return what it was (a numba intrinsic)."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = _place(context, builder, signature, arguments)
        one = llvm_ir.Constant(llvm_ir.IntType(64), 1)
        return builder.atomic_rmw("add", place, one, "seq_cst")

    return types.int64(array, types.intp), generate


def _read(typing_context: Any, array: Any, index: Any) -> Any:
    """Return a number that other threads write (a numba intrinsic)."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = _place(context, builder, signature, arguments)
        return builder.load_atomic(place, "seq_cst", 8)

    return types.int64(array, types.intp), generate


def _write(typing_context: Any, array: Any, index: Any, value: Any) -> Any:
    """Write a number that other threads read (a numba intrinsic)."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = _place(context, builder, signature, arguments)
        builder.store_atomic(arguments[2], place, "seq_cst", 8)
        return context.get_dummy_value()

    return types.void(array, types.intp, types.int64), generate


_alone = threading.Lock()


def _add_uncompiled(array: Any, index: int) -> int:
    with _alone:
        array[index] += 1
        return int(array[index]) - 1


add: Any = _add_uncompiled if DISABLED else intrinsic(_add)
read: Any = operator.getitem if DISABLED else intrinsic(_read)
write: Any = operator.setitem if DISABLED else intrinsic(_write)


@entry
def open_tickets(tickets: Any, count: int) -> None:
    """Hand out the tiles 0 <= tile < count. All earlier ones must be done."""
    write(tickets, _DONE, 0)
    write(tickets, _COUNT, count)
    write(tickets, _NEXT, 0)


@kernel
def take(tickets: Any) -> int:
    """Return a tile that no other thread has, -1 if there is none left."""
    if read(tickets, _NEXT) >= read(tickets, _COUNT):
        return -1
    tile = add(tickets, _NEXT)
    return tile if tile < read(tickets, _COUNT) else -1


@kernel
def finish(tickets: Any) -> None:
    """Note that a tile that was taken is done."""
    add(tickets, _DONE)


@kernel
def is_done(tickets: Any) -> bool:
    """Return whether all tiles are done, after some waiting for those that others have taken."""
    looks = 0
    while read(tickets, _DONE) < read(tickets, _COUNT) and looks < _PATIENCE:
        looks += 1
    return looks < _PATIENCE


@kernel
def are_more(tickets: Any, helper: int) -> bool:
    """Return whether there are tiles again, after some waiting; if not, the helper is gone."""
    line = _HELPERS + _LINE * helper
    vain = read(tickets, line + _VAIN)
    looks = read(tickets, _LINGER) if vain % _SELDOM == 0 else 0
    for _ in range(looks):
        if read(tickets, _NEXT) < read(tickets, _COUNT):
            write(tickets, line + _VAIN, 0)
            return True
    write(tickets, line + _VAIN, vain + 1)
    write(tickets, line + _PRESENT, 0)
    return False

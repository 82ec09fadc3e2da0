"""The threads that all worlds of a process share, and how those of one world work together."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from pbd_gym.physics.tickets import LINGER, called, new_tickets, open_tickets


def cores() -> int:
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


class Crew:
    """A compiled function run on the tiles of some worlds, by the calling thread and helpers.

    Args:
        function: Called with tickets, the number of the helper, and arguments; see `advance`.
        arguments: For each thread, the calling one first.
        tiles: Number of tiles.
        linger: Whether helpers stay awake for a while to `work` again.
    """

    def __init__(
        self,
        function: Callable[..., bool],
        arguments: Sequence[tuple[Any, ...]],
        tiles: int,
        *,
        linger: bool = True,
    ) -> None:
        self._function, self._tiles = function, tiles
        self._own, *self._helpers = arguments
        self._looks = LINGER if linger else 0
        self._tickets = new_tickets(len(self._helpers), self._looks)
        self._pool: Any = None

    def work(self) -> None:
        """Have all tiles done."""
        if not self._helpers:
            open_tickets(self._tickets, self._tiles)
            self._function(self._tickets, -1, *self._own)
            return
        try:
            self._hand_out()
            self._finish()
        except BaseException:  # Ctrl-C: a helper may still be at a tile
            self._finish()
            raise

    def _hand_out(self) -> None:
        """Open the tickets, and call those helpers who sleep."""
        if self._pool is not _pool(len(self._helpers)):
            # for the first time, or in a forked child: nobody is there yet
            self._pool = _pool(len(self._helpers))
            self._tickets = new_tickets(len(self._helpers), self._looks)
        open_tickets(self._tickets, self._tiles)
        for helper, arguments in enumerate(self._helpers):
            if called(self._tickets, helper):
                self._pool.submit(self._function, self._tickets, helper, *arguments)

    def _finish(self) -> None:
        """Take part until all tiles are done."""
        while not self._function(self._tickets, -1, *self._own):
            time.sleep(0)

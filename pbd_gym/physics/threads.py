"""The threads that all worlds of a process share."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor


def cores() -> int:
    """Number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


_pools: dict[int, ThreadPoolExecutor] = {}
if hasattr(os, "register_at_fork"):
    # the threads of a pool do not live on in a forked child: it makes its own
    os.register_at_fork(after_in_child=_pools.clear)


def pool(size: int) -> ThreadPoolExecutor:
    """Return the pool of `size` threads that all worlds of this process share."""
    if size not in _pools:
        _pools[size] = ThreadPoolExecutor(size, thread_name_prefix="pbd_gym")
    return _pools[size]

"""Files that are either whole or not there."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


@contextmanager
def write_atomically(path: Path) -> Iterator[BinaryIO]:
    """Open a temporary file that takes the place of `path` once it is complete and on disk.

    A crash or a kill at any moment leaves the old file as it was.
    """
    temporary = path.with_name(f"{path.name}.partial")
    try:
        with temporary.open("wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def check_room(path: Path) -> None:
    """Raise OSError unless the disk has room to write `path` again, beside itself.

    Twice its size is asked for, as models, pictures and logs need some as well.
    """
    size, free = path.stat().st_size, shutil.disk_usage(path).free
    if free < 2 * size:
        raise OSError(
            errno.ENOSPC,
            f"{2 * size / 1e6:.1f} MB are needed to replace a file of {size / 1e6:.1f} MB, "
            f"{free / 1e6:.1f} MB are free",
            str(path),
        )

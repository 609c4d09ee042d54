"""One batch at a time works on a folder: the lock goes with the process that holds it, however that ends."""

from __future__ import annotations

import os
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ..errors import InputError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold the lock file while in the block.

    Raises: InputError where another process holds it, or the folder can't be written to.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        number = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise InputError(f"can't write to {path.parent} ({error.strerror}); choose another -o") from error
    try:
        if fcntl is not None:
            _hold(number, path)
        os.truncate(number, 0)
        os.write(number, f"{os.getpid()}\n".encode())
        yield
    finally:
        os.close(number)


def _hold(number: int, path: Path) -> None:
    assert fcntl is not None
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        holder = os.pread(number, 20, 0).decode(errors="replace").strip() or "unknown"
        raise InputError(
            f"process {holder} works on {path.parent}, expected one batch at a time; wait for it, choose "
            "another -o, or give each machine a --shard of its own"
        ) from error

"""Forked processes: torch's threads don't come along, and the first work they would share waits for them for ever.

GNU OpenMP keeps the threads of a process in a pool.  A fork copies the record of the pool and none of its threads, so
the copy hangs at the first parallel operation.  Processes that are spawned, or forked before torch was loaded, are
whole; so is a copy that computes with one thread.
"""

from __future__ import annotations

import os
import sys

from ..errors import FlexparaError

_parents_with_torch: list[int] = []
"""Of this process: the parent that had loaded torch when it was forked, if there is one."""


def _remember() -> None:
    _parents_with_torch[:] = [os.getppid()] if "torch" in sys.modules else []


if hasattr(os, "register_at_fork"):  # absent where processes can't be forked
    os.register_at_fork(after_in_child=_remember)


def refuse_fork_of_torch() -> None:
    """Refuse to compute with torch where it would hang.

    Raises: FlexparaError in a process that was forked after torch had been loaded, unless torch has one thread only.
    """
    if not _parents_with_torch or sys.modules["torch"].get_num_threads() == 1:
        return
    raise FlexparaError(
        f"process {os.getpid()} was forked from process {_parents_with_torch[0]} after torch had been loaded there, "
        "expected a process of its own, as torch would wait for threads that a fork leaves behind; start workers with "
        'multiprocessing.get_context("spawn"), or call torch.set_num_threads(1) in each'
    )

"""How many things this process does at once: one for each core that it may use.

A pinned process may use fewer than the machine has; one that shares a machine with others of a batch is told how many
by the environment.
"""

from __future__ import annotations

import os

LIMIT = "FLEXPARA_CORES"
"""Variable of the environment: cores to use, where that is fewer than there are."""


def own_cores() -> list[int]:
    """Numbers of the cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


def core_count() -> int:
    """Cores to use: those that this process may run on, or fewer where the environment says so."""
    asked = os.environ.get(LIMIT, "")
    return min(len(own_cores()), max(int(asked), 1)) if asked.isdecimal() else len(own_cores())

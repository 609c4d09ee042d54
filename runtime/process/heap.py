"""Memory that was freed stays with the process: the system would give the same pages out again, zeroed, one by one.

Arrays of megabytes come and go by the thousand.  The C library gets each from the system and gives it back, and every
page of it costs a fault: a seventh of an unwrap's time.  What is kept is bounded, and only what is used counts anew.
"""

from __future__ import annotations

import ctypes
import sys
from dataclasses import dataclass

TRIM_THRESHOLD, TOP_PAD, MMAP_THRESHOLD = -1, -2, -3
"""Names of the parameters in glibc's malloc.h."""


@dataclass(frozen=True)
class Kept:
    """Bytes.  free: that may lie at the heap's end before they are given back.  pad: taken at once as it grows.

    mapped: size of an array from which it has pages of its own, which are given back with it.
    """

    free: int = 256 << 20
    pad: int = 64 << 20
    mapped: int = 64 << 20


def keep_freed_memory(kept: Kept = Kept()) -> bool:
    """Tell the C library so, for the rest of the process; False where it is another than glibc."""
    if not sys.platform.startswith("linux"):
        return False
    library = ctypes.CDLL(None)
    if not hasattr(library, "gnu_get_libc_version"):
        return False
    asked = ((TRIM_THRESHOLD, kept.free), (TOP_PAD, kept.pad), (MMAP_THRESHOLD, kept.mapped))
    return all(library.mallopt(name, size) for name, size in asked)


def give_freed_memory_back() -> None:
    """What is free goes back to the system, that which lies between what is used too."""
    if sys.platform.startswith("linux"):
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(ctypes.c_size_t(0))

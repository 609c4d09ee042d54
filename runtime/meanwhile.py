"""Modules that are needed later, loaded while this process waits for copies of itself anyway."""

from __future__ import annotations

import sys
from contextlib import suppress
from importlib import import_module

_waiting: list[str] = []


def load_meanwhile(*modules: str) -> None:
    """Load modules, one at a time, whenever there is nothing else to do; whoever needs one sooner imports it."""
    _waiting.extend(name for name in modules if name not in sys.modules and name not in _waiting)


def load_next() -> bool:
    """Load the next of them; False where none is left."""
    if not _waiting:
        return False
    with suppress(ImportError):  # said where the module is needed
        import_module(_waiting.pop(0))
    return True

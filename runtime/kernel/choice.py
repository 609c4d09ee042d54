"""Whether the compiled kernel does the work, or its twins in Python."""

from __future__ import annotations

import os
from contextlib import contextmanager
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import ModuleType

SWITCH = "FLEXPARA_KERNEL"
"""Environment variable: "off" for the twins."""


def compiled() -> ModuleType | None:
    """The compiled module, where the installation had a compiler."""
    try:
        return import_module(".compiled", __package__)
    except ImportError:
        return None


_chosen: list[Any] = [None if os.environ.get(SWITCH) == "off" else compiled()]
"""The last one counts."""


def kernel() -> Any | None:
    """The compiled module; None where the twins do the work."""
    return _chosen[-1]


@contextmanager
def twins_only() -> Iterator[None]:
    """Within this, the twins do the work."""
    _chosen.append(None)
    try:
        yield
    finally:
        _chosen.pop()


def describe() -> str:
    """What `flexpara doctor` shows.

    Raises: ImportError where nothing was compiled.
    """
    if compiled() is None:
        raise ImportError("not compiled: the same in Python, at a third of the speed")
    return "compiled" if kernel() is not None else f"compiled, but {SWITCH}=off"

"""Whether the compiled kernel does the work, or its twins in Python."""

from __future__ import annotations

import os
from contextlib import contextmanager
from importlib import import_module
from typing import TYPE_CHECKING, Any

from ..errors import MissingDependencyError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import ModuleType

EDITION = 12
"""Of the kernel's functions; one more wherever they change."""
SWITCH = "FLEXPARA_KERNEL"
"""Environment variable: "off" for the twins."""


def compiled() -> ModuleType | None:
    """The compiled module, where the installation had a compiler.

    Raises: MissingDependencyError where it was compiled from other sources than these.
    """
    try:
        module = import_module(".compiled", __package__)
    except ImportError:
        return None
    found = getattr(module, "edition", 0)
    if found != EDITION:
        how = f"python scripts/build_kernel.py in the checkout, install flexpara again, or set {SWITCH}=off"
        raise MissingDependencyError(f"the compiled kernel is of edition {found}, expected {EDITION}; {how}")
    return module


_chosen: list[Any] = []
"""The last one counts; empty until the first time that it matters."""


def kernel() -> Any | None:
    """The compiled module; None where the twins do the work."""
    if not _chosen:
        _chosen.append(None if os.environ.get(SWITCH) == "off" else compiled())
    return _chosen[-1]


@contextmanager
def twins_only() -> Iterator[None]:
    """Within this, the twins do the work."""
    kernel()
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

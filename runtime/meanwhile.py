"""Modules that are needed once charts are found, loaded while this process waits for copies of itself anyway."""

from __future__ import annotations

from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec

from .extras import requires

PACKAGES = ("scipy.optimize", "onnx", "onnxruntime")
OURS = (".pack.asked", ".geometry.metrics", ".sessions.agreement", "..export.assemble")
_waiting: list[str] = []


def load_meanwhile() -> None:
    """Load them one at a time, whenever there is nothing else to do; whoever needs one sooner imports it.

    Raises: MissingDependencyError where one of the packages is absent: before charts are found, not after.
    """
    with requires("unwrap"):
        for name in PACKAGES:
            if find_spec(name) is None:
                raise ModuleNotFoundError(f"No module named {name!r}", name=name)
    _waiting[:] = [*PACKAGES, *OURS]


def load_next() -> bool:
    """Load the next of them; False where none is left."""
    if not _waiting:
        return False
    with suppress(ImportError):  # said where the module is needed
        import_module(_waiting.pop(0), __package__)
    return True

"""Modules that are needed once charts are found, loaded while this process waits for copies of itself anyway."""

from __future__ import annotations

from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING

from ..extras import requires

if TYPE_CHECKING:
    from collections.abc import Sequence

_waiting: list[str] = []


def load_meanwhile(packages: Sequence[str], modules: Sequence[str]) -> None:
    """Load packages, then modules of ours, by full names, one at a time, whenever there is nothing else to do.

    Whoever needs one sooner imports it.

    Raises: MissingDependencyError where one of the packages is absent: before charts are found, not after.
    """
    with requires("unwrap"):
        for name in packages:
            if find_spec(name) is None:
                raise ModuleNotFoundError(f"No module named {name!r}", name=name)
    _waiting[:] = [*packages, *modules]


def load_next() -> bool:
    """Load the next of them; False where none is left."""
    if not _waiting:
        return False
    with suppress(ImportError):  # said where the module is needed
        import_module(_waiting.pop(0))
    return True

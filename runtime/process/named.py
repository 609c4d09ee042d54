"""A function by its name: of what lies above a folder that needs it, or is to be run by another process."""

from __future__ import annotations

from importlib import import_module
from typing import Any


def named(function: str) -> Any:
    """The function that MODULE:FUNCTION names."""
    module, _, name = function.partition(":")
    return getattr(import_module(module), name)

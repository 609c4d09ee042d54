"""Dataclasses of arrays that are shown in a line, as a notebook shows them: shapes instead of numbers."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

MOST = 8
"""Entries of a tuple, list or dict that are shown where all of them are words and numbers."""


class Brief:
    """The repr of a dataclass that is made with repr=False: what is None is left out."""

    def __repr__(self) -> str:
        values = {each.name: getattr(self, each.name) for each in fields(self) if each.repr}  # pyright: ignore[reportArgumentType]
        shown = ", ".join(f"{name}={brief(value)}" for name, value in values.items() if value is not None)
        return f"{type(self).__name__}({shown})"


def brief(value: Any) -> str:
    """An array as its dtype and shape, bytes and collections as their number, anything else as its repr."""
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape}"
    if isinstance(value, bytes):
        return f"{len(value)} bytes"
    if isinstance(value, tuple | list | dict):
        entries = value.values() if isinstance(value, dict) else value
        if len(value) > MOST or not all(isinstance(entry, str | int | float) for entry in entries):
            return f"{type(value).__name__} of {len(value)}"
    return repr(value)

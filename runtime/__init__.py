"""Evaluate, pack and store atlases: numpy, scipy, trimesh and onnxruntime only, never torch or OpenGL.

Lazy: `flexpara.runtime.UnwrapSession` loads onnxruntime when it is first named, and nothing else does.
"""

from __future__ import annotations

import os
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .geometry.metrics import measure
    from .io.meshfile import load_asset
    from .mesh import Asset, Atlas, Charts, Frame, Surface
    from .sessions.session import UnwrapSession
    from .sessions.wrapsession import WrapSession

__all__ = ["Asset", "Atlas", "Charts", "Frame", "Surface", "UnwrapSession", "WrapSession", "load_asset", "measure"]

_HOME = dict.fromkeys(("Asset", "Atlas", "Charts", "Frame", "Surface"), "mesh") | {
    "UnwrapSession": "sessions.session",
    "WrapSession": "sessions.wrapsession",
    "load_asset": "io.meshfile",
    "measure": "geometry.metrics",
}

# onnxruntime 1.31 counts its users: it keeps an identifier in their home, and warns on stderr where it can't.  Read
# once, when onnxruntime is first imported; who wants it sets it to 0.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")


def __getattr__(name: str) -> object:
    """Load a public name from its module the first time it is asked for."""
    if name in _HOME:
        return getattr(import_module(f".{_HOME[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

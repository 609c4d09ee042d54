"""Evaluate, pack and store atlases: numpy, scipy, trimesh, xatlas and onnxruntime only, never torch or OpenGL.

Lazy: `flexpara.runtime.UnwrapSession` loads onnxruntime when it is first named, and nothing else does.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .mesh import Asset, Atlas, Charts, Frame, Surface
    from .meshfile import load_asset
    from .metrics import measure
    from .session import UnwrapSession
    from .wrapsession import WrapSession

__all__ = ["Asset", "Atlas", "Charts", "Frame", "Surface", "UnwrapSession", "WrapSession", "load_asset", "measure"]

_HOME = dict.fromkeys(("Asset", "Atlas", "Charts", "Frame", "Surface"), "mesh") | {
    "UnwrapSession": "session",
    "WrapSession": "wrapsession",
    "load_asset": "meshfile",
    "measure": "metrics",
}


def __getattr__(name: str) -> object:
    """Load a public name from its module the first time it is asked for."""
    if name in _HOME:
        return getattr(import_module(f".{_HOME[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

"""flexpara: the public API. This repository's root folder is the package `flexpara`."""

from __future__ import annotations

__version__ = "0.1.0"
__all__: list[str] = []

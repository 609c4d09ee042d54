"""Files beside a mesh file that it names: buffers and pictures of glTF, material libraries of OBJ and their pictures.

Nothing is decoded: this is for who asks whether a mesh has changed.
"""

from __future__ import annotations

import json
import mmap
import re
from typing import TYPE_CHECKING
from urllib.parse import unquote

from .limits import limits

if TYPE_CHECKING:
    from pathlib import Path

LIBRARY = re.compile(rb"^[ \t]*mtllib[ \t]+([^\r\n]+)", re.MULTILINE)
PICTURE = re.compile(rb"^[ \t]*(?:map_\w+|norm|bump|disp|decal|refl)[ \t]+([^\r\n]+)", re.MULTILINE | re.IGNORECASE)


def companions(path: Path) -> list[Path]:
    """The files that a mesh file names and that are there, each once; none for a file that can't be read."""
    kind = path.suffix.lower()
    if kind not in (".gltf", ".obj"):
        return []
    try:
        if not 0 < path.stat().st_size <= limits().bytes or not path.is_file():
            return []
        found = _of_gltf(path) if kind == ".gltf" else _of_obj(path)
        return [file for file in dict.fromkeys(found) if file.is_file()]
    except (OSError, ValueError, RecursionError):  # reading it will say what is wrong
        return []


def _of_gltf(path: Path) -> list[Path]:
    tree = json.loads(path.read_bytes())
    lists = [tree.get(name) for name in ("buffers", "images")] if isinstance(tree, dict) else []
    parts = [part for entry in lists if isinstance(entry, list) for part in entry if isinstance(part, dict)]
    names = [part["uri"] for part in parts if isinstance(part.get("uri"), str)]
    return [path.parent / unquote(name) for name in names if not name.startswith("data:")]


def _of_obj(path: Path) -> list[Path]:
    libraries = [path.parent / name for name in _named(LIBRARY, path)]
    there = [library for library in libraries if library.is_file()]
    return [*libraries, *(library.parent / name for library in there for name in _named(PICTURE, library))]


def _named(pattern: re.Pattern[bytes], path: Path) -> list[str]:
    """The names in a file's lines: whole, or after options, the last word."""
    if path.stat().st_size == 0:
        return []
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        texts = [found[1].decode("utf-8", "surrogateescape").strip() for found in pattern.finditer(content)]
    return [text.split()[-1] if text.startswith("-") else text for text in texts if text]

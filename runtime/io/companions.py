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
from .pictures.pictures import found_in_folder

if TYPE_CHECKING:
    from pathlib import Path

LIBRARY = re.compile(rb"^[ \t]*mtllib[ \t]+([^\r\n]+)", re.MULTILINE)
PICTURE = re.compile(rb"^[ \t]*(?:map_\w+|norm|bump|disp|decal|refl)[ \t]+([^\r\n]+)", re.MULTILINE | re.IGNORECASE)


def companions(path: Path) -> list[Path]:
    """The files in its folder that a mesh file names, each once; none for a file that can't be read."""
    kind, folder = path.suffix.lower(), path.parent
    if kind not in (".gltf", ".obj"):
        return []
    try:
        if not path.is_file() or path.stat().st_size > limits().bytes:
            return []
        if kind == ".gltf":
            return _there(folder, _of_gltf(path))
        libraries = _there(folder, _named(LIBRARY, path))
        pictures = [name for library in libraries for name in _named(PICTURE, library)]
        return list(dict.fromkeys([*libraries, *_there(folder, pictures)]))
    except (OSError, ValueError, RecursionError):  # reading it will say what is wrong
        return []


def _there(folder: Path, names: list[str]) -> list[Path]:
    found = [found_in_folder(folder, name) for name in dict.fromkeys(names)]
    return [file for file in dict.fromkeys(found) if file is not None]


def _of_gltf(path: Path) -> list[str]:
    tree = json.loads(path.read_bytes())
    lists = [tree.get(name) for name in ("buffers", "images")] if isinstance(tree, dict) else []
    parts = [part for entry in lists if isinstance(entry, list) for part in entry if isinstance(part, dict)]
    names = [part["uri"] for part in parts if isinstance(part.get("uri"), str)]
    return [unquote(name) for name in names if not name.startswith("data:")]


def _named(pattern: re.Pattern[bytes], path: Path) -> list[str]:
    """The names in a file's lines: whole, or after options, the last word."""
    if path.stat().st_size == 0:
        return []
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        texts = [found[1].decode("utf-8", "surrogateescape").strip() for found in pattern.finditer(content)]
    return [text.split()[-1] if text.startswith("-") else text for text in texts if text]

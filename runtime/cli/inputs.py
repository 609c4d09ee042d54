"""The files that a command is given: folders stand for the meshes in them, "-" for what comes in on standard input."""

from __future__ import annotations

import sys
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError, MissingFileError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cyclopts import App

STREAM = Path("-")
"""Standard input or output in the place of a path."""
ENDINGS = (".obj", ".ply", ".stl", ".off", ".glb", ".gltf", ".3mf", ".dae")
"""Of files that are taken from a folder."""
MARKS = ((b"glTF", ".glb"), (b"ply", ".ply"), (b"solid", ".stl"), (b"OFF", ".off"), (b"{", ".gltf"), (b"PK", ".3mf"))
"""Beginnings of files by which their format is known."""
STL_HEAD, STL_FACE = 84, 50
"""Bytes of a binary STL file before its faces, and of each face."""


def meshes_of(paths: Sequence[Path]) -> list[Path]:
    """The files themselves, and those in folders in the order of their names.

    Raises: InputError for two of the same stem, as their outputs have the same names; MissingFileError for a folder
    without meshes.
    """
    found = [file for path in paths for file in (_in_folder(path) if path.is_dir() else [path])]
    stems: dict[str, Path] = {}
    for path in found:
        known = stems.setdefault(path.stem, path)
        if known is not path:
            raise InputError(f"{known} and {path} would be written under one name; unwrap them into two folders")
    return found


def _in_folder(folder: Path) -> list[Path]:
    meshes = sorted(path for path in folder.iterdir() if path.suffix.lower() in ENDINGS and path.is_file())
    if not meshes:
        raise MissingFileError(f"{folder} holds no mesh, expected files such as {', '.join(ENDINGS)}; name a file")
    return meshes


def from_stdin(folder: Path) -> Path:
    """What comes in on standard input, as a file of the format that it begins like.  Raises: InputError for nothing."""
    data = sys.stdin.buffer.read()
    if not data:
        raise InputError("standard input is empty, expected a mesh; write flexpara unwrap - -o - < in.glb > out.glb")
    path = folder / f"stdin{ending_of(data)}"
    path.write_bytes(data)
    return path


def like_option(word: str, command: App) -> str:
    """What to do about an option that a command does not have: the nearest it has, or its help."""
    known = [name for argument in command.assemble_argument_collection() for name in argument.names]
    close = get_close_matches(word.partition("=")[0], known, 1)
    return f"did you mean {close[0]}?" if close else f"see {' '.join(('flexpara', *command.name))} --help"


def ending_of(data: bytes) -> str:
    """Ending of the format that a file begins like; .obj, whose lines may begin with anything, where no other fits.

    >>> ending_of(b"glTF")
    '.glb'
    """
    head = data[:1024].lstrip(b"\xef\xbb\xbf \t\r\n")
    binary = len(data) >= STL_HEAD and len(data) - STL_HEAD == STL_FACE * int.from_bytes(data[80:84], "little")
    if binary and len(data) > STL_HEAD:
        return ".stl"
    return next((ending for mark, ending in MARKS if head.startswith(mark)), ".obj")

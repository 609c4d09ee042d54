"""How much is read of a file at most.  A user raises a limit by the environment: FLEXPARA_LIMITS="faces=50000000".

It holds for every command, for the Python API, and for processes that are started; sizes are checked before memory is
taken.  Whatever lies beyond is refused by name, with the limit that would let it in.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, fields

from ..errors import InputError, MeshError

TEXTURES = 4
"""Largest textures that all of a file may come to together."""
VARIABLE = "FLEXPARA_LIMITS"
FREE = 64 << 20
"""Bytes that may be unpacked of a file however small it is."""


@dataclass(frozen=True)
class Limits:
    """Each at least 1."""

    bytes: int = 8 << 30
    """Of a file, and of what an archive unpacks to."""
    faces: int = 20_000_000
    """Triangles of a mesh or scene."""
    vertices: int = 60_000_000
    """Of a mesh or scene, before equal ones are joined."""
    texels: int = 16384 * 16384
    """Of one texture; all of a file together have four times as many."""
    ratio: int = 2000
    """Bytes that each byte of compressed or repeated data may become, beyond 64 MiB."""
    nodes: int = 100_000
    """Of a scene, instances counted, however deep they lie."""
    corners: int = 10_000
    """Of a polygon that is not convex: the time for its triangles grows with their square."""

    def demand_unpacked(self, size: int, packed: int, what: str) -> None:
        """Raises: MeshError where so many bytes are more than a file of packed bytes may become."""
        if size > max(FREE, self.ratio * packed):
            raise MeshError(
                f"{what} would take {size} bytes from {packed}, expected at most {self.ratio} for each; "
                f"{raised('ratio')}"
            )


def limits() -> Limits:
    """The limits in force.  Raises: InputError where the environment names others, or no numbers."""
    words = [word.strip() for word in os.environ.get(VARIABLE, "").split(",") if word.strip()]
    known = {field.name for field in fields(Limits)}
    chosen: dict[str, int] = {}
    for word in words:
        name, _, value = word.partition("=")
        if name not in known or not value.isdecimal() or int(value) < 1:
            raise InputError(
                f"{VARIABLE} has {word[:60]!r}, expected NAME=NUMBER with one of {', '.join(sorted(known))}; correct it"
            )
        chosen[name] = int(value)
    return Limits(**chosen)


def raised(name: str) -> str:
    """The remedy: how a limit is raised."""
    return f"where the file is yours, set {VARIABLE}={name}=NUMBER"

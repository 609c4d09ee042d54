"""A glTF document while it is changed: accessors and pictures come in, the rest stays as it was.

Old bytes are taken as they are decoded: meshopt's compression is undone, all buffers become one.  Numbers are
little-endian.  Words of the specification (Khronos, glTF 2.0.1).
"""

from __future__ import annotations

import copy
import json
import struct
from typing import TYPE_CHECKING, Any

import numpy as np

from .buffers import BINARY_CHUNK, COMPONENTS, JSON_CHUNK, GltfFile, buffer_view, read_resource
from .compression import MESHOPT
from .damage import damage_is_named
from .references import extensions_in, prune

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

VERTICES, INDICES = 34962, 34963
"""Targets of bufferViews: ARRAY_BUFFER and ELEMENT_ARRAY_BUFFER."""
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
NUMBERS = {np.dtype(kind).name: number for number, kind in COMPONENTS.items()}
MAGIC = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg", b"RIFF": "image/webp", b"\xabKTX": "image/ktx2"}
"""Beginnings of pictures, for those that a file beside the document holds."""


class Editing:
    """The tree, free to be changed, and the bytes of each of its bufferViews."""

    def __init__(self, file: GltfFile) -> None:
        """A copy of the document; the file stays as it is.  Raises: MeshError where it is damaged."""
        self.file = file
        with damage_is_named():
            self._copy(file)

    def _copy(self, file: GltfFile) -> None:
        self.tree: dict[str, Any] = copy.deepcopy(file.tree)
        self.had = extensions_in(self.tree)
        self.views = [bytes(buffer_view(file, index)[0]) for index in range(len(self.tree.get("bufferViews", [])))]
        for image in self.tree.get("images", []):
            if "uri" in image:
                data = read_resource(image.pop("uri"), file.folder)
                kind = next((kind for start, kind in MAGIC.items() if data.startswith(start)), "image/png")
                image |= {"bufferView": self.add_view(data), "mimeType": image.get("mimeType", kind)}

    def add(self, array: str, entry: dict[str, Any]) -> int:
        """Append to an array of the tree; the number of the entry."""
        self.tree.setdefault(array, []).append(entry)
        return len(self.tree[array]) - 1

    def add_view(self, data: bytes, **fields: int) -> int:
        """Append bytes; the number of their bufferView."""
        self.views.append(data)
        return self.add("bufferViews", {"buffer": 0, "byteLength": len(data), **fields})

    def add_accessor(
        self, rows: NDArray[Any], target: int = VERTICES, *, normalized: bool = False, bounds: bool = False
    ) -> int:
        """Append rows (m, c); the number of their accessor.  Rows of vertices begin at multiples of four bytes."""
        kind = rows.dtype.newbyteorder("<")
        width = rows.shape[1] * kind.itemsize
        stride = -(-width // 4) * 4 if target == VERTICES else width
        table = np.zeros((len(rows), stride), dtype=np.uint8)
        table[:, :width] = np.ascontiguousarray(rows.astype(kind)).view(np.uint8).reshape(len(rows), width)
        strided = {"byteStride": stride} if stride != width else {}
        accessor: dict[str, Any] = {
            "bufferView": self.add_view(table.tobytes(), target=target, **strided),
            "componentType": NUMBERS[rows.dtype.newbyteorder("=").name],
            "count": len(rows),
            "type": KINDS[rows.shape[1]],
        }
        if normalized:
            accessor["normalized"] = True
        if bounds:
            accessor |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        return self.add("accessors", accessor)

    def add_picture(self, name: str, png: bytes, sampler: int) -> int:
        """Append a PNG file; the number of its texture."""
        view = self.add_view(png)
        source = self.add("images", {"name": name, "mimeType": "image/png", "bufferView": view})
        return self.add("textures", {"name": name, "sampler": sampler, "source": source})

    def finished(self) -> tuple[dict[str, Any], bytes]:
        """The tree and its one buffer, without what nothing refers to any more."""
        for number, view in enumerate(self.tree.get("bufferViews", [])):
            view["content"] = number
        prune(self.tree)
        data = bytearray()
        for view in self.tree.get("bufferViews", []):
            content = self.views[view.pop("content")]
            view |= {"buffer": 0, "byteOffset": len(data), "byteLength": len(content)}
            _without_meshopt(view)
            data += content + bytes(-len(content) % 4)
        buffer = {key: value for key, value in self.tree.get("buffers", [{}])[0].items() if key in ("name", "extras")}
        self.tree["buffers"] = [{**buffer, "byteLength": len(data)}]
        self._name_extensions()
        return self.tree, bytes(data)

    def _name_extensions(self) -> None:
        """Keep the lists of extensions true: without those that are gone, with those that came in."""
        there = extensions_in(self.tree)
        for key in ("extensionsUsed", "extensionsRequired"):
            names = [name for name in self.tree.get(key, []) if name in there or name not in self.had]
            names += sorted(there - self.had - set(names)) if key == "extensionsUsed" else []
            self.tree.pop(key, None)
            if names:
                self.tree[key] = names


def _without_meshopt(view: dict[str, Any]) -> None:
    extensions = {name: value for name, value in view.pop("extensions", {}).items() if name not in MESHOPT}
    if extensions:
        view["extensions"] = extensions


def glb_of(tree: dict[str, Any], data: bytes) -> bytes:
    """The bytes of a .glb file."""
    text = json.dumps(tree, separators=(",", ":"), ensure_ascii=False).encode()
    text += b" " * (-len(text) % 4)
    chunks = b"".join(
        struct.pack("<II", len(content), kind) + content for kind, content in ((JSON_CHUNK, text), (BINARY_CHUNK, data))
    )
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def save(tree: dict[str, Any], data: bytes, path: Path) -> None:
    """Write a .glb file, or a .gltf file whose buffer is a .bin file beside it."""
    if path.suffix == ".glb":
        path.write_bytes(glb_of(tree, data))
        return
    binary = path.with_suffix(".bin")
    buffers = [{**tree["buffers"][0], "uri": binary.name}]
    path.write_text(json.dumps({**tree, "buffers": buffers}, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    binary.write_bytes(data)

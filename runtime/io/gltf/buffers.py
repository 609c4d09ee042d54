"""The bytes of a glTF 2.0 file: JSON tree, buffers, accessors.  Nothing outside the file's folder is reached.

Words of the specification (Khronos, glTF 2.0.1): buffer, bufferView, accessor, chunk.  Numbers are little-endian.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, unquote_to_bytes

import numpy as np

from ...brief import Brief
from ...errors import MeshError
from ..limits import limits
from ..pictures.pictures import inside
from ..rawmesh import to_float64
from .compression import DRACO, MESHOPT, decode_view, meshopt_of

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942
COMPONENTS = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
READ_EXTENSIONS = (DRACO, *MESHOPT, "KHR_mesh_quantization", "EXT_mesh_gpu_instancing", "KHR_lights_", "EXT_lights_")
READ_EXTENSIONS += ("KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_animation_", "KHR_xmp")
"""Beginnings of extensions that are read, or that say nothing about the shape."""


@dataclass(frozen=True, eq=False, repr=False)
class GltfFile(Brief):
    """The JSON tree, its buffers' bytes, the folder its references may reach; bufferViews decoded so far."""

    tree: dict[str, Any]
    buffers: list[bytes]
    folder: Path
    decoded: dict[int, bytes] = field(default_factory=dict)


def parse_tree(data: bytes) -> tuple[dict[str, Any], bytes | None]:
    """The JSON tree of a .gltf or .glb file and the binary chunk of the latter.

    Raises: MeshError, or a lookup, value or struct error where the file is damaged.
    """
    if data[:4] != b"glTF":
        tree, binary = json.loads(data.decode("utf-8-sig")), None
    else:
        chunks: dict[int, bytes] = {}
        start, end = 12, min(len(data), struct.unpack_from("<I", data, 8)[0])
        while start + 8 <= end:
            length, kind = struct.unpack_from("<II", data, start)
            if start + 8 + length > len(data):
                raise MeshError("the GLB file is cut short, expected the length in its header; copy or export it again")
            chunks.setdefault(kind, data[start + 8 : start + 8 + length])
            start += 8 + length
        tree, binary = json.loads(chunks[JSON_CHUNK].decode("utf-8")), chunks.get(BINARY_CHUNK)
    version = str(tree["asset"]["version"])
    if not version.startswith("2."):
        raise MeshError(f"glTF version {version[:20]}, expected 2.x; convert the file")
    _used, required = (names_in(tree, key) for key in ("extensionsUsed", "extensionsRequired"))
    unknown = [name for name in required if not name.startswith(READ_EXTENSIONS)]
    if unknown:
        raise MeshError(f"the glTF file requires the extension {unknown[0][:60]!r}, which is not read; export without")
    return tree, binary


def names_in(tree: dict[str, Any], key: str) -> list[str]:
    """A list of names of the document, empty where it has none.  Raises: MeshError where it is no such list."""
    found = tree.get(key, [])
    if not isinstance(found, list) or not all(isinstance(name, str) for name in found):
        raise MeshError(f"the glTF file is damaged ({key} is no list of names), expected glTF 2.0; export it again")
    return found


def read_buffers(tree: dict[str, Any], binary: bytes | None, folder: Path) -> list[bytes]:
    """Bytes of each buffer: the binary chunk, a data URI, or a file in the folder.

    Raises: MeshError.
    """
    result = []
    for buffer in tree.get("buffers", []):
        if "uri" not in buffer and (meshopt_of(buffer) or {}).get("fallback"):
            result.append(b"")  # nothing to fall back on: its views are compressed in another buffer
        elif "uri" in buffer:
            result.append(read_resource(buffer["uri"], folder))
        elif binary is not None:
            result.append(binary)
        else:
            raise MeshError("a glTF buffer has neither data nor uri; export the file again")
    return result


def read_resource(uri: str, folder: Path) -> bytes:
    """Bytes of a data URI, or of a file inside the folder.

    Raises: MeshError for a URL, a path that leaves the folder, or a file that is not there.
    """
    if uri.startswith("data:"):
        head, _, body = uri.partition(",")
        try:
            coded = head.lower().endswith(";base64")
            return base64.b64decode(unquote(body), validate=False) if coded else unquote_to_bytes(body)
        except (binascii.Error, ValueError) as error:
            raise MeshError("a data URI of the glTF file is damaged; export it again") from error
    path = None if "://" in uri else inside(folder, unquote(uri))
    if path is None:
        raise MeshError(
            f"the glTF file refers to {uri[:120]!r}, which does not lie beside it; copy it there, or embed it (export "
            "as .glb)"
        )
    return path.read_bytes()


def buffer_view(file: GltfFile, index: int) -> tuple[memoryview, dict[str, Any]]:
    """Bytes and JSON of a bufferView.

    Raises: MeshError where it ends behind its buffer.
    """
    view = file.tree["bufferViews"][index]
    packed = meshopt_of(view)
    if packed is not None:
        if index not in file.decoded:
            start, length = packed.get("byteOffset", 0), packed["byteLength"]
            file.decoded[index] = decode_view(file.buffers[packed["buffer"]][start : start + length], packed)
        return memoryview(file.decoded[index]), view
    start = view.get("byteOffset", 0)
    data = memoryview(file.buffers[view["buffer"]])[start : start + view["byteLength"]]
    if start < 0 or len(data) != view["byteLength"]:
        raise MeshError(f"glTF bufferView {index} ends behind its buffer; the file is damaged: export it again")
    return data, view


def _table(
    data: memoryview, offset: int, stride: int, count: int, dtype: type[np.generic], columns: int
) -> NDArray[Any]:
    """(count, columns) from strided bytes; a view beyond the data raises ValueError or TypeError."""
    layout = np.dtype(
        {"names": ["row"], "formats": [(np.dtype(dtype).newbyteorder("<"), (columns,))], "itemsize": stride}
    )
    whole = count - 1
    last = np.frombuffer(data, dtype=np.dtype(dtype).newbyteorder("<"), count=columns, offset=offset + whole * stride)
    rows = np.frombuffer(data, dtype=layout, count=whole, offset=offset)["row"].reshape(whole, columns)
    return np.concatenate([rows, last[None]])


def read_accessor(file: GltfFile, index: int) -> NDArray[Any]:
    """(count, columns): float64 where the component is float or normalized, else its integer type."""
    return as_stored(file, index, stored_accessor(file, index))


def stored_accessor(file: GltfFile, index: int) -> NDArray[Any]:
    """(count, columns) as stored: of the accessor's component type, whatever it means."""
    accessor = file.tree["accessors"][index]
    dtype, columns, count = COMPONENTS[accessor["componentType"]], COLUMNS[accessor["type"]], accessor["count"]
    most = limits()
    if not 0 < count <= 3 * most.faces:
        raise MeshError(
            f"glTF accessor {index} holds {count} elements, expected 1 to {3 * most.faces}; export the file again"
        )
    width = np.dtype(dtype).itemsize * columns
    most.demand_unpacked(count * width, sum(map(len, file.buffers)), f"glTF accessor {index}")
    if "bufferView" in accessor:
        data, view = buffer_view(file, accessor["bufferView"])
        values = _table(data, accessor.get("byteOffset", 0), view.get("byteStride", width), count, dtype, columns)
    else:
        values = np.zeros((count, columns), dtype=dtype)
    if "sparse" in accessor:
        sparse = accessor["sparse"]
        where, what = sparse["indices"], sparse["values"]
        kind = COMPONENTS[where["componentType"]]
        places, _ = buffer_view(file, where["bufferView"])
        entries, _ = buffer_view(file, what["bufferView"])
        place = _table(places, where.get("byteOffset", 0), np.dtype(kind).itemsize, sparse["count"], kind, 1)[:, 0]
        values[place] = _table(entries, what.get("byteOffset", 0), width, sparse["count"], dtype, columns)
    return values


def as_stored(file: GltfFile, index: int, values: NDArray[Any]) -> NDArray[Any]:
    """Numbers of an accessor as it means them: float64 where they are real or normalized, else as they are."""
    return as_real(values, normalized=bool(file.tree["accessors"][index].get("normalized")))


def as_real(values: NDArray[Any], *, normalized: bool) -> NDArray[Any]:
    """Numbers as float64 where they are real or normalized, else as they are."""
    if normalized and values.dtype.kind in "iu":
        return np.maximum(values / np.iinfo(values.dtype).max, -1.0)
    return to_float64(values) if values.dtype.kind == "f" else values

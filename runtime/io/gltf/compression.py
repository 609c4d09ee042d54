"""Compressed geometry of glTF files: KHR_draco_mesh_compression and EXT_meshopt_compression, by their own libraries.

Both come with flexpara[formats].  Words are those of the extensions: mode, filter, unique id of an attribute.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import MeshError
from ...extras import requires
from ..limits import limits

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
FILTERS = {"OCTAHEDRAL": "decode_filter_oct", "QUATERNION": "decode_filter_quat", "EXPONENTIAL": "decode_filter_exp"}


def meshopt_of(entry: Mapping[str, Any]) -> dict[str, Any] | None:
    """The meshopt extension of a buffer or bufferView, under either name, or None."""
    extensions = entry.get("extensions", {})
    return next((extensions[name] for name in MESHOPT if name in extensions), None)


def decode_view(data: bytes, extension: Mapping[str, Any]) -> bytes:
    """The bytes of a bufferView that meshopt compressed.

    Args:
        data: the compressed bytes.
        extension: its count, byteStride, mode and filter.

    Raises:
        MeshError: damaged, or of a mode or filter that is not known.
        MissingDependencyError: flexpara[formats] is absent.
    """
    with requires("formats"):
        import meshoptimizer

    count, stride, mode = int(extension["count"]), int(extension["byteStride"]), extension["mode"]
    name = extension.get("filter", "NONE")
    most = limits()
    if not (0 < count <= 3 * most.faces and 0 < stride <= 256):
        raise MeshError(f"a compressed glTF buffer has {count} elements of {stride} bytes; export the file again")
    most.demand_unpacked(count * stride, len(data), "a compressed glTF buffer")
    try:
        if mode == "ATTRIBUTES":
            raw = meshoptimizer.decode_vertex_buffer(count, stride, data, dtype=np.dtype((np.void, stride)))
            values = np.frombuffer(raw.tobytes(), dtype=np.uint8)
            if name in FILTERS:
                values = getattr(meshoptimizer, FILTERS[name])(values, count, stride)
            elif name != "NONE":
                raise MeshError(f"a glTF buffer has the meshopt filter {str(name)[:40]!r}, which is not read")
            return values.tobytes()
        decode = {
            "TRIANGLES": meshoptimizer.decode_index_buffer,
            "INDICES": meshoptimizer.decode_index_sequence,
        }.get(mode)
        if decode is None:
            raise MeshError(f"a glTF buffer has the meshopt mode {str(mode)[:40]!r}, which is not read")
        return decode(count, 4, data).astype(np.dtype(f"<u{stride}")).tobytes()
    except (ValueError, RuntimeError, TypeError) as error:
        if isinstance(error, MeshError):
            raise
        raise MeshError("a compressed glTF buffer is damaged; export the file again") from error


def decode_draco(data: bytes, names: Mapping[str, int]) -> tuple[dict[str, NDArray[Any]], NDArray[np.int64]]:
    """The attributes (n, c) and triangles (f, 3) of a primitive that Draco compressed.

    Args:
        data: the compressed bytes.
        names: attribute → its unique id in them.

    Raises:
        MeshError: damaged, or no triangles.
        MissingDependencyError: flexpara[formats] is absent.
    """
    with requires("formats"):
        import DracoPy

    try:
        mesh = DracoPy.decode(data)
        faces = np.asarray(mesh.faces, dtype=np.int64).reshape(-1, 3)
        found = {name: np.asarray(mesh.get_attribute_by_unique_id(place)["data"]) for name, place in names.items()}
    except Exception as error:  # the decoder raises what it likes on damaged bytes
        raise MeshError("the Draco data of a glTF primitive are damaged; export the file again") from error
    return {name: values.reshape(len(values), -1) for name, values in found.items()}, faces

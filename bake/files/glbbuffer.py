"""The one binary buffer of a .glb file while it grows: views aligned to four bytes, accessors over them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...runtime.errors import MissingDependencyError

try:
    import pygltflib as gl
except ImportError as error:
    raise MissingDependencyError(
        f"pygltflib cannot be imported ({error}), GLB files are written with it: pip install 'flexpara[bake]'"
    ) from error

if TYPE_CHECKING:
    from numpy.typing import NDArray

COMPONENT_TYPES = {
    "float32": gl.FLOAT,
    "uint8": gl.UNSIGNED_BYTE,
    "uint16": gl.UNSIGNED_SHORT,
    "uint32": gl.UNSIGNED_INT,
}
ACCESSOR_TYPES = {1: gl.SCALAR, 2: gl.VEC2, 3: gl.VEC3, 4: gl.VEC4}


class Buffer:
    """Bytes, views and accessors of a glTF document."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[gl.BufferView] = []
        self.accessors: list[gl.Accessor] = []

    def view(self, data: bytes, target: int | None = None) -> int:
        """Append bytes; the number of their view."""
        self.views.append(gl.BufferView(buffer=0, byteOffset=len(self.data), byteLength=len(data), target=target))
        self.data += data + bytes(-len(data) % 4)
        return len(self.views) - 1

    def accessor(self, array: NDArray[np.generic], target: int, *, bounds: bool = False) -> int:
        """Append an array (count,) or (count, c); the number of its accessor.  Integers of c > 1 are normalized."""
        columns = array.shape[1] if array.ndim == 2 else 1
        self.accessors.append(
            gl.Accessor(
                bufferView=self.view(np.ascontiguousarray(array).tobytes(), target),
                componentType=COMPONENT_TYPES[array.dtype.name],
                count=len(array),
                type=ACCESSOR_TYPES[columns],
                normalized=True if array.dtype.kind == "u" and columns > 1 else None,
                min=array.min(axis=0).tolist() if bounds else None,
                max=array.max(axis=0).tolist() if bounds else None,
            )
        )
        return len(self.accessors) - 1

"""The uv sets that a mesh carries beside the one its materials are read with.   n file vertices."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...errors import InputError
from .buffers import as_real
from .columns import primitive_columns
from .materials import uv_set

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ...mesh import Asset


def with_set(asset: Asset, number: int | None, note: Callable[[str], None]) -> Asset:
    """The mesh with one of its uv sets; None: the one that its textures are read with, which is said if not the first.

    Raises: as `uv_of_set`.
    """
    if number is not None:
        return replace(asset, uv=uv_of_set(asset, number))
    materials = [] if asset.document is None else asset.document.file.tree.get("materials", [])
    if read := sorted({uv_set(material) for material in materials} - {0}):
        named = " and ".join(map(str, read))
        note(f"{asset.stem}: textures are read with uv set {named}, which is taken; --uv-set 0 takes the first")
    return asset


def uv_of_set(asset: Asset, number: int) -> NDArray[np.float64]:
    """(n, 2) float64 v up of one uv set of a mesh.

    Raises: InputError where some part of the mesh has no such set.
    """
    document, part_of, origin = asset.document, asset.part, asset.origin
    if document is None or part_of is None or origin is None:
        if number == 0 and asset.uv is not None:
            return asset.uv
        found = "no uv" if asset.uv is None else "the uv set 0 alone"
        raise InputError(f"{asset.stem} has {found}, expected set {number}; leave --uv-set out, or unwrap it first")
    uv = np.zeros((len(asset.positions), 2))
    for index in np.unique(part_of):
        part = document.parts[int(index)]
        mesh = document.file.tree["meshes"][part.mesh]
        columns, _ = primitive_columns(document.file, mesh["primitives"][part.primitive])
        column = columns.get(f"TEXCOORD_{number}")
        if column is None:
            name = mesh.get("name", f"mesh {part.mesh}")
            raise InputError(
                f"{name} of {asset.stem} has no uv set {number}; expected TEXCOORD_{number}: unwrap it first"
            )
        vertex = np.unique(asset.faces[part_of == index])
        uv[vertex] = as_real(column.rows, normalized=column.normalized)[origin[vertex]] * (1.0, -1.0) + (0.0, 1.0)
    return uv

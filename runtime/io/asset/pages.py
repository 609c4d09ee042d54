"""An asset in pages: each of its meshes or materials for itself, to get an atlas and textures of its own.

f faces.  A page is an asset whose faces are some of the whole's, in their order; it belongs to the same document.
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from ...errors import InputError
from ...mesh import Surface

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ...mesh import Asset

Sharing = Literal["scene", "mesh", "material"]
"""What shares an atlas: everything, a mesh of the scene, a material."""


def pages_of(asset: Asset, sharing: Sharing) -> list[Asset]:
    """The pages of an asset with a document, in the order of their first faces; their stems tell them apart.

    Raises: InputError for an asset without a document.
    """
    if asset.document is None or asset.part is None:
        raise InputError("pages of a mesh without a document, expected a scene; pass with_document(asset)")
    if sharing == "scene":
        return [asset]
    meshes = np.array([part.mesh for part in asset.document.parts], dtype=np.int64)
    no_material = np.zeros(len(asset.faces), dtype=np.int64)
    of_material = no_material if asset.face_material is None else asset.face_material
    label = meshes[asset.part] if sharing == "mesh" else of_material
    known, first = np.unique(label, return_index=True)
    numbers = known[np.argsort(first)].tolist()
    tree = asset.document.file.tree
    if sharing == "mesh":
        names = [tree["meshes"][number].get("name", f"mesh{number}") for number in numbers]
    else:
        names = [asset.materials[number].name if asset.materials else "material" for number in numbers]
    stems = [f"{asset.stem}_{name}" for name in file_names(names)]
    return [part_of(asset, label == number, stem) for number, stem in zip(numbers, stems, strict=True)]


def file_names(names: Sequence[str]) -> list[str]:
    """The names as parts of file names, which differ even where letters of either case are the same.

    >>> file_names(["Red paint", "red/paint", "..", "red_paint"])
    ['Red_paint', 'red_paint_2', 'part', 'red_paint_3']
    """
    found: list[str] = []
    for name in names:
        plain = re.sub(r"[^\w.-]+", "_", str(name)).strip("._-")[:64] or "part"
        taken, number, tried = {entry.lower() for entry in found}, 1, plain
        while tried.lower() in taken:
            number += 1
            tried = f"{plain}_{number}"
        found.append(tried)
    return found


def part_of(asset: Asset, chosen: NDArray[np.bool_], stem: str) -> Asset:
    """The faces chosen (f,) as an asset of that stem, which knows the surface of the whole."""
    used, faces = np.unique(asset.faces[chosen], return_inverse=True)
    seen, surface = np.unique(asset.surface.faces[chosen], return_inverse=True)
    polygons, colors = asset.polygons, None if asset.colors is None else asset.colors[used]
    if colors is not None and (colors == 255).all():  # those of parts that have none
        colors = None
    return replace(
        asset,
        positions=asset.positions[used],
        faces=faces.reshape(-1, 3).astype(np.int64),
        weld=np.searchsorted(seen, asset.weld[used]),
        surface=Surface(asset.surface.vertices[seen], surface.reshape(-1, 3).astype(np.int64)),
        whole=asset.surface if asset.whole is None else asset.whole,
        stem=stem,
        normals=None if asset.normals is None else asset.normals[used],
        colors=colors,
        uv=None if asset.uv is None else asset.uv[used],
        face_material=None if asset.face_material is None else asset.face_material[chosen],
        part=None if asset.part is None else asset.part[chosen],
        origin=None if asset.origin is None else asset.origin[used],
        polygons=None if polygons is None else replace(polygons, corner=polygons.corner[chosen]),
        smoothing=None if asset.smoothing is None else asset.smoothing[chosen],
        unsplit=used if asset.unsplit is None else asset.unsplit[used],
    )

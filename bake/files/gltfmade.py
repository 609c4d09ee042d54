"""A mesh of another format as a glTF document: one node, a primitive for each material, pictures inside.

n file vertices.  All primitives have all vertices; those that none of its faces uses are left out when it is written.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...runtime.geometry.topology import edge_table
from ...runtime.io.gltf.buffers import GltfFile
from ...runtime.io.gltf.document import Document, Part
from ...runtime.io.gltf.editing import Editing
from ...runtime.io.gltf.nodes import Placement
from ...runtime.io.pictures.pictures import png_of
from ...runtime.pack.exact.seamvertices import atlas_normals
from .gltf import centre_of, flip_v, linear_shorts
from .gltfmaterial import STRENGTH

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ...runtime.material import Material, Picture, Slot
    from ...runtime.mesh import Asset

WRAPS = {"repeat": 10497, "mirror": 33648, "clamp": 33071}
FILTERS = {True: 9729, False: 9728}
INFOS: Mapping[Slot, str] = {"normal": "normalTexture", "emissive": "emissiveTexture", "occlusion": "occlusionTexture"}
SURFACE: Mapping[Slot, str] = {"base-color": "baseColorTexture", "metallic-roughness": "metallicRoughnessTexture"}


def with_document(asset: Asset) -> Asset:
    """The asset with a document: its own, or one made of it."""
    if asset.document is not None:
        return asset
    editing = Editing(GltfFile({"asset": {"version": "2.0"}}, [], Path()))
    centre = centre_of(asset.positions)
    columns = _columns(asset, centre)
    shared = {
        name: editing.add_accessor(rows, normalized=rows.dtype.kind == "u", bounds=name == "POSITION")
        for name, rows in columns.items()
    }
    part = np.zeros(len(asset.faces), np.int64) if asset.face_material is None else asset.face_material
    used, number = np.unique(part, return_inverse=True)
    opened = bool((edge_table(asset.surface.faces).edge_count == 1).any())
    primitives: list[dict[str, Any]] = [{"attributes": dict(shared)} for _ in used]
    for primitive, index in zip(primitives, used.tolist(), strict=True):
        if asset.materials:
            material = _material(editing, asset.materials[index], opened=opened)
            primitive["material"] = editing.add("materials", material)
    node = {"name": asset.stem, "mesh": 0, **({"translation": centre.tolist()} if centre.any() else {})}
    editing.tree |= {"scene": 0, "scenes": [{"nodes": [0]}], "nodes": [node]}
    editing.tree["meshes"] = [{"name": asset.stem, "primitives": primitives}]
    tree, data = editing.finished()
    world = np.eye(4)
    world[:3, 3] = centre
    parts = tuple(Part(0, index, world) for index in range(len(used)))
    document = Document(GltfFile(tree, [data], Path()), parts, (Placement(0, 0, world),))
    return replace(asset, document=document, part=number.reshape(-1), origin=np.arange(len(asset.positions)))


def _columns(asset: Asset, centre: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
    """Attribute → rows of all file vertices."""
    normals = atlas_normals(asset, np.arange(len(asset.positions))).copy()
    normals[~normals.any(axis=1)] = (0.0, 0.0, 1.0)
    columns: dict[str, NDArray[Any]] = {"POSITION": (asset.positions - centre).astype(np.float32), "NORMAL": normals}
    if asset.uv is not None:
        columns["TEXCOORD_0"] = flip_v(asset.uv)
    if asset.colors is not None:
        columns["COLOR_0"] = linear_shorts(asset.colors)
    return columns


def _material(editing: Editing, source: Material, *, opened: bool) -> dict[str, Any]:
    """The material as glTF says it.  opened: the surface has borders, so that its back can be seen."""
    info = {slot: _texture(editing, f"{source.name} {slot}", picture) for slot, picture in source.pictures.items()}
    surface: dict[str, Any] = {
        "baseColorFactor": list(source.base_color_factor),
        "metallicFactor": source.metallic,
        "roughnessFactor": source.roughness,
    }
    surface |= {name: info[slot] for slot, name in SURFACE.items() if slot in info}
    entry: dict[str, Any] = {"name": source.name, "pbrMetallicRoughness": surface}
    entry |= {name: info[slot] for slot, name in INFOS.items() if slot in info}
    strength = max(1.0, *source.emissive)
    if any(source.emissive):
        entry["emissiveFactor"] = [value / strength for value in source.emissive]
    if strength > 1.0:
        entry["extensions"] = {STRENGTH: {"emissiveStrength": strength}}
    if source.alpha_mode != "OPAQUE":
        entry["alphaMode"] = source.alpha_mode
    if source.alpha_mode == "MASK":
        entry["alphaCutoff"] = source.alpha_cutoff
    if source.double_sided or opened:
        entry["doubleSided"] = True
    return entry


def _texture(editing: Editing, name: str, picture: Picture) -> dict[str, int]:
    """The textureInfo of a picture, which is embedded as PNG."""
    sampler = {"wrapS": WRAPS[picture.wrap[0]], "wrapT": WRAPS[picture.wrap[1]], "magFilter": FILTERS[picture.smooth]}
    return {"index": editing.add_picture(name, png_of(picture.pixels), editing.add("samplers", sampler))}

"""glTF 2.0 (.glb, .gltf) → RawMesh: the triangles of its meshes, node transforms applied, in scene order.

Words of the specification (Khronos, glTF 2.0.1): accessor, primitive, node.  uv is turned v up; linear COLOR_0 becomes
sRGB.  Read here and not with trimesh, which drops uv without a material, ignores `normalized` and trusts any count.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import MeshError
from ..limits import limits
from ..pictures.colors import linear_to_srgb
from ..polygons import strip_triangles
from ..rawmesh import RawMesh, demand_few, merge, transformed
from .buffers import GltfFile, as_stored, buffer_view, parse_tree, read_accessor, read_buffers
from .columns import primitive_columns
from .compression import DRACO, decode_draco
from .damage import damage_is_named
from .document import Document, Part
from .materials import read_materials, uv_set
from .nodes import best_placements, placed_meshes, select_placements
from .references import references

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from ...material import Material

TRIANGLES, STRIP, FAN = 4, 5, 6
VERTEX_BYTES = 100
"""That a vertex takes in memory, about."""


def read_gltf(data: bytes, folder: Path, *, instances: bool = False, select: Sequence[str] = ()) -> RawMesh:
    """Read a .glb or .gltf file: each mesh once, where it stands best for unwrapping, with the document beside it.

    Args:
        data: the bytes of the file.
        folder: where it lies; references outside of it, and URLs, are refused.
        instances: each mesh wherever it stands in the default scene instead, as triangles without a document.
        select: names of meshes and nodes, beyond which nothing is read; () is everything.

    Raises:
        MeshError: damaged, of an extension that must be known and is not, without triangles, or with such a reference.
        MissingDependencyError: compressed, and flexpara[formats] is absent.
    """
    with damage_is_named():
        tree, binary = parse_tree(data)
        file = GltfFile(tree, read_buffers(tree, binary, folder), folder)
        return _scene(file, select, instances=instances)


def _scene(file: GltfFile, select: Sequence[str], *, instances: bool) -> RawMesh:
    materials, changes = read_materials(file)
    most = limits()
    placements = select_placements(file.tree, placed_meshes(file), select)
    chosen = [entry for entry in placements if entry.first] if instances else best_placements(placements)
    found, parts, skipped, faces, vertices = [], [], 0, 0, 0
    for placement in chosen:
        for number, primitive in enumerate(file.tree["meshes"][placement.mesh]["primitives"]):
            if primitive.get("mode", TRIANGLES) not in (TRIANGLES, STRIP, FAN):
                skipped += 1
                continue
            raw = _primitive(file, primitive, materials)
            raw = raw if instances else _numbered(raw, len(parts), placement.mesh)
            found.append(transformed(raw, placement.world))
            parts.append(Part(placement.mesh, number, placement.world))
            faces, vertices = faces + len(raw.faces), vertices + len(raw.positions)
            demand_few(faces, vertices)
            most.demand_unpacked(VERTEX_BYTES * vertices, sum(map(len, file.buffers)), "the scene's vertices")
    if not found:
        what = "points or lines only (give points as .ply, .xyz or .npy)" if skipped else "no mesh"
        raise MeshError(f"the glTF scene holds {what}, expected triangles; check the export")
    whole = merge(found)  # what it counts is nothing that the document loses
    if instances:
        return replace(whole, changes={**whole.changes, **changes, "skipped_primitives": skipped})
    _check_kept(file, parts)
    return replace(whole, document=Document(file, tuple(parts), tuple(placements)), changes=changes)


def _check_kept(file: GltfFile, parts: Sequence[Part]) -> None:
    """Refuse now what writing the document again would stumble over: data that nothing has read so far."""
    for array, holder, key in references(file.tree):
        if not 0 <= holder[key] < len(file.tree[array]):
            raise MeshError(f"a glTF {key} is {str(holder[key])[:20]}, expected a number below those of {array}")
    for part in parts:
        primitive_columns(file, file.tree["meshes"][part.mesh]["primitives"][part.primitive])


def _numbered(raw: RawMesh, part: int, mesh: int) -> RawMesh:
    """The triangles as those of a part; vertices of different meshes stay apart."""
    count = len(raw.positions)
    return replace(
        raw, part=np.full(len(raw.faces), part), origin=np.arange(count), body=np.full(count, mesh, dtype=np.int64)
    )


def _primitive(file: GltfFile, primitive: dict[str, Any], materials: Sequence[Material]) -> RawMesh:
    values, faces = _attributes(file, primitive)
    positions, normals = values["POSITION"].astype(np.float64), values.get("NORMAL")
    index = primitive.get("material")
    uv = values.get(f"TEXCOORD_{0 if index is None else uv_set(file.tree['materials'][index])}")
    colors = _srgb(values["COLOR_0"]) if "COLOR_0" in values else None
    if any(given is not None and len(given) != len(positions) for given in (normals, uv, colors)):
        raise MeshError("a glTF primitive has attributes of different lengths; export the file again")
    return RawMesh(
        positions=positions,
        faces=faces,
        normals=None if normals is None else normals.astype(np.float64),
        colors=colors,
        uv=None if uv is None else uv.astype(np.float64) * (1.0, -1.0) + (0.0, 1.0),
        materials=() if index is None else (materials[index],),
        face_material=None if index is None else np.zeros(len(faces), dtype=np.int64),
    )


def _attributes(file: GltfFile, primitive: dict[str, Any]) -> tuple[dict[str, NDArray[Any]], NDArray[np.int64]]:
    """The attributes that are read, by name, and the triangles (f, 3) int64."""
    accessors = primitive["attributes"]
    wanted = [name for name in accessors if name in ("POSITION", "NORMAL", "COLOR_0") or name.startswith("TEXCOORD_")]
    packed = primitive.get("extensions", {}).get(DRACO)
    if packed is not None:
        names = {name: place for name, place in packed["attributes"].items() if name in wanted}
        decoded, faces = decode_draco(bytes(buffer_view(file, packed["bufferView"])[0]), names)
        return {name: as_stored(file, accessors[name], found) for name, found in decoded.items()}, faces
    values = {name: read_accessor(file, accessors[name]) for name in wanted}
    count = len(values["POSITION"])
    indices = read_accessor(file, primitive["indices"])[:, 0] if "indices" in primitive else np.arange(count)
    return values, _triangles(indices.astype(np.int64), primitive.get("mode", TRIANGLES))


def _triangles(indices: NDArray[np.int64], mode: int) -> NDArray[np.int64]:
    """(f, 3) int64: triples, a strip (every second one turned, so that all wind alike) or a fan."""
    if mode == TRIANGLES:
        return indices[: len(indices) // 3 * 3].reshape(-1, 3)
    if mode == STRIP:
        return strip_triangles(indices)
    i = np.arange(max(len(indices) - 2, 0))
    return indices[np.stack([i + 1, i + 2, np.zeros_like(i)], axis=1)]


def _srgb(linear: NDArray[Any]) -> NDArray[np.uint8]:
    """COLOR_0 (n, 3 or 4), linear, float or normalized → (n, 4) uint8 sRGB with linear alpha."""
    scale = 1.0 if linear.dtype.kind == "f" else float(np.iinfo(linear.dtype).max)
    rgba = np.ones((len(linear), 4))
    rgba[:, : linear.shape[1]] = np.clip(np.nan_to_num(linear / scale), 0.0, 1.0)
    rgba[:, :3] = linear_to_srgb(rgba[:, :3])
    return np.rint(rgba * 255.0).astype(np.uint8)

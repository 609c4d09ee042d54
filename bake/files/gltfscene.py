"""A glTF document with new uv: its meshes' vertices follow the atlas, baked textures come in, all else stays as it was.

n atlas vertices · f faces.  Attributes, morph targets and indices of the primitives that were unwrapped are written
anew with the very numbers of the file; nodes, skins, animations, cameras, lights, extras are not touched.  The new uv
are TEXCOORD_0, and the old sets follow one number further up.
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ... import __version__
from ...runtime.errors import ShapeError
from ...runtime.io.gltf.columns import Column, primitive_columns
from ...runtime.io.gltf.editing import INDICES, Editing, save
from ..maps.material import emissive_strength
from ..maps.tangents import unit, vertex_tangents
from .gltfrebaked import SHADOWS, Baked, Materials
from .images import encode_png
from .targets import with_green

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from ...runtime.io.gltf.document import Document, Part
    from ...runtime.mesh import Asset, Atlas
    from ..texture import Texture

LINEAR, TRILINEAR, CLAMPED = 9729, 9987, 33071
SHOWN = ("base-color", "vertex-color", "uv-checker", "chart", "normal", "orm", "metallic-roughness", "ao", "occlusion")
SHOWN += ("emissive",)
"""Maps that a glTF material can show."""
DRACO = "KHR_draco_mesh_compression"


@dataclass(frozen=True, eq=False)
class Page:
    """An atlas with its textures, and the asset that it is of.

    uv_set: the set that its uv become while all others stay, and materials too but for their occlusion; None lets them
    be the first, and the textures those of the materials.
    """

    atlas: Atlas
    asset: Asset
    textures: Mapping[str, Texture]
    uv_set: int | None = None


@dataclass(frozen=True, eq=False)
class Slice:
    """What an atlas has of one part.

    vertex, source: (m,) atlas vertices, and which of the primitive's they are.  faces: (g, 3) of them, as the file
    winds them.  unread: slots of its material whose picture could not be read.
    """

    part: Part
    vertex: NDArray[np.int64]
    source: NDArray[np.int64]
    faces: NDArray[np.int64]
    unread: frozenset[str]


def scene_tree(pages: list[Page]) -> tuple[dict[str, Any], bytes]:
    """The document of the assets, which is one, with the new uv: JSON tree and buffer.

    Raises: ShapeError for an asset that is not of a document; EncodingError for textures PNG cannot hold.
    """
    document = pages[0].asset.document
    if document is None:
        raise ShapeError("the asset has no document, expected one read of a glTF file; write it with write_glb")
    editing = Editing(document.file)
    slices = [(page, piece) for page in pages for piece in slices_of(page, document)]
    materials = Materials(editing, _kept(editing.tree, [piece.part for _, piece in slices]))
    baked = {id(page): _embedded(editing, page, page.asset.stem if len(pages) > 1 else "") for page in pages}
    begun = set[tuple[int, int]]()
    for page, piece in slices:
        _rewrite(_primitive(editing, piece.part, begun), editing, materials, Laid(page, piece, baked[id(page)]))
    editing.tree["asset"]["generator"] = f"flexpara {__version__}"
    return editing.finished()


def write_scene(pages: list[Page], path: Path) -> None:
    """Write a .glb file, or a .gltf file and its .bin beside it.  Raises as `scene_tree`."""
    save(*scene_tree(pages), path)


def slices_of(page: Page, document: Document) -> Iterator[Slice]:
    """What the atlas has of each part of the document."""
    atlas, asset = page.atlas, page.asset
    if asset.part is None or asset.origin is None:
        raise ShapeError("the asset does not know the parts of its document, expected them; pass it as it was read")
    for number in np.unique(asset.part):
        part, own = document.parts[int(number)], asset.part == number
        vertex, faces = np.unique(atlas.faces[own], return_inverse=True)
        faces = faces.reshape(-1, 3).astype(np.int64)
        faces = faces[:, [0, 2, 1]] if part.mirrored else faces
        yield Slice(part, vertex, asset.origin[atlas.source_vertex[vertex]], faces, _unread(asset, int(np.argmax(own))))


def _unread(asset: Asset, face: int) -> frozenset[str]:
    """Slots of a face's material whose picture could not be read."""
    material = None if asset.face_material is None else int(asset.face_material[face])
    return frozenset() if material is None else frozenset(asset.materials[material].unread)


def _kept(tree: dict[str, Any], parts: list[Part]) -> frozenset[int]:
    """Materials that primitives use which no atlas has."""
    done = {(part.mesh, part.primitive) for part in parts}
    return frozenset(
        primitive["material"]
        for mesh, entry in enumerate(tree.get("meshes", []))
        for number, primitive in enumerate(entry["primitives"])
        if (mesh, number) not in done and "material" in primitive
    )


def _embedded(editing: Editing, page: Page, atlas: str) -> Baked:
    """The textures of an atlas, embedded as 8-bit PNG with one sampler: trilinear, clamped to the edge.

    atlas: name of the atlas among several, "" for a single one.
    """
    shown = {name: page.textures[name] for name in SHOWN if name in page.textures}
    if page.uv_set is not None:
        shown = {name: shown[name] for name in SHADOWS if name in shown}
    numbers: dict[str, int] = {}
    if shown:
        sampler = {"magFilter": LINEAR, "minFilter": TRILINEAR, "wrapS": CLAMPED, "wrapT": CLAMPED}
        number = editing.add("samplers", sampler)
        for name, texture in shown.items():
            green = with_green(texture, "opengl") if name == "normal" else texture
            numbers[name] = editing.add_picture(f"{atlas}_{name}".lstrip("_"), encode_png(green, bits=8), number)
    if page.uv_set is not None:
        return Baked(atlas, numbers, coordinates=page.uv_set, moved=0)
    return Baked(atlas, numbers, strength=emissive_strength(page.asset) if "emissive" in numbers else 1.0)


class Laid(NamedTuple):
    """What one primitive becomes: a page's slice of it, with the page's textures."""

    page: Page
    piece: Slice
    baked: Baked


def _primitive(editing: Editing, part: Part, begun: set[tuple[int, int]]) -> dict[str, Any]:
    """The primitive that a slice is written to: the part's own, and for those of further pages a new one beside it.

    begun: parts of which a slice was written; this one comes in.
    """
    primitives, place = editing.tree["meshes"][part.mesh]["primitives"], (part.mesh, part.primitive)
    if place in begun:
        primitives.append(deepcopy(editing.file.tree["meshes"][part.mesh]["primitives"][part.primitive]))
        return primitives[-1]
    begun.add(place)
    return primitives[part.primitive]


def _rewrite(primitive: dict[str, Any], editing: Editing, materials: Materials, laid: Laid) -> None:
    """One primitive: its vertices, indices, uv and material."""
    page, piece, baked = laid
    file = editing.file
    original = file.tree["meshes"][piece.part.mesh]["primitives"][piece.part.primitive]
    columns, targets = primitive_columns(file, original)
    rows = {name: Column(column.rows[piece.source], column.normalized) for name, column in columns.items()}
    tinted = "base-color" in baked.textures or "vertex-color" in baked.textures
    rows = {_moved(name, baked, tinted=tinted): column for name, column in rows.items()}
    rows |= _new_columns(page, piece, baked, rows)
    primitive["attributes"] = {name: _added(editing, name, column) for name, column in rows.items()}
    if targets:
        primitive["targets"] = [
            {
                name: _added(editing, name, Column(column.rows[piece.source], column.normalized))
                for name, column in target.items()
            }
            for target in targets
        ]
    small = len(piece.vertex) <= 65535
    indices = piece.faces.reshape(-1, 1).astype(np.uint16 if small else np.uint32)
    primitive["indices"] = editing.add_accessor(indices, INDICES)
    primitive |= {"mode": 4} if "mode" in primitive else {}
    _drop(primitive, DRACO)
    _set_materials(primitive, materials, piece.unread, baked)


def _moved(name: str, baked: Baked, *, tinted: bool) -> str:
    """Name of an old attribute: uv sets move up; colours that are in the texture must not tint it again."""
    if name.startswith("TEXCOORD_"):
        return f"TEXCOORD_{int(name.removeprefix('TEXCOORD_')) + baked.moved}"
    return "_COLOR_0" if name == "COLOR_0" and tinted else name


def _new_columns(page: Page, piece: Slice, baked: Baked, rows: Mapping[str, Column]) -> dict[str, Column]:
    """uv, and the normals and tangents that the file lacks or that new uv change."""
    atlas = page.atlas
    uv = atlas.uv[piece.vertex].astype(np.float64)
    flipped = np.column_stack([uv[:, 0], 1.0 - uv[:, 1]]).astype(np.float32)
    sets = (f"TEXCOORD_{number}" for number in range(baked.coordinates + 1))  # a set needs all those before it
    found = {name: flipped for name in sets if name not in rows or name == f"TEXCOORD_{baked.coordinates}"}
    linear = piece.part.world[:3, :3]
    normals = unit(atlas.normals[piece.vertex].astype(np.float64) @ linear)  # the inverse of a normal's own matrix
    normals[~normals.any(axis=1)] = (0.0, 0.0, 1.0)
    if "normal" in baked.textures:
        tangents = vertex_tangents(atlas)[piece.vertex].astype(np.float64)
        turned = unit(tangents[:, :3] @ np.linalg.inv(linear).T)
        sign = -tangents[:, 3:] if piece.part.mirrored else tangents[:, 3:]
        found["TANGENT"] = np.hstack([turned, sign]).astype(np.float32)
    if "NORMAL" in rows:
        stored = rows["NORMAL"].rows
        broken = np.logical_not(np.isfinite(stored).all(axis=1) & stored.any(axis=1))
        if broken.any() and stored.dtype.kind == "f":
            found["NORMAL"] = np.where(broken[:, None], normals, stored).astype(np.float32)
    elif "normal" in baked.textures:
        found["NORMAL"] = normals.astype(np.float32)
    return {name: Column(values, normalized=False) for name, values in found.items()}


def _added(editing: Editing, name: str, column: Column) -> int:
    return editing.add_accessor(column.rows, normalized=column.normalized, bounds=name == "POSITION")


def _drop(primitive: dict[str, Any], extension: str) -> None:
    extensions = {name: value for name, value in primitive.pop("extensions", {}).items() if name != extension}
    if extensions:
        primitive["extensions"] = extensions


def _set_materials(primitive: dict[str, Any], materials: Materials, unread: frozenset[str], baked: Baked) -> None:
    """The primitive's own material with the baked textures; those of its variants with their own, on the old uv."""
    index, moved = primitive.get("material"), Baked("moved", {}, moved=baked.moved)
    number = materials.number(index, baked, unread)
    if number is not None:
        primitive["material"] = number
    for mapping in primitive.get("extensions", {}).get("KHR_materials_variants", {}).get("mappings", []):
        same = mapping["material"] == index
        mapping["material"] = materials.number(mapping["material"], baked if same else moved, unread)

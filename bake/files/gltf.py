"""GLB files: the atlas as one glTF 2.0 primitive with its baked textures inside.

n atlas vertices · f faces.  glTF's uv has v down (written as 1 − v), images have row 0 on top, so pictures need no
flip.
Positions are float32 about a node translation where float32 alone would lose digits.  Faces keep their order.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import __version__
from ...runtime.errors import ShapeError
from ...runtime.io.gltf.buffers import parse_tree
from ...runtime.io.gltf.editing import save
from ..colors.color import linear_from_srgb
from ..maps.tangents import unit, vertex_tangents
from .glbbuffer import Buffer, gl
from .gltfmaterial import add_material

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from ...runtime.mesh import Asset, Atlas
    from ..texture import Texture

FLOAT32_LOSS = 1e-6
"""Rounding, as a part of the bounding box's diagonal, from which on positions are written about their centre."""


def write_glb(
    atlas: Atlas,
    asset: Asset,
    textures: Mapping[str, Texture],
    path: Path,
    *,
    metadata: Mapping[str, Any] | None = None,
) -> None:
    """Write the atlas and its textures as a .glb file, or as .gltf and .bin.  Arguments and errors as `glb_bytes`."""
    data = glb_bytes(atlas, asset, textures, metadata=metadata)
    if path.suffix == ".glb":
        path.write_bytes(data)
    else:
        tree, binary = parse_tree(data)
        save(tree, binary or b"", path)


def glb_bytes(
    atlas: Atlas, asset: Asset, textures: Mapping[str, Texture], *, metadata: Mapping[str, Any] | None = None
) -> bytes:
    """The bytes of a .glb file; same arguments, same bytes.

    What the maps become is said in gltfmaterial.py; the map `normal` brings TANGENT along.  A bare mesh gets a material
    too, since trimesh reads no uv without one.  TEXCOORD_1 is the source's own uv.  Vertex colours are COLOR_0 without
    a base colour texture and _COLOR_0 beside one, since COLOR_0 would be multiplied into the texture.

    Args:
        atlas: what is written.
        asset: source of vertex colours, old uv, the material's name and factor.
        textures: map name → Texture; others than those named above are left out.
        path: where the file goes.
        metadata: JSON values for `asset.extras.flexpara`.

    Raises: ShapeError when the atlas' arrays do not fit each other; EncodingError for textures PNG cannot hold.
    """
    _check(atlas, asset)
    buffer = Buffer()
    document = gl.GLTF2(asset=gl.Asset(version="2.0", generator=f"flexpara {__version__}"))
    if metadata:
        document.asset.extras = {"flexpara": json.loads(json.dumps(metadata))}
    material = add_material(document, buffer, asset, textures)
    _add_mesh(document, buffer, atlas, asset, material)
    document.accessors, document.bufferViews = buffer.accessors, buffer.views
    document.buffers = [gl.Buffer(byteLength=len(buffer.data))]
    document.set_binary_blob(bytes(buffer.data))
    return b"".join(document.save_to_bytes())


def _check(atlas: Atlas, asset: Asset) -> None:
    """Raise ShapeError unless the arrays belong together."""
    count = len(atlas.positions)
    lengths = {"uv": len(atlas.uv), "normals": len(atlas.normals), "source_vertex": len(atlas.source_vertex)}
    for name, length in lengths.items():
        if length != count:
            raise ShapeError(f"atlas has {length} {name} for {count} positions; expected one each; make the atlas anew")
    faces = atlas.faces
    if len(faces) == 0 or int(faces.max()) >= count or int(faces.min()) < 0:
        raise ShapeError(f"atlas of {len(faces)} faces, {count} vertices: expected a face or more, indices in range")
    if int(atlas.source_vertex.max()) >= len(asset.positions):
        raise ShapeError("atlas.source_vertex points beyond the asset's vertices; pass the asset it was made from")


def _add_mesh(document: gl.GLTF2, buffer: Buffer, atlas: Atlas, asset: Asset, material: gl.Material) -> None:
    """One primitive in one node in one scene."""
    centre = centre_of(atlas.positions)
    surface = material.pbrMetallicRoughness
    textured = surface is not None and surface.baseColorTexture is not None
    arrays = _vertex_arrays(atlas, asset, centre, textured=textured, tangents=material.normalTexture is not None)
    numbers = {
        name: buffer.accessor(array, gl.ARRAY_BUFFER, bounds=name == "POSITION") for name, array in arrays.items()
    }
    indices = buffer.accessor(_indices(atlas), gl.ELEMENT_ARRAY_BUFFER)
    primitive = gl.Primitive(attributes=gl.Attributes(**numbers), indices=indices, material=0)
    document.meshes = [gl.Mesh(name=asset.stem, primitives=[primitive])]
    translation = centre.tolist() if centre.any() else None
    document.nodes = [gl.Node(name=asset.stem, mesh=0, translation=translation)]
    document.scenes, document.scene = [gl.Scene(nodes=[0])], 0


def centre_of(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3,) what to subtract before rounding to float32: zero where rounding alone is harmless."""
    low, high = positions.min(axis=0), positions.max(axis=0)
    loss = np.abs(positions - positions.astype(np.float32)).max()
    return (low + high) / 2.0 if loss > FLOAT32_LOSS * np.linalg.norm(high - low) else np.zeros(3)


def _vertex_arrays(
    atlas: Atlas, asset: Asset, centre: NDArray[np.float64], *, textured: bool, tangents: bool
) -> dict[str, NDArray[np.generic]]:
    """Attribute name → array, one row a vertex."""
    arrays: dict[str, NDArray[np.generic]] = {
        "POSITION": (atlas.positions - centre).astype(np.float32),
        "NORMAL": _unit_normals(atlas.normals),
        "TEXCOORD_0": flip_v(atlas.uv.astype(np.float64)),
    }
    if asset.uv is not None:
        arrays["TEXCOORD_1"] = flip_v(asset.uv[atlas.source_vertex])
    if tangents:
        arrays["TANGENT"] = vertex_tangents(atlas)
    if asset.colors is not None:
        arrays["_COLOR_0" if textured else "COLOR_0"] = linear_shorts(asset.colors[atlas.source_vertex])
    return arrays


def _unit_normals(normals: NDArray[np.float32]) -> NDArray[np.float32]:
    """(n, 3) float32 of length 1; (0, 0, 1) for a normal without direction, since glTF allows no zero."""
    result = unit(normals.astype(np.float64))
    result[~result.any(axis=1)] = (0.0, 0.0, 1.0)
    return result.astype(np.float32)


def flip_v(uv: NDArray[np.float64]) -> NDArray[np.float32]:
    """(n, 2) v up → v down, float32."""
    return np.column_stack([uv[:, 0], 1.0 - uv[:, 1]]).astype(np.float32)


def linear_shorts(colors: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """(n, 4) uint8 sRGB → normalized uint16 linear, as glTF wants vertex colours; 8 bits would band in the dark."""
    linear = linear_from_srgb(colors / 255.0)
    linear[:, 3] = colors[:, 3] / 255.0
    return np.round(linear * 65535.0).astype(np.uint16)


def _indices(atlas: Atlas) -> NDArray[np.generic]:
    """(3 f,) uint16 where that is enough (65535 itself is reserved), else uint32."""
    small = len(atlas.positions) <= 65535
    return atlas.faces.reshape(-1).astype(np.uint16 if small else np.uint32)

"""glTF 2.0 (.glb, .gltf) → RawMesh: the triangles of the default scene, node transforms applied, in scene order.

Words of the specification (Khronos, glTF 2.0.1): accessor, primitive, node.  uv is turned v up; linear COLOR_0 becomes
sRGB.  Read here and not with trimesh, which drops uv without a material, ignores `normalized` and trusts any count.
"""

from __future__ import annotations

import json
import struct
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import MeshError
from ..colors import linear_to_srgb
from ..polygons import strip_triangles
from ..rawmesh import MAX_FACES, RawMesh, merge, transformed
from .buffers import GltfFile, parse_tree, read_accessor, read_buffers
from .materials import read_materials, uv_set

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from ...material import Material

TRIANGLES, STRIP, FAN = 4, 5, 6


def read_gltf(data: bytes, folder: Path) -> RawMesh:
    """Read a .glb or .gltf file.

    Args:
        data: the bytes of the file.
        folder: where it lies; references outside of it, and URLs, are refused.

    Raises:
        MeshError: damaged, compressed in a way that is not read, without triangles, or with such a reference.
    """
    try:
        tree, binary = parse_tree(data)
        file = GltfFile(tree, read_buffers(tree, binary, folder), folder)
        return _scene(file)
    except MeshError:
        raise
    except (
        KeyError,
        IndexError,
        TypeError,
        ValueError,
        AttributeError,
        OverflowError,
        struct.error,
        RecursionError,
    ) as error:
        raise MeshError(f"the glTF file is damaged ({_what(error)}), expected glTF 2.0; export it again") from error


def _what(error: Exception) -> str:
    """What reading stumbled over, in words of the format."""
    if isinstance(error, KeyError):
        return f"{str(error.args[0])[:40]!r} is missing or not allowed"
    if isinstance(error, IndexError):
        return "a number refers to what is not there"
    if isinstance(error, json.JSONDecodeError):
        return f"line {error.lineno} of its JSON is not readable"
    return "a value has the wrong type or size"


def _local_matrix(node: dict[str, Any]) -> NDArray[np.float64]:
    """(4, 4) float64, column vectors: T · R · S, or the matrix given (stored by columns)."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    x, y, z, w = (float(value) for value in node.get("rotation", (0.0, 0.0, 0.0, 1.0)))
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = rotation * np.asarray(node.get("scale", (1.0, 1.0, 1.0)), dtype=np.float64)
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix


def _placed_meshes(tree: dict[str, Any]) -> list[tuple[int, NDArray[np.float64]]]:
    """(mesh, node → world matrix) of each node that has a mesh, depth first in the order of the scene."""
    nodes = tree.get("nodes", [])
    children = {child for node in nodes for child in node.get("children", [])}
    scenes = tree.get("scenes", [])
    roots = (
        scenes[tree.get("scene", 0)].get("nodes", []) if scenes else [i for i in range(len(nodes)) if i not in children]
    )
    waiting, seen, placed = [(root, np.eye(4)) for root in reversed(roots)], set(), []
    while waiting:
        index, parent = waiting.pop()
        if index in seen:
            raise MeshError(
                f"glTF node {index} has several parents or is its own ancestor, expected a tree; export again"
            )
        seen.add(index)
        world = parent @ _local_matrix(nodes[index])
        if "mesh" in nodes[index]:
            placed.append((nodes[index]["mesh"], world))
        waiting += [(child, world) for child in reversed(nodes[index].get("children", []))]
    return placed


def _scene(file: GltfFile) -> RawMesh:
    materials, changes = read_materials(file)
    parts, skipped, faces = [], 0, 0
    for mesh, world in _placed_meshes(file.tree):
        for primitive in file.tree["meshes"][mesh]["primitives"]:
            if primitive.get("mode", TRIANGLES) not in (TRIANGLES, STRIP, FAN):
                skipped += 1
                continue
            parts.append(transformed(_primitive(file, primitive, materials), world))
            faces += len(parts[-1].faces)
            if faces > MAX_FACES:
                raise MeshError(f"the glTF scene has over {MAX_FACES} faces; decimate the meshes or split the scene")
    if not parts:
        found = "points or lines only (give points as .ply, .xyz or .npy)" if skipped else "no mesh"
        raise MeshError(f"the glTF scene holds {found}, expected triangles; check the export")
    whole = merge(parts)
    whole.changes.update(changes, skipped_primitives=skipped)
    return whole


def _primitive(file: GltfFile, primitive: dict[str, Any], materials: Sequence[Material]) -> RawMesh:
    attributes = primitive["attributes"]
    positions = read_accessor(file, attributes["POSITION"]).astype(np.float64)
    indices = read_accessor(file, primitive["indices"])[:, 0] if "indices" in primitive else np.arange(len(positions))
    faces = _triangles(indices.astype(np.int64), primitive.get("mode", TRIANGLES))
    normals = read_accessor(file, attributes["NORMAL"]).astype(np.float64) if "NORMAL" in attributes else None
    index = primitive.get("material")
    name = f"TEXCOORD_{0 if index is None else uv_set(file.tree['materials'][index])}"
    uv = read_accessor(file, attributes[name]).astype(np.float64) if name in attributes else None
    colors = _srgb(read_accessor(file, attributes["COLOR_0"])) if "COLOR_0" in attributes else None
    if any(values is not None and len(values) != len(positions) for values in (normals, uv, colors)):
        raise MeshError("a glTF primitive has attributes of different lengths; export the file again")
    return RawMesh(
        positions=positions,
        faces=faces,
        normals=normals,
        colors=colors,
        uv=None if uv is None else uv * (1.0, -1.0) + (0.0, 1.0),
        materials=() if index is None else (materials[index],),
        face_material=None if index is None else np.zeros(len(faces), dtype=np.int64),
    )


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

"""Nodes of a glTF 2.0 file: where each mesh stands in the scene, instances included.

Words of the specification (Khronos, glTF 2.0.1): node, scene; and of EXT_mesh_gpu_instancing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import MeshError
from ..rawmesh import MAX_FACES
from .buffers import GltfFile, read_accessor

if TYPE_CHECKING:
    from numpy.typing import NDArray

INSTANCING = "EXT_mesh_gpu_instancing"
LIGHTS = "KHR_lights_punctual"


def placed_meshes(file: GltfFile) -> list[tuple[int, NDArray[np.float64]]]:
    """(mesh, node → world matrix) of each mesh and instance, depth first in the order of the default scene.

    Raises: MeshError where nodes form no tree.
    """
    tree = file.tree
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
            placed += [(nodes[index]["mesh"], world @ own) for own in _instances(file, nodes[index])]
        waiting += [(child, world) for child in reversed(nodes[index].get("children", []))]
    return placed


def left_out(tree: dict[str, Any]) -> dict[str, int]:
    """What a still mesh can't say: how many animations, skins, morph targets, cameras and lights the file holds."""
    primitives = [primitive for mesh in tree.get("meshes", []) for primitive in mesh["primitives"]]
    return {
        "skipped_animations": len(tree.get("animations", [])),
        "skipped_skins": len(tree.get("skins", [])),
        "skipped_morph_targets": sum(len(primitive.get("targets", [])) for primitive in primitives),
        "skipped_cameras": len(tree.get("cameras", [])),
        "skipped_lights": len(tree.get("extensions", {}).get(LIGHTS, {}).get("lights", [])),
    }


def _local_matrix(node: dict[str, Any]) -> NDArray[np.float64]:
    """(4, 4) float64, column vectors: T · R · S, or the matrix given (stored by columns)."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    return _composed(
        np.array(node.get("translation", (0.0, 0.0, 0.0)), dtype=np.float64).reshape(3),
        np.array(node.get("rotation", (0.0, 0.0, 0.0, 1.0)), dtype=np.float64).reshape(4),
        np.array(node.get("scale", (1.0, 1.0, 1.0)), dtype=np.float64).reshape(3),
    )


def _composed(
    translation: NDArray[np.float64], rotation: NDArray[np.float64], scale: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(4, 4) float64: T · R · S of a vector, a unit quaternion x y z w, and factors along the axes."""
    x, y, z, w = rotation.tolist()
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= scale
    matrix[:3, 3] = translation
    return matrix


def _instances(file: GltfFile, node: dict[str, Any]) -> list[NDArray[np.float64]]:
    """The matrices of a node's instances; the unit matrix alone where it has none."""
    names = node.get("extensions", {}).get(INSTANCING, {}).get("attributes", {})
    known = {
        name: read_accessor(file, names[name]).astype(np.float64)
        for name in ("TRANSLATION", "ROTATION", "SCALE")
        if name in names
    }
    if not known:
        return [np.eye(4)]
    count = len(next(iter(known.values())))
    if count > MAX_FACES or any(len(values) != count for values in known.values()):
        raise MeshError("a glTF node has instance attributes of different lengths, or too many; export the file again")
    move = known.get("TRANSLATION", np.zeros((count, 3)))
    turn = known.get("ROTATION", np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)))
    size = known.get("SCALE", np.ones((count, 3)))
    return [_composed(*own) for own in zip(move, turn, size, strict=True)]

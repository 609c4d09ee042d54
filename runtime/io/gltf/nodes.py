"""Nodes of a glTF 2.0 file: where each mesh stands in the scene, instances included.

Words of the specification (Khronos, glTF 2.0.1): node, scene; and of EXT_mesh_gpu_instancing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import MeshError
from ..limits import limits, raised
from .buffers import GltfFile, read_accessor

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

INSTANCING = "EXT_mesh_gpu_instancing"
UNEVEN = 1e-3
"""Relative difference of a matrix's scales below which they count as equal."""


@dataclass(frozen=True, eq=False)
class Placement:
    """A place where a mesh stands.

    mesh, node: its numbers.  world: (4, 4) float64, mesh → world, column vectors.  first: in the first scene read.
    """

    mesh: int
    node: int
    world: NDArray[np.float64]
    first: bool = True

    @property
    def unlikeness(self) -> tuple[bool, int]:
        """Whether it mirrors, and how unevenly it scales in steps of `UNEVEN`: what unwraps best has the least."""
        scales = np.linalg.svd(self.world[:3, :3], compute_uv=False)
        with np.errstate(over="ignore"):  # beyond all numbers is uneven enough
            spread = float(scales[0] / max(scales[2], np.finfo(np.float64).tiny))
        return bool(np.linalg.det(self.world[:3, :3]) < 0.0), round(min(np.log(spread), 100.0) / UNEVEN)


def placed_meshes(file: GltfFile) -> list[Placement]:
    """Where each mesh and instance stands: depth first, the default scene before the others.

    A mesh with a skin stands where the first joint takes it; its own node has no say (glTF 2.0, section 3.7.3.3).

    Raises: MeshError where nodes form no tree.
    """
    nodes = file.tree.get("nodes", [])
    world: dict[int, NDArray[np.float64]] = {}
    placed: list[tuple[int, bool]] = []
    for number, roots in enumerate(scene_roots(file.tree)):
        found = _worlds(nodes, roots)
        placed += [(index, number == 0) for index in found if "mesh" in nodes[index] and index not in world]
        world |= {index: matrix for index, matrix in found.items() if index not in world}
    return [
        Placement(nodes[index]["mesh"], index, matrix, first)
        for index, first in placed
        for matrix in _standing(file, index, world)
    ]


def best_placements(placements: Sequence[Placement]) -> list[Placement]:
    """One for each mesh, in the order of their first: not mirrored and evenly scaled where the scene has such a one."""
    found: dict[int, Placement] = {}
    for placement in placements:
        known = found.setdefault(placement.mesh, placement)
        if placement.unlikeness < known.unlikeness:
            found[placement.mesh] = placement
    return list(found.values())


def select_placements(tree: dict[str, Any], placements: Sequence[Placement], names: Sequence[str]) -> list[Placement]:
    """Those of meshes that are named, or that stand at a node named or below one; all without names.

    Raises: MeshError for a name that is none of the scene's.
    """
    if not names:
        return list(placements)
    nodes, meshes = tree.get("nodes", []), tree.get("meshes", [])
    known = [str(entry["name"]) for entry in (*nodes, *meshes) if "name" in entry]
    for name in names:
        if name not in known:
            there = ", ".join(dict.fromkeys(known)) or "no names"
            raise MeshError(f"no node and no mesh is called {name!r}, expected some of {there[:200]}; correct --select")
    below = [index for index, node in enumerate(nodes) if node.get("name") in names]
    inside: set[int] = set()
    while below:
        index = below.pop()
        inside.add(index)
        below += [child for child in nodes[index].get("children", []) if child not in inside]
    chosen = {index for index, mesh in enumerate(meshes) if mesh.get("name") in names}
    chosen |= {entry.mesh for entry in placements if entry.node in inside}
    if not chosen:
        raise MeshError(f"{', '.join(names)} holds no mesh, expected one or more; correct --select")
    return [entry for entry in placements if entry.mesh in chosen]


def scene_roots(tree: dict[str, Any]) -> list[list[int]]:
    """Root nodes of each scene, the default one first; without scenes all nodes that are nobody's child."""
    nodes, scenes = tree.get("nodes", []), tree.get("scenes", [])
    if not scenes:
        children = {child for node in nodes for child in node.get("children", [])}
        return [[index for index in range(len(nodes)) if index not in children]]
    default = int(tree.get("scene", 0))
    return [scenes[index].get("nodes", []) for index in (default, *(i for i in range(len(scenes)) if i != default))]


def _worlds(nodes: Sequence[dict[str, Any]], roots: Sequence[int]) -> dict[int, NDArray[np.float64]]:
    """Node → world matrix of all nodes below the roots, depth first.  Raises: MeshError where they form no tree."""
    waiting, world = [(root, np.eye(4)) for root in reversed(roots)], {}
    while waiting:
        index, parent = waiting.pop()
        if index in world:
            raise MeshError(
                f"glTF node {index} has several parents or is its own ancestor, expected a tree; export again"
            )
        with np.errstate(over="ignore", invalid="ignore"):
            world[index] = parent @ local_matrix(nodes[index])
        if not np.isfinite(world[index]).all():
            raise MeshError(f"glTF node {index} stands beyond all numbers, expected finite ones; export the file again")
        waiting += [(child, world[index]) for child in reversed(nodes[index].get("children", []))]
    return world


def _standing(file: GltfFile, index: int, world: Mapping[int, NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """The matrices of the mesh of a node: one, or one for each instance."""
    node = file.tree["nodes"][index]
    if "skin" not in node:
        return [world[index] @ own for own in _instances(file, node)]
    skin = file.tree["skins"][node["skin"]]
    joint = world.get(skin["joints"][0], np.eye(4))
    if "inverseBindMatrices" not in skin:
        return [joint]
    return [joint @ read_accessor(file, skin["inverseBindMatrices"])[0].reshape(4, 4).T]


def local_matrix(node: dict[str, Any]) -> NDArray[np.float64]:
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
    if count > limits().nodes:
        raise MeshError(f"{count} instances of a glTF node, at most {limits().nodes} are read; {raised('nodes')}")
    if any(len(values) != count for values in known.values()):
        raise MeshError("a glTF node has instance attributes of different lengths; export the file again")
    move = known.get("TRANSLATION", np.zeros((count, 3)))
    turn = known.get("ROTATION", np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)))
    size = known.get("SCALE", np.ones((count, 3)))
    return [_composed(*own) for own in zip(move, turn, size, strict=True)]

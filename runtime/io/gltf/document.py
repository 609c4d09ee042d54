"""A glTF document beside the surface that is read of it.   A part is one primitive of triangles.

Words of the specification (Khronos, glTF 2.0.1): mesh, primitive, node.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...brief import Brief
from .compression import DRACO, MESHOPT, meshopt_of
from .references import extensions_in

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .buffers import GltfFile
    from .nodes import Placement

TRIANGLES = 4
LIGHTS = "KHR_lights_punctual"
HELD = ("POSITION", "NORMAL", "TANGENT", "TEXCOORD_", "COLOR_0", "JOINTS_", "WEIGHTS_")
"""Beginnings of attributes that other formats hold as well, that follow from others, or that go with a skin."""
REACHED = (DRACO, *MESHOPT, LIGHTS, "KHR_texture_", "EXT_texture_", "KHR_mesh_quantization", "EXT_mesh_gpu_instancing")
REACHED += ("KHR_materials_emissive_strength",)
"""Beginnings of extensions whose matter is in the mesh or its maps, or is counted by itself."""


@dataclass(frozen=True, eq=False, repr=False)
class Part(Brief):
    """One primitive.

    mesh, primitive: its numbers.  world: (4, 4) float64, its own space → that of the asset.
    """

    mesh: int
    primitive: int
    world: NDArray[np.float64]

    @property
    def mirrored(self) -> bool:
        """Whether its triangles wind the other way in the asset than in the file."""
        return bool(np.linalg.det(self.world[:3, :3]) < 0.0)


@dataclass(frozen=True, eq=False, repr=False)
class Document(Brief):
    """The file, the parts of the asset, and every place where a mesh stands in the default scene."""

    file: GltfFile
    parts: tuple[Part, ...]
    placements: tuple[Placement, ...]

    def beyond_meshes(self) -> dict[str, int]:
        """What a still mesh with one set of uv can't say: animations, skins, morph targets, cameras, lights, more."""
        tree: dict[str, Any] = self.file.tree
        primitives = [primitive for mesh in tree.get("meshes", []) for primitive in mesh["primitives"]]
        names = {name for primitive in primitives for name in primitive["attributes"]}
        counts = {
            "skipped_meshes": len(tree.get("meshes", [])) - len({part.mesh for part in self.parts}),
            "skipped_animations": len(tree.get("animations", [])),
            "skipped_skins": len(tree.get("skins", [])),
            "skipped_morph_targets": sum(len(primitive.get("targets", [])) for primitive in primitives),
            "skipped_cameras": len(tree.get("cameras", [])),
            "skipped_lights": len(tree.get("extensions", {}).get(LIGHTS, {}).get("lights", [])),
            "skipped_primitives": sum(primitive.get("mode", TRIANGLES) < TRIANGLES for primitive in primitives),
            "skipped_attributes": sum(not name.startswith(HELD) for name in names),
            "skipped_uv_sets": len([name for name in names if name.startswith("TEXCOORD_")][1:]),
            "skipped_extras": _with_extras(tree),
            "skipped_extensions": sum(not name.startswith(REACHED) for name in extensions_in(tree)),
        }
        return {name: count for name, count in counts.items() if count}

    def joined(self) -> dict[str, int]:
        """Nodes that are one mesh in a format without a tree of them."""
        places = sum(place.first for place in self.placements)
        return {"joined_nodes": places} if places > 1 else {}

    def without_material(self) -> int:
        """Primitives of the parts that have no material: they get glTF's own default with their new uv."""
        meshes = self.file.tree.get("meshes", [])
        return sum("material" not in meshes[part.mesh]["primitives"][part.primitive] for part in self.parts)

    def compressed(self) -> dict[str, int]:
        """What is written without its compression: primitives of the parts by Draco, and all that meshopt packed."""
        meshes = self.file.tree.get("meshes", [])
        own = {(part.mesh, part.primitive) for part in self.parts}
        draco = sum(DRACO in meshes[mesh]["primitives"][number].get("extensions", {}) for mesh, number in own)
        meshopt = sum(meshopt_of(view) is not None for view in self.file.tree.get("bufferViews", []))
        return {"draco_undone": draco, "meshopt_undone": meshopt}


def _with_extras(value: Any) -> int:
    """How many objects of the document have extras of somebody's making."""
    if isinstance(value, list):
        return sum(_with_extras(entry) for entry in value)
    if not isinstance(value, dict):
        return 0
    return ("extras" in value) + sum(_with_extras(entry) for name, entry in value.items() if name != "extras")

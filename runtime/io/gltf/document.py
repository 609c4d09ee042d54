"""A glTF document beside the surface that is read of it.   A part is one primitive of triangles.

Words of the specification (Khronos, glTF 2.0.1): mesh, primitive, node.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .compression import DRACO, meshopt_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .buffers import GltfFile
    from .nodes import Placement

TRIANGLES = 4
LIGHTS = "KHR_lights_punctual"


@dataclass(frozen=True, eq=False)
class Part:
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


@dataclass(frozen=True, eq=False)
class Document:
    """The file, the parts of the asset, and every place where a mesh stands in the default scene."""

    file: GltfFile
    parts: tuple[Part, ...]
    placements: tuple[Placement, ...]

    def beyond_meshes(self) -> dict[str, int]:
        """What a still mesh can't say: instances, animations, skins, morph targets, cameras and lights of the file."""
        tree: dict[str, Any] = self.file.tree
        primitives = [primitive for mesh in tree.get("meshes", []) for primitive in mesh["primitives"]]
        counts = {
            "skipped_meshes": len(tree.get("meshes", [])) - len({part.mesh for part in self.parts}),
            "skipped_animations": len(tree.get("animations", [])),
            "skipped_skins": len(tree.get("skins", [])),
            "skipped_morph_targets": sum(len(primitive.get("targets", [])) for primitive in primitives),
            "skipped_cameras": len(tree.get("cameras", [])),
            "skipped_lights": len(tree.get("extensions", {}).get(LIGHTS, {}).get("lights", [])),
            "skipped_primitives": sum(primitive.get("mode", TRIANGLES) < TRIANGLES for primitive in primitives),
        }
        return {name: count for name, count in counts.items() if count}

    def compressed(self) -> dict[str, int]:
        """What is written without its compression: primitives of the parts by Draco, and all that meshopt packed."""
        meshes = self.file.tree.get("meshes", [])
        own = {(part.mesh, part.primitive) for part in self.parts}
        draco = sum(DRACO in meshes[mesh]["primitives"][number].get("extensions", {}) for mesh, number in own)
        meshopt = sum(meshopt_of(view) is not None for view in self.file.tree.get("bufferViews", []))
        return {"draco_undone": draco, "meshopt_undone": meshopt}

"""What becomes a Mesh of a .usda file: of a scene each mesh, of an OBJ file each object or group, else all there is.

n atlas vertices · f faces · m polygons.   Polygons are what `loops_of` finds; those of scenes are triangles.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.io.loops import first_faces, loops_of
from ...runtime.io.polygons import fans
from .gltf import centre_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.io.loops import Loops
    from ...runtime.mesh import Asset, Atlas


@dataclass(frozen=True, eq=False)
class Shape:
    """One Mesh.

    name: of the mesh or object.  mesh: its number in the scene.  used: (w,) atlas vertices.  size: (m,) corners of each
    polygon.  corner: (c,) into used, as the polygons wind in its own space.  material: (m,) of each polygon, a number
    of the asset's materials.  world: (4, 4) its own space → that of the atlas.
    """

    name: str
    mesh: int
    used: NDArray[np.int64]
    size: NDArray[np.int64]
    corner: NDArray[np.int64]
    material: NDArray[np.int64]
    world: NDArray[np.float64]

    @property
    def mirrored(self) -> bool:
        """Whether its polygons wind the other way in the atlas."""
        return bool(np.linalg.det(self.world[:3, :3]) < 0.0)

    @property
    def triangles(self) -> NDArray[np.int64]:
        """(t, 3) atlas vertices, wound as in the atlas: each polygon as a fan from its first corner."""
        found = self.used[self.corner[fans(self.size)[0]]]
        return found[:, [0, 2, 1]] if self.mirrored else found

    def positions(self, atlas: Atlas) -> NDArray[np.float64]:
        """(w, 3) in its own space."""
        moved = atlas.positions[self.used] - self.world[:3, 3]
        linear = self.world[:3, :3]
        return moved if np.array_equal(linear, np.eye(3)) else moved @ np.linalg.inv(linear).T

    def normals(self, atlas: Atlas) -> NDArray[np.float32]:
        """(w, 3) unit, in its own space."""
        linear = self.world[:3, :3]
        if np.array_equal(linear, np.eye(3)):
            return atlas.normals[self.used]
        turned = atlas.normals[self.used].astype(np.float64) @ linear
        length = np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), np.finfo(np.float64).tiny)
        return (turned / length).astype(np.float32)


def shapes_of(atlas: Atlas, asset: Asset) -> list[Shape]:
    """All of them, in the order of their first polygons; a scene's in the order of its meshes."""
    loops = loops_of(atlas, asset)
    face = first_faces(asset, loops)
    number, names = _labels(asset, face, loops)
    material = np.zeros(len(atlas.faces), np.int64) if asset.face_material is None else asset.face_material
    world = {} if asset.document is None else {part.mesh: part.world for part in asset.document.parts}
    own = np.eye(4)
    own[:3, 3] = centre_of(atlas.positions)
    return [
        _shape(name, each, loops, np.flatnonzero(number == each), material[face], world.get(each, own))
        for each, name in names.items()
    ]


def _shape(
    name: str,
    mesh: int,
    loops: Loops,
    rows: NDArray[np.int64],
    material: NDArray[np.int64],
    world: NDArray[np.float64],
) -> Shape:
    """The loops rows (m,) as a Mesh."""
    start = np.cumsum(loops.size) - loops.size
    size = loops.size[rows]
    first = np.repeat(start[rows] - (np.cumsum(size) - size), size)
    used, corner = np.unique(loops.vertex[first + np.arange(len(first))], return_inverse=True)
    found = Shape(name, mesh, used, size, corner.reshape(-1).astype(np.int64), material[rows], world)
    if not found.mirrored:
        return found
    turned = found.corner.reshape(-1, 3)[:, [0, 2, 1]].reshape(-1)  # scenes hold triangles
    return Shape(name, mesh, used, size, turned, material[rows], world)


def _labels(asset: Asset, face: NDArray[np.int64], loops: Loops) -> tuple[NDArray[np.int64], dict[int, str]]:
    """Number (m,) of the Mesh of each polygon, whose first triangle is face (m,), and the names by number."""
    if asset.document is not None and asset.part is not None:
        meshes = asset.document.file.tree["meshes"]
        number = np.array([part.mesh for part in asset.document.parts])[asset.part[face]]
        return number, {each: str(meshes[each].get("name", "mesh")) for each in np.unique(number).tolist()}
    if asset.obj is not None:
        number, names = asset.obj.objects
        number = number[loops.polygon]
        return number, {each: names[each] or "mesh" for each in dict.fromkeys(number.tolist())}
    return np.zeros(len(face), np.int64), {0: "mesh"}

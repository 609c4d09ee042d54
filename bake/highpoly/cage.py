"""Where rays from the low-poly mesh to the high-poly one start, and how far they go.

t texels · f faces of the low-poly mesh · v its welded vertices.  Rays follow the low-poly's smooth normals,
interpolated over its faces: they are continuous over the whole surface, hard edges included, so no gap opens between
neighbouring faces.  They start outside and run inwards, through the low-poly surface and beyond it, so that the
outermost surface in reach is what is baked (details that float above the surface, too).  A cage mesh says where they
start instead.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.errors import InputError
from ...runtime.geometry.normals import smooth_normals
from ...runtime.geometry.triangles import triangle_cross

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Asset, Frame, Surface
    from ..raster.gbuffer import GBuffer

SHORTEST = 1e-6
"""Of a ray from a cage, in radii of the mesh; where the cage touches the surface, the normal gives the direction."""


@dataclass(frozen=True)
class CageSettings:
    """How far the rays of a high-to-low bake reach.

    distance: outwards and inwards, as a part of the low-poly's bounding box diagonal, in (0, 1].  cage: a mesh with the
    low-poly's faces in the same order, from which rays start; they end as far behind the low-poly.  match_names:
    a part of the low-poly sees only the high-poly parts of the same name (see parts.py).  ignore_backs: a face seen
    from behind does not count, and the ray goes on.
    Raises: InputError for a distance out of range.
    """

    distance: float = 0.02
    cage: Asset | None = None
    match_names: bool = False
    ignore_backs: bool = True

    def __post_init__(self) -> None:
        if not 0.0 < self.distance <= 1.0:
            raise InputError(
                f"cage distance {self.distance}: expected a part of the bounding box diagonal, in (0, 1]; pass 0.02"
            )


class Rays(NamedTuple):
    """Rays through texels, in the unit ball of a Frame.

    point: (t, 3) float32 low-poly surface point.  outwards: (t, 3) float32 unit, against the ray's direction.
    front, back: (t,) float32, how far before and behind the point it runs.
    """

    point: NDArray[np.float32]
    outwards: NDArray[np.float32]
    front: NDArray[np.float32]
    back: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Cage:
    """Where rays through the low-poly surface run, in the unit ball of a Frame.

    surface: the low-poly mesh.  vertices, normals: (v, 3) float32, normals smooth.  reach: how far rays go both ways.
    starts: (c, 3) float32 vertices of the cage mesh, and start_faces (f, 3) that look them up; None without one.
    """

    surface: Surface
    vertices: NDArray[np.float32]
    normals: NDArray[np.float32]
    reach: float
    starts: NDArray[np.float32] | None = None
    start_faces: NDArray[np.int64] | None = None

    @classmethod
    def of(cls, surface: Surface, frame: Frame, settings: CageSettings) -> Cage:
        """The cage of a low-poly mesh.  Raises: InputError as `check_cage`."""
        vertices = frame.apply(surface.vertices).astype(np.float32)
        reach = settings.distance * float(np.linalg.norm(np.ptp(surface.vertices, axis=0))) / frame.scale
        cage = cls(surface, vertices, smooth_normals(surface).astype(np.float32), reach)
        if settings.cage is None:
            return cage
        outer = settings.cage.surface
        check_cage(outer, surface)
        return replace(cage, starts=frame.apply(outer.vertices).astype(np.float32), start_faces=outer.faces)

    def rays(self, gbuffer: GBuffer, texels: NDArray[np.int64]) -> Rays:
        """The rays of flat covered texel indices (t,)."""
        faces = self.surface.faces
        point = gbuffer.interpolate(self.vertices, faces, texels)
        corner = self.vertices[faces[gbuffer.face.reshape(-1)[texels]]]
        facing = triangle_cross(corner).astype(np.float32)
        normal = _unit_or(gbuffer.interpolate(self.normals, faces, texels), facing)
        if self.starts is None or self.start_faces is None:
            length = np.full(len(texels), self.reach, np.float32)
            return Rays(point, normal, length, length)
        away = gbuffer.interpolate(self.starts, self.start_faces, texels) - point
        length = np.maximum(np.linalg.norm(away, axis=1), SHORTEST).astype(np.float32)
        return Rays(point, _unit_or(away, normal), length, length)


def check_cage(cage: Surface, low: Surface) -> None:
    """Raise InputError unless both surfaces have the same faces in the same order, joined in the same way."""
    if len(cage.faces) != len(low.faces):
        raise InputError(
            f"the cage has {len(cage.faces)} faces, the low-poly mesh {len(low.faces)}: expected the same faces in the"
            " same order; make the cage by moving the vertices of the low-poly mesh"
        )
    differs = np.flatnonzero((_by_appearance(cage.faces) != _by_appearance(low.faces)).any(axis=1))
    if len(differs):
        raise InputError(
            f"face {differs[0]} of the cage joins other vertices than that of the low-poly mesh: expected the same"
            " faces in the same order; make the cage by moving the vertices of the low-poly mesh"
        )


def _by_appearance(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """(f, 3) vertices renumbered in the order in which they first appear."""
    _, first, inverse = np.unique(faces, return_index=True, return_inverse=True)
    rank = np.zeros(len(first), np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return rank[inverse.reshape(faces.shape)]


def _unit_or(vector: NDArray[np.float32], instead: NDArray[np.floating]) -> NDArray[np.float32]:
    """(t, 3) vectors at length 1; where they are shorter than `SHORTEST`, the others."""
    length = np.linalg.norm(vector, axis=1, keepdims=True)
    return np.where(length > SHORTEST, vector / np.maximum(length, SHORTEST), instead).astype(np.float32)

"""High to low: the point of the high-poly meshes that each texel of the low-poly atlas stands for.

h w texels · t texels of a batch · f faces of all high-poly meshes together.  Positions are in source units.

The result is a G-buffer again, of the high-poly surface, with an atlas and an asset that its faces point into.  So
every map that is a function of a G-buffer can be baked from the high-poly mesh by the same function.

A ray runs from outside inwards (see cage.py) and ends on the first face that it meets from the front.  Texels whose ray
meets none take the nearest point of the high-poly surface; they are counted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.errors import InputError
from ...runtime.geometry.triangles import triangle_cross
from ...runtime.mesh import Frame, Surface
from ..maps.rays import BATCH, Hits, RayScene, in_batches
from .cage import Cage, CageSettings, Rays
from .highmesh import atlas_of, merge_assets, uv_per_unit
from .parts import matching_faces

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ...runtime.mesh import Asset, Atlas
    from ..maps.rays import Progress
    from ..raster.gbuffer import GBuffer

LAYERS = 8
"""Faces seen from behind that a ray passes before it counts as missed."""
STEP = 1e-6
"""Of a ray beyond such a face, in radii of the low-poly mesh."""


@dataclass(frozen=True, eq=False)
class HighSurface:
    """What the high-poly meshes hold under each texel of the low-poly atlas.

    gbuffer: of the high-poly surface: its position, normal (as its file has them, else smooth), face and weights; face
    counts through `asset`.  atlas, asset: all high-poly meshes as one, for maps to look up.  height: (h, w) float32,
    source units, from the low-poly surface outwards along the ray to the high-poly's.  missed: (h, w) bool, texels
    whose ray met nothing and that took the nearest point.
    """

    gbuffer: GBuffer
    atlas: Atlas
    asset: Asset
    height: NDArray[np.float32]
    missed: NDArray[np.bool_]

    def report(self) -> dict[str, float]:
        """Texels, those missed, their share, and the largest distance that was bridged outwards and inwards."""
        texels = self.gbuffer.texels
        height = self.height.reshape(-1)[texels]
        missed = int(self.missed.sum())
        return {
            "texels": len(texels),
            "missed": missed,
            "missed_share": missed / max(len(texels), 1),
            "highest": float(height.max(initial=0.0)),
            "lowest": float(height.min(initial=0.0)),
        }


@dataclass(frozen=True, eq=False)
class Projector:
    """Low-poly and high-poly meshes ready for rays, for one G-buffer after another.

    high, atlas: all high-poly meshes as one.  vertices: (n, 3) float32 of them in the frame's ball.  parts: what is
    traced apart: low-poly faces (f,) bool, high-poly faces they see, and their scene.
    """

    frame: Frame
    cage: Cage
    high: Asset
    atlas: Atlas
    vertices: NDArray[np.float32]
    parts: list[tuple[NDArray[np.bool_], NDArray[np.int64], RayScene]]
    ignore_backs: bool

    @classmethod
    def of(cls, atlas: Atlas, asset: Asset, highs: Sequence[Asset], settings: CageSettings | None = None) -> Projector:
        """Prepare.

        Args:
            atlas: the low-poly atlas.
            asset: the low-poly mesh; its faces are those of the atlas.
            highs: the high-poly meshes, one or more, in the low-poly's coordinates.
            settings: how far rays reach, from where, and what they see.

        Raises: InputError without a high-poly mesh, for a cage of another topology, for parts without partners.
        """
        if not highs:
            raise InputError("no high-poly mesh: expected one or more; pass --high high.obj")
        settings = settings or CageSettings()
        high, frame = merge_assets(highs), Frame.of(asset.surface.vertices)
        parts = [(np.ones(len(asset.faces), bool), np.arange(len(high.faces)))]
        if settings.match_names:
            parts = matching_faces(asset, highs)
        surface = high.surface
        scenes = [RayScene.of(Surface(surface.vertices, surface.faces[seen]), frame) for _, seen in parts]
        return cls(
            frame,
            Cage.of(asset.surface, frame, settings),
            high,
            atlas_of(high, uv_per_unit(atlas.positions[atlas.faces], atlas.corner_uv)),
            frame.apply(high.positions).astype(np.float32),
            [(own, seen, scene) for (own, seen), scene in zip(parts, scenes, strict=True)],
            settings.ignore_backs,
        )

    def surface(self, gbuffer: GBuffer, progress: Progress | None = None) -> HighSurface:
        """The high-poly surface under each texel of a G-buffer of the low-poly atlas."""
        result = self._empty(gbuffer)
        low_face = gbuffer.face.reshape(-1)[gbuffer.texels]
        for own, seen, scene in self.parts:
            texels = gbuffer.texels[own[low_face]]
            in_batches(partial(self._trace, result, gbuffer, seen, scene), texels, BATCH // 4, progress)
        return replace(result, gbuffer=replace(result.gbuffer))  # without what was cached of empty arrays

    def _empty(self, low: GBuffer) -> HighSurface:
        """Arrays to fill."""
        image = np.zeros((*low.shape, 9), np.float32)
        gbuffer = replace(
            low,
            position=np.zeros_like(image[..., :3]),
            normal=np.zeros_like(image[..., :3]),
            second=np.zeros_like(image[..., 0]),
            third=np.zeros_like(image[..., 0]),
            face=np.full(low.shape, -1, np.int32),
        )
        return HighSurface(gbuffer, self.atlas, self.high, np.zeros(low.shape, np.float32), np.zeros(low.shape, bool))

    def _trace(
        self, result: HighSurface, low: GBuffer, seen: NDArray[np.int64], scene: RayScene, texels: NDArray[np.int64]
    ) -> None:
        """Fill a batch of texels (t,) from a scene of these high-poly faces."""
        rays = self.cage.rays(low, texels)
        found = first_front(scene, rays, ignore_backs=self.ignore_backs)
        lost = np.flatnonzero(~found.hit)
        face, second, third = found.face, found.second, found.third
        if len(lost):
            near = scene.nearest(np.ascontiguousarray(rays.point[lost]))
            face[lost], second[lost], third[lost] = near.face, near.second, near.third
        buffer = result.gbuffer
        buffer.face.reshape(-1)[texels] = seen[face]
        buffer.second.reshape(-1)[texels], buffer.third.reshape(-1)[texels] = second, third
        buffer.position.reshape(-1, 3)[texels] = buffer.interpolate(self.atlas.positions, self.atlas.faces, texels)
        buffer.normal.reshape(-1, 3)[texels] = self._normals(buffer, texels)
        away = buffer.interpolate(self.vertices, self.atlas.faces, texels) - rays.point
        result.height.reshape(-1)[texels] = np.einsum("ti,ti->t", away, rays.outwards) * self.frame.scale
        result.missed.reshape(-1)[texels] = ~found.hit

    def _normals(self, buffer: GBuffer, texels: NDArray[np.int64]) -> NDArray[np.float32]:
        """(t, 3) unit, interpolated; the face's own where they cancel."""
        normal = buffer.interpolate(self.atlas.normals, self.atlas.faces, texels)
        length = np.linalg.norm(normal, axis=1)
        lost = np.flatnonzero(length < 1e-6)
        corner = self.vertices[self.atlas.faces[buffer.face.reshape(-1)[texels[lost]]]]
        normal[lost] = triangle_cross(corner)
        length[lost] = np.maximum(np.linalg.norm(normal[lost], axis=1), 1e-30)
        return normal / length[:, None]


def first_front(scene: RayScene, rays: Rays, *, ignore_backs: bool = True) -> Hits:
    """First hit from the front of each ray (t,); `hit` is False where there is none, distances are from its start."""
    count = len(rays.point)
    result = Hits(np.zeros(count, bool), np.zeros(count, np.int64), *(np.zeros(count, np.float32) for _ in range(3)))
    start = rays.point + rays.front[:, None] * rays.outwards
    left, passed = np.arange(count), np.zeros(count, np.float32)
    for _ in range(LAYERS):
        inwards = -rays.outwards[left]
        origin = (start[left] + passed[left, None] * inwards).astype(np.float32)
        hits, facing = scene.cast_facing(origin, inwards, (rays.front + rays.back)[left] - passed[left])
        good = hits.hit & (facing | (not ignore_backs))
        done = left[good]
        result.hit[done], result.face[done] = True, hits.face[good]
        result.second[done], result.third[done] = hits.second[good], hits.third[good]
        result.distance[done] = passed[done] + hits.distance[good]
        behind = hits.hit & ~good
        left = left[behind]
        if len(left) == 0:
            break
        passed[left] += hits.distance[behind] + STEP
    return result

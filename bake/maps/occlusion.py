"""Maps of what rays see from the surface: ambient occlusion, bent normals, thickness.

h w texels, row 0 = top · t texels of a batch · s rays per texel.  A scene of rays is built once per mesh and kept for
the windows of an image.  Object space; rays run in the unit ball of the mesh's Frame.

Where a ray starts: at the surface point, lifted onto the smooth surface that the vertex normals describe (Hanika 2021,
"Hacking the Shadow Terminator"), so that coarse faces cast no shadow on themselves; then `OFFSET` along the face
normal, so that rays do not hit the face they start from.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.triangles import triangle_cross
from .normals import in_tangent_space
from .rays import BATCH, RayScene, RaySettings, cosine_directions, in_batches, pattern_of, sphere_patterns

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ...runtime.mesh import Asset, Atlas, Frame, Surface
    from ..bakemap import Compute, NormalFormat
    from ..raster.gbuffer import GBuffer

    Kernel = Callable[[RayScene, NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]], NDArray[np.float32]]

OFFSET = 3e-5
"""Start of rays off the face, in radii of the mesh: some hundred steps of float32."""


def ao_map(settings: RaySettings) -> Compute:
    """Ambient occlusion: the cosine-weighted part of the hemisphere that is open, see `ambient_occlusion`.

    No space, [0, 1], 1 = open; unit, PNG 8 bits dithered by default (1 channel).
    """
    return _with_scene(ambient_occlusion, settings)


def bent_normal_object_map(settings: RaySettings) -> Compute:
    """Mean open direction, see `bent_normals`.  Object space, unit vectors, [−1, 1]; signed, EXR half (3 channels)."""
    return _with_scene(bent_normals, settings)


def bent_normal_map(settings: RaySettings, normal_format: NormalFormat) -> Compute:
    """Mean open direction in the frame of the tangents that are written, as the normal map's.

    Tangent space, unit vectors, [−1, 1]; signed, PNG 8 bits dithered by default (3 channels).
    """
    return in_tangent_space(bent_normal_object_map(settings), normal_format)


def thickness_map(settings: RaySettings) -> Compute:
    """Depth of the body beneath the surface in radii of the mesh's bounding ball, see `thickness`.

    No space, [0, 1]; unit, PNG 8 bits dithered by default (1 channel).
    """
    return _with_scene(thickness, settings)


def ambient_occlusion(
    gbuffer: GBuffer, atlas: Atlas, asset: Asset, settings: RaySettings | None = None, *, scene: RayScene | None = None
) -> NDArray[np.float32]:
    """(h, w, 1) float32: the cosine-weighted part of the hemisphere that is open, 1 = nothing in the way.

    Both sides of a face occlude.  Error against many rays: about 0.3 / count^¾ rms.  scene: of the asset's surface,
    where it is at hand.
    """
    settings = settings or RaySettings()
    scene = scene or RayScene.of(met_by_rays(asset))
    reach = settings.distance / scene.frame.scale

    def open_part(scene: RayScene, origin: NDArray[np.float32], direction: NDArray[np.float32], _: object) -> NDArray:
        blocked = scene.occluded(_per_ray(origin, direction), direction.reshape(-1, 3), _reach(direction, reach))
        count = direction.shape[1]
        return (1.0 - np.count_nonzero(blocked.reshape(-1, count), axis=1)[:, None] / count).astype(np.float32)

    return _gather(gbuffer, atlas, asset, settings, scene, Estimate(open_part, 1))


def bent_normals(
    gbuffer: GBuffer, atlas: Atlas, asset: Asset, settings: RaySettings | None = None, *, scene: RayScene | None = None
) -> NDArray[np.float32]:
    """(h, w, 3) float32 unit, object space: the cosine-weighted mean of the open directions.

    The normal itself where no ray is open.
    """
    settings = settings or RaySettings()
    scene = scene or RayScene.of(met_by_rays(asset))
    reach = settings.distance / scene.frame.scale

    def mean_open(
        scene: RayScene, origin: NDArray[np.float32], direction: NDArray[np.float32], normal: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        blocked = scene.occluded(_per_ray(origin, direction), direction.reshape(-1, 3), _reach(direction, reach))
        weight = np.where(blocked.reshape(direction.shape[:2]), 0.0, 1.0 / np.maximum(_length(direction), 1e-12))
        total = np.einsum("ts,tsi->ti", weight.astype(np.float32), direction)
        return _unit_or(total, normal)

    return _gather(gbuffer, atlas, asset, settings, scene, Estimate(mean_open, 3))


def thickness(
    gbuffer: GBuffer, atlas: Atlas, asset: Asset, settings: RaySettings | None = None, *, scene: RayScene | None = None
) -> NDArray[np.float32]:
    """(h, w, 1) float32 in [0, 1]: how deep the body is beneath the surface, in radii of the mesh's bounding ball.

    Rays go inwards, cosine-weighted; of each that meets the far side the depth below the surface point counts (its
    part along the normal), so a slab of any orientation has exactly its own thickness, a ball its radius, which is 1
    (what is deeper is shown as 1).  Rays that leave through a hole do not count, and where all do the thickness is 0.
    """
    settings = settings or RaySettings()
    scene = scene or RayScene.of(met_by_rays(asset))
    reach = settings.distance / scene.frame.scale

    def mean_depth(
        scene: RayScene, origin: NDArray[np.float32], direction: NDArray[np.float32], normal: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        hits = scene.cast(_per_ray(origin, direction), direction.reshape(-1, 3), _reach(direction, reach))
        along = -np.einsum("tsi,ti->ts", direction, normal)
        depth = np.where(hits.hit, hits.distance, 0.0).reshape(along.shape) * along
        count = np.count_nonzero(hits.hit.reshape(along.shape), axis=1)
        return np.minimum(depth.sum(axis=1) / np.maximum(count, 1), 1.0)[:, None].astype(np.float32)

    return _gather(gbuffer, atlas, asset, settings, scene, Estimate(mean_depth, 1, inwards=True))


def met_by_rays(asset: Asset) -> Surface:
    """The surface that rays meet: of a page, that of all pages."""
    return asset.surface if asset.whole is None else asset.whole


def starting_points(
    gbuffer: GBuffer, atlas: Atlas, asset: Asset, frame: Frame, texels: NDArray[np.int64], *, inwards: bool = False
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Origins in the ball and unit normals, both (t, 3) float32, at flat covered texel indices.

    inwards: below the surface instead, not lifted.
    """
    surface = asset.surface
    face = gbuffer.face.reshape(-1)[texels]
    corner = frame.apply(surface.vertices).astype(np.float32)[surface.faces[face]]
    weights = gbuffer.weights(texels)
    point = np.einsum("tc,tci->ti", weights, corner)
    facing = triangle_cross(corner).astype(np.float32)
    facing = _unit_or(facing, np.zeros_like(facing))
    normal = _unit_or(gbuffer.normal.reshape(-1, 3)[texels], facing)
    side = np.where(np.einsum("ti,ti->t", facing, normal) < 0.0, -OFFSET, OFFSET).astype(np.float32)
    if inwards:
        return point - side[:, None] * facing, normal
    lifted = point + lift(point, corner, atlas.normals[atlas.faces[face]], weights)
    return lifted + side[:, None] * facing, normal


def lift(
    point: NDArray[np.float32], corner: NDArray[np.float32], normal: NDArray[np.float32], weights: NDArray[np.float32]
) -> NDArray[np.float32]:
    """(t, 3) float32: the way from points (t, 3) of faces up to the tangent planes of their corners.

    corner, normal: (t, 3, 3), of the faces' corners.  weights: (t, 3) barycentric.  Zero where the surface is flat or
    hollow: the planes lie below the face there.
    """
    below = np.einsum("tci,tci->tc", corner - point[:, None], normal)
    return np.einsum("tc,tci->ti", weights * np.maximum(below, 0.0), normal)


def _with_scene(function: Callable[..., NDArray[np.float32]], settings: RaySettings) -> Compute:
    """The function with its settings, and a scene that is kept while the surface stays the same."""
    made = lru_cache(maxsize=1)(RayScene.of)

    def compute(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
        return function(gbuffer, atlas, asset, settings, scene=made(met_by_rays(asset)))

    return compute


@dataclass(frozen=True)
class Estimate:
    """What is made of rays: kernel(scene, origin, direction, normal) → (t, channels).  inwards: into the body."""

    kernel: Kernel
    channels: int
    inwards: bool = False


def _gather(
    gbuffer: GBuffer, atlas: Atlas, asset: Asset, settings: RaySettings, scene: RayScene, estimate: Estimate
) -> NDArray[np.float32]:
    """(h, w, channels): the estimate at all covered texels, a batch of rays at a time."""
    channels, inwards = estimate.channels, estimate.inwards
    patterns = sphere_patterns(settings.count, settings.seed)
    height, width = gbuffer.shape
    result = np.zeros((height * width, channels), np.float32)

    def batch(texels: NDArray[np.int64]) -> None:
        origin, normal = starting_points(gbuffer, atlas, asset, scene.frame, texels, inwards=inwards)
        axis = -normal if inwards else normal
        direction = cosine_directions(patterns, pattern_of(gbuffer.image_texels(texels), gbuffer.page.width), axis)
        result[texels] = estimate.kernel(scene, origin, direction, normal)

    in_batches(batch, gbuffer.texels, max(BATCH // settings.count, 1), settings.progress)
    return result.reshape(height, width, channels)


def _per_ray(origin: NDArray[np.float32], direction: NDArray[np.float32]) -> NDArray[np.float32]:
    """(t · s, 3): the origin of each ray."""
    return np.array(np.broadcast_to(origin[:, None], direction.shape), order="C").reshape(-1, 3)


def _reach(direction: NDArray[np.float32], distance: float) -> NDArray[np.float32] | None:
    """(t · s,) distance in lengths of each direction; None when there is no limit."""
    if not np.isfinite(distance):
        return None
    return (distance / np.maximum(_length(direction), 1e-12)).reshape(-1).astype(np.float32)


def _length(vector: NDArray[np.float32]) -> NDArray[np.float32]:
    """(…,) lengths of (…, 3)."""
    return np.sqrt(np.einsum("...i,...i->...", vector, vector))


def _unit_or(vector: NDArray[np.float32], instead: NDArray[np.float32]) -> NDArray[np.float32]:
    """(t, 3) vectors at length 1; where they vanish, the others."""
    length = _length(vector)[:, None]
    return np.where(length > 1e-12, vector / np.maximum(length, 1e-12), instead).astype(np.float32)

"""The numbers behind baked maps that no option sets.  They are saved with every result, beside the options."""

from __future__ import annotations

from dataclasses import dataclass, field

from .highpoly import cage, highpoly
from .maps import curvature, occlusion, resample
from .raster import background, gbuffer, gutter
from .seams import seamcheck
from .seams.closing import ClosingConfig


@dataclass(frozen=True)
class BakeConfig:
    """What decides a baked texel beside the options; each stands where it is used, with its unit and its reason.

    closing: how seams are closed.  seam_*: where seams are, and how densely they are looked at.
    border_reach: texels around charts that are evaluated at the nearest border point.
    gutter_exact, background_cells: where the whole image is filled, how far exactly, and on how many cells beyond.
    curvature_*: rounds of averaging, and the radius shown at 3/4, in radii of the mesh.
    ray_offset: start of rays off the surface, in radii.  texture_*: how source textures are sampled.
    high_layers, high_step, cage_shortest: faces seen from behind that a ray passes, and its least steps, in radii.
    """

    closing: ClosingConfig = field(default_factory=ClosingConfig)
    seam_samples_per_texel: float = seamcheck.PER_TEXEL
    seam_smooth: float = seamcheck.SMOOTH
    seam_weld: float = seamcheck.WELD
    border_reach: float = gbuffer.REACH
    gutter_exact: int = gutter.LEAST_NEAR
    background_cells: int = background.MOST_CELLS
    curvature_rounds: int = curvature.ROUNDS
    curvature_radius: float = curvature.RADIUS
    ray_offset: float = occlusion.OFFSET
    texture_grid: int = resample.MOST
    texture_sharpening: float = resample.SHARPEN
    texture_rounding: float = resample.ROUNDING
    high_layers: int = highpoly.LAYERS
    high_step: float = highpoly.STEP
    cage_shortest: float = cage.SHORTEST

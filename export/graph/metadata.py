"""Collects what an exported file says about itself (runtime/sessions/bundle.py holds the format).

k charts · p patches.  Frame and placement in the units of the source file, size and padding in texels.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import __version__
from ...runtime.errors import InputError, ShapeError
from ...runtime.sessions.bundle import BundleMetadata, nested_placement

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ...runtime.mesh import Atlas, Charts, Frame

PRODUCER = "flexpara"


@dataclass(frozen=True)
class Provenance:
    """Where a map comes from: what goes into the file besides geometry and weights.

    source_sha256: Asset.sha256.  settings: the training configuration.  metrics: distortion, fit, packing.
    Both are JSON objects.  Leave times, dates and paths out of them: the same map then gives the same bytes.
    """

    source_sha256: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict[str, Any])
    metrics: Mapping[str, Any] = field(default_factory=dict[str, Any])


@dataclass(frozen=True, eq=False)
class PlacedCharts:
    """Finished charts between the surface and the atlas: all geometry that a file folds in.

    frame: source units → unit ball.  atlas: of pack(); its placement must be set, its positions or uv serve as probes.
    charts: those of the atlas.
    """

    frame: Frame
    atlas: Atlas
    charts: Charts


def bundle_metadata(placed: PlacedCharts, provenance: Provenance) -> BundleMetadata:
    """Metadata of one export.

    Raises:
        InputError: the atlas has no placement, or frame or placement are not finite.
        ShapeError: placement is not (k, 2, 3), or patch_chart names a chart that it does not place.
    """
    frame, atlas = placed.frame, placed.atlas
    placement = _checked_placement(atlas)
    count = len(placement)
    patches = placed.charts.patch_chart
    if patches.ndim != 1 or len(patches) == 0 or patches.min() < 0 or patches.max() >= count:
        found = f"patch_chart of shape {patches.shape} with values {np.unique(patches)[:8].tolist()}"
        raise ShapeError(f"{found}, expected (p,) indices in [0, {count}); pack these charts and pass that atlas")
    limits = np.finfo(np.float32)
    if not (np.isfinite(frame.centre).all() and float(limits.tiny) < frame.scale < float(limits.max)):
        raise InputError(f"{frame}, expected finite numbers and a float32 scale above 0; rescale the surface")
    return BundleMetadata(
        chart_count=count,
        patch_count=len(patches),
        frame=frame,
        placement=nested_placement(placement),
        patch_chart=tuple(patches.tolist()),
        size=atlas.size,
        padding=atlas.padding,
        source_sha256=provenance.source_sha256,
        settings=provenance.settings,
        metrics=provenance.metrics,
        producer_name=PRODUCER,
        producer_version=__version__,
    )


def _checked_placement(atlas: Atlas) -> NDArray[np.float64]:
    """(k, 2, 3) float64, finite."""
    placement = atlas.placement
    if placement is None:
        raise InputError("the atlas has no placement, expected one that pack() made of these charts; pack them first")
    if placement.ndim != 3 or placement.shape[1:] != (2, 3) or len(placement) == 0:
        raise ShapeError(f"placement of shape {placement.shape}, expected (k, 2, 3); pass the atlas of pack()")
    if not np.isfinite(placement).all():
        raise InputError("the placement is not finite, expected finite numbers; pack the charts again")
    return placement

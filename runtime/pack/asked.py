"""Packing as it is asked for: in one square, congruent charts on each other where that is wanted.

f faces · k charts.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..mesh import Charts, Surface
from .density import pack_square
from .exact.lattice import STEPS
from .growing.outlines import chart_outlines, outline_edges
from .packing import Packed, atlas_of_corners
from .sheet import on_lattice
from .stacking import Stacks, find_stacks

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..mesh import Asset
    from .config import PackConfig
    from .square import Square


def pack_asked(asset: Asset, charts: Charts, square: Square, seed: int = 0, config: PackConfig | None = None) -> Packed:
    """Charts in a square, stacked where that is asked for: `stacked` of the report counts those that lie on others.

    Raises: as `pack_square`.
    """
    config = square.config(config)
    if config.stack == "off":
        return pack_square(asset, charts, square, seed, config)
    outlines = chart_outlines(charts, outline_edges(asset.surface.faces, charts))
    stacks = find_stacks(charts, outlines, config.stacks, mirrored=config.stack == "mirrored")
    lowest = np.flatnonzero(stacks.layer == 0)
    beneath = np.flatnonzero(np.isin(charts.face_chart, lowest))
    below = pack_square(faces_of(asset, beneath), some_charts(charts, beneath), square, seed, config)
    return _with_layers(asset, charts, stacks, below, config)


def faces_of(asset: Asset, faces: NDArray[np.int64]) -> Asset:
    """The mesh with some of its faces, in their order."""
    surface = Surface(asset.surface.vertices, asset.surface.faces[faces])
    return replace(asset, faces=asset.faces[faces], surface=surface, polygons=None)


def some_charts(charts: Charts, faces: NDArray[np.int64]) -> Charts:
    """The charts of some faces, whole ones, numbered anew in their order; without what answers for them."""
    kept, chart = np.unique(charts.face_chart[faces], return_inverse=True)
    methods = tuple(charts.method[number] for number in kept.tolist())
    return Charts(chart, charts.corner_uv[faces], chart, np.arange(len(kept)), methods)


def _with_layers(asset: Asset, charts: Charts, stacks: Stacks, below: Packed, config: PackConfig) -> Packed:
    """All charts, each where the one is on which it lies; every layer proven for itself."""
    assert below.atlas.placement is not None
    lowest, of_face = np.flatnonzero(stacks.layer == 0), stacks.layer[charts.face_chart]
    place = below.atlas.placement[np.searchsorted(lowest, stacks.on)]
    placement = np.concatenate([place[:, :, :2] @ stacks.motion[:, :, :2], place[:, :, 2:]], axis=2)
    placement[:, :, 2] += np.einsum("kij,kj->ki", place[:, :, :2], stacks.motion[:, :, 2])
    corner_uv = np.zeros((len(asset.faces), 3, 2), dtype=np.float32)
    corner_uv[of_face == 0] = below.atlas.uv[below.atlas.faces]
    invalid = [lowest[below.invalid]]
    for layer in range(1, int(stacks.layer.max(initial=0)) + 1):
        faces = np.flatnonzero(of_face == layer)
        part, mesh = some_charts(charts, faces), asset.surface.faces[faces]
        own = np.unique(charts.face_chart[faces])
        points, snapped = on_lattice(mesh, part, outline_edges(mesh, part), placement[own], config)
        corner_uv[faces] = (snapped.points / STEPS)[points]
        invalid.append(own[snapped.invalid])
    atlas = atlas_of_corners(asset, charts.face_chart, corner_uv, below.atlas)
    found = np.sort(np.concatenate(invalid))
    report = {**below.report, "stacked": len(charts.method) - len(lowest), "invalid_charts": found.tolist()}
    longest = report["longest_chart"]
    report["longest_chart"] = int(lowest[longest])
    return Packed(replace(atlas, placement=placement, stack=stacks.on), found, report)

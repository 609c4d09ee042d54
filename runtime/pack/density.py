"""Packing at a texel density that is asked for: the same on several meshes, whatever their atlases could hold.

Density: texels per unit of length of the source.  Charts that don't need the whole atlas for it fill a part of it, from
the lower left corner.
"""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from typing import TYPE_CHECKING

from ..errors import InputError
from .config import PackConfig
from .exact.lattice import STEPS
from .growing.outlines import chart_outlines, outline_edges
from .layouts.texels import aligned
from .packing import Packed, as_atlas, pack
from .sheet import Fitted, in_uv, on_lattice

if TYPE_CHECKING:
    from ..mesh import Asset, Charts
    from ..pagesize import PageSize
    from .square import Square


ALIKE = 1e-9
"""Share by which densities may differ and count as one: sums in another order round in another way."""


def pack_square(
    asset: Asset, charts: Charts, square: Square, seed: int = 0, config: PackConfig | None = None
) -> Packed:
    """As ``packing.pack``, at the density asked for, with the padding that such charts get.

    Raises: as `pack`; InputError where the atlas is too small for that density.
    """
    own = square.of(asset.surface.faces, charts)
    found = _at_density(asset, charts, own, seed, config or PackConfig())
    return replace(found, report={**found.report, **square.spared(own)})


def _at_density(asset: Asset, charts: Charts, square: Square, seed: int, config: PackConfig) -> Packed:
    loose = config if square.texel_density is None else replace(config, whole_texels=False)
    packed = pack(asset, charts, size=square.page, padding=square.padding, seed=seed, config=loose)
    if square.texel_density is None:
        return packed
    most = packed.report["chart_scale"] * square.page.side
    wanted = square.texel_density
    if wanted > (1.0 + ALIKE) * most:
        size = square.page.times(2 ** math.ceil(math.log2(wanted / most))).stored
        raise InputError(
            f"texel-density is {wanted:g}, expected at most {most:.4g} in {square.size} texels; pass --size {size} or "
            "a lower density"
        )
    wanted = min(wanted, most)
    found = _filled_part(asset, charts, square._replace(texel_density=wanted), packed, seed, loose)
    return _shrunk(asset, charts, square, found, wanted / (found.report["chart_scale"] * square.page.side), config)


def _filled_part(asset: Asset, charts: Charts, square: Square, whole: Packed, seed: int, config: PackConfig) -> Packed:
    """The charts in the smallest atlas in which they reach the density asked for.

    whole: them in the whole atlas.  They have a texel more of padding, which shrinking to that very density may take.
    """
    wanted, low, high, best = square.texel_density or 0.0, 0.0, float(square.page.side), whole
    dense = {0.0: 0.0, high: whole.report["chart_scale"] * square.page.side}
    for _ in range(config.density.tries):
        if best is not whole and wanted * (square.padding + 1) >= dense[high] * square.padding:
            break
        share = (wanted * config.density.more - dense[low]) / (dense[high] - dense[low])
        side = float(round(low + min(max(share, 0.1), 0.9) * (high - low)))
        if not low < side < high:
            break
        smaller = square.page.times(side / square.page.side)
        found = _reached(asset, charts, smaller, square.padding + 1, seed, config)
        dense[side] = 0.0 if found is None else found.report["chart_scale"] * side
        low, high, best = (side, high, best) if found is None or dense[side] < wanted else (low, side, found)
    return best


def _reached(
    asset: Asset, charts: Charts, page: PageSize, padding: int, seed: int, config: PackConfig
) -> Packed | None:
    """The charts in an atlas of that size, None where the padding leaves no room for them."""
    try:
        return pack(asset, charts, size=page, padding=padding, seed=seed, config=config)
    except InputError:
        return None


def _shrunk(asset: Asset, charts: Charts, square: Square, found: Packed, factor: float, config: PackConfig) -> Packed:
    """The charts of an atlas as a part of another: lengths on its page × factor, which is at most 1."""
    assert found.atlas.placement is not None
    page, edges = square.page, outline_edges(asset.surface.faces, charts)
    placement = found.atlas.placement * found.atlas.page.extent[:, None] * factor
    placed = aligned(in_uv(placement, page), chart_outlines(charts, edges), page, config)
    faces, snapped = on_lattice(asset.surface.faces, charts, edges, placed, config)
    fitted = Fitted(placement, placed, found.report["skipped_growth_steps"], snapped, faces, 0.0)
    atlas = as_atlas(asset, charts, fitted, page, square.padding)
    report = {**found.report, "settings": asdict(config), "invalid_charts": snapped.invalid.tolist()}
    report |= {"padding": square.padding, "chart_scale": found.report["chart_scale"] * factor}
    report |= {"moved_vertices": snapped.moved, "moved_farthest": snapped.farthest / STEPS}
    return Packed(atlas, snapped.invalid, report)

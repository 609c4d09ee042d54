"""An unwrapped mesh on several pages of one texel density, each with the networks of its own charts.

f faces.  Charts are found once, over the whole mesh; pages share them out, and each is packed, fitted and exported.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..runtime.io.asset.pages import pages_of, part_of
from ..runtime.mesh import Surface
from ..runtime.pack.asked import some_charts
from ..runtime.pack.pages import pack_pages
from ..runtime.pack.room import demand_room_for_parts
from ..runtime.pack.square import square_of
from ..train.deploy.fit import fit_networks
from ..train.fromjson import fit_in_force
from ..train.presets import train_asset
from ..train.workers import Beside
from .assemble import Unwrapped, assemble

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..runtime.mesh import Asset
    from ..runtime.options.unwrap import Options
    from ..runtime.pack.square import Square
    from ..runtime.process.progress import Clock
    from ..train.pipeline import Trained


class Pages(NamedTuple):
    """Each page as a mesh of its own with what came of it, and the page (f,) of each face of the whole.

    page: None where pages are meshes or materials.
    """

    results: list[tuple[Asset, Unwrapped]]
    page: NDArray[np.int64] | None = None


def unwrapped_pages(asset: Asset, options: Options, clock: Clock) -> Pages:
    """The pages that options ask for: meshes, materials or so many, each with what came of it.

    asset: with a document where meshes or materials are asked for, shaded.  Raises: as `train_asset` and `assemble`.
    """
    square = square_of(options)
    if options.paged:
        demand_room_for_parts(asset.surface, options)
        return assemble_pages(asset, train_asset(asset, options, clock), clock, square, options.pages)
    parts = pages_of(asset, options.atlas)
    for part in parts:
        demand_room_for_parts(part.surface, options)
    return Pages([(part, assemble(part, train_asset(part, options, clock), clock, square)) for part in parts])


def assemble_pages(asset: Asset, trained: Trained, clock: Clock, square: Square, count: int) -> Pages:
    """Each page that got charts: a mesh of its own, STEM_1, STEM_2, …, and what `assemble` makes of it.

    Raises: as `assemble`.
    """
    trained.fitted.end()  # of all pages in one
    seed, fit = trained.settings["seed"], fit_in_force(trained.settings)
    with clock.stage("pack"):
        paged = pack_pages(asset, trained.charts, square, count, seed)
    density = paged.report["chart_scale"] * square.page.side
    even = square._replace(texel_density=density, padding=paged.report["padding"], spares=False)
    found: list[tuple[Asset, Unwrapped]] = []
    for number in np.unique(paged.page).tolist():
        own = paged.page == number
        page = part_of(asset, own, f"{asset.stem}_{number + 1}")
        charts = some_charts(trained.charts, np.flatnonzero(own))
        ball = Surface(trained.frame.apply(page.surface.vertices), page.surface.faces)
        fitted = Beside(partial(fit_networks, ball, charts, fit, seed))
        found.append((page, assemble(page, replace(trained, charts=charts, fitted=fitted), clock, even)))
    return Pages(found, np.unique(paged.page, return_inverse=True)[1].reshape(-1))

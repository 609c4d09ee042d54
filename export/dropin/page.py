"""What stands behind `flexpara.xatlas`: arrays → charts → one packed page → arrays, whatever the arrays hold.

n vertices · f faces, as they were handed over.  A face that is no triangle (repeated corners, no area, not finite) is
left out of the charts and comes back as a point of the atlas, so that face i stays face i.
"""

from __future__ import annotations

import logging
import math
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.errors import FinishError, InputError, MeshError
from ...runtime.geometry.metrics import uv_charts
from ...runtime.geometry.triangles import signed_areas
from ...runtime.io.clean.clean import clean
from ...runtime.io.rawmesh import LARGEST_DIAGONAL, RawMesh
from ...runtime.mesh import Asset, Charts, Frame, Surface
from ...runtime.pack.config import PackConfig
from ...runtime.pack.packing import Packed, pack
from ...runtime.process.deadline import Deadline
from ...runtime.process.progress import Stages
from ...train.charts.charts import Finished, chart_surface
from ...train.charts.recut import drawn_again
from ...train.config import FinishConfig
from ...train.finish.projected import projected
from ...train.pipeline import as_charts
from .budget import BudgetConfig
from .meshes import Part, Placed, handed_back

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

LOG = logging.getLogger("flexpara.xatlas")


@dataclass(frozen=True)
class PageConfig:
    """How a page is found that holds what is asked for."""

    side: int = 1024
    """Texels of its side where none are asked for."""
    largest: int = 16384
    """Texels of its side at most."""
    dense: float = 1.02
    """Factor on the side that should just hold a texel density, whose padding weighs less on a larger page."""


class Wanted(NamedTuple):
    """Texels of the side and texels per unit, 0 for as it comes; texels of padding."""

    resolution: int
    texels_per_unit: float
    padding: int


class Page(NamedTuple):
    """The packed page: texels of its side, texels per unit, share that charts cover, number of charts, meshes."""

    side: int
    texels_per_unit: float
    utilization: float
    charts: int
    meshes: list[Placed]


class Waiting(NamedTuple):
    """A mesh that was handed over: the number of its faces, and how it becomes a part by a deadline."""

    faces: int
    part: Callable[[Deadline], Part]


def parts_in_time(waiting: Sequence[Waiting], budget: float | None) -> list[Part]:
    """Each mesh charted within its share, by faces, of what is left of a budget in seconds; None is no limit.

    What packing the meshes before it will take is none of its share.
    """
    start, done, left, parts = time.monotonic(), 0, sum(mesh.faces for mesh in waiting), list[Part]()
    packing = BudgetConfig().packing
    for mesh in waiting:
        seconds = None
        if budget is not None:
            unspent = budget - (time.monotonic() - start) - packing * done
            seconds = max(unspent, 0.0) * mesh.faces / max(left, 1)
        parts.append(mesh.part(Deadline(seconds)))
        left, done = left - mesh.faces, done + mesh.faces
    return parts


def surface_part(
    positions: NDArray[np.float64], faces: NDArray[np.int64], charts: int, seed: int, deadline: Deadline
) -> Part:
    """A mesh with positions (n, 3) and its charts."""
    with np.errstate(invalid="ignore"):
        fine = np.asarray((np.abs(positions) < LARGEST_DIAGONAL).all(axis=1))
    kept = np.flatnonzero(fine[faces].all(axis=1))
    origin = np.arange(len(positions))
    raw = RawMesh(np.where(fine[:, None], positions, 0.0), faces[kept], face_material=kept, origin=origin)
    start = time.monotonic()
    try:
        asset = clean(raw) if len(kept) else None
    except MeshError as error:
        LOG.warning("%s: its faces become points", error)
        asset = None
    if asset is None:
        return Part(len(positions), faces, None, None)
    pace = BudgetConfig().pace(len(kept), time.monotonic() - start)
    return Part(len(positions), faces, asset, charted(asset.surface, charts, seed, deadline, pace), pace)


def charted(surface: Surface, charts: int, seed: int, deadline: Deadline, pace: float = 1.0) -> Charts:
    """Charts of a welded surface, in its units; projections where our own were refused, which is logged.

    pace: how many times as long as foreseen things take.
    """
    config = FinishConfig()
    config = replace(config, haste=replace(config.haste.at_pace(pace), strict=True))
    frame = Frame.of(surface.vertices)
    ball = Surface(frame.apply(surface.vertices), surface.faces)
    try:
        finished = chart_surface(ball, charts, config, seed, Stages(deadline=deadline))
    except FinishError as error:
        LOG.warning("charts by projection: %s", error)
        pieces = projected(ball, np.arange(len(ball.faces)), float(ball.face_areas().sum()), config.project)
        finished = Finished(pieces, math.inf, {}, ())
    found = as_charts(ball, finished)
    return replace(found, corner_uv=found.corner_uv * frame.scale)


def uv_part(uv: NDArray[np.float64], faces: NDArray[np.int64], materials: NDArray[np.int64]) -> Part:
    """A layout uv (n, 2) with the charts it has: faces joined in it, of one material (f,); mirrored ones are turned."""
    fine = np.asarray(np.isfinite(uv).all(axis=1))
    area = np.where(fine[faces].all(axis=1), signed_areas(np.where(fine[:, None], uv, 0.0)[faces]), 0.0)
    kept = np.flatnonzero(area != 0.0)
    if len(kept) == 0:
        return Part(len(uv), faces, None, None)
    used, own = np.unique(faces[kept], return_inverse=True)
    own = own.reshape(-1, 3)
    flat, weld = np.unique(uv[used], axis=0, return_inverse=True)
    weld, corner_uv = weld.reshape(-1), uv[faces[kept]]
    chart, _ = uv_charts(weld[own], corner_uv)
    pair = np.stack([chart, materials[kept], area[kept] < 0.0], axis=1)
    chart = np.unique(pair, axis=0, return_inverse=True)[1].reshape(-1)
    corner_uv = np.where((area[kept] < 0.0)[:, None, None], corner_uv * [-1.0, 1.0], corner_uv)
    surface = Surface(np.pad(flat, ((0, 0), (0, 1))), weld[own])
    points = np.pad(uv[used], ((0, 0), (0, 1)))
    asset = Asset(points, own, weld, surface, face_material=kept, origin=used)
    number = np.arange(int(chart.max()) + 1)
    return Part(len(uv), faces, asset, Charts(chart, corner_uv, chart, number, ("uv",) * len(number)))


def joined(assets: list[Asset], charts: list[Charts]) -> tuple[Asset, Charts]:
    """Several meshes as one, in their order: their vertices and charts stay apart."""
    start = np.cumsum([0, *(len(asset.positions) for asset in assets)])
    welded = np.cumsum([0, *(len(asset.surface.vertices) for asset in assets)])
    first = np.cumsum([0, *(len(found.method) for found in charts)])
    faces = np.concatenate([asset.faces + begin for asset, begin in zip(assets, start, strict=False)])
    weld = np.concatenate([asset.weld + begin for asset, begin in zip(assets, welded, strict=False)])
    vertices = np.concatenate([asset.surface.vertices for asset in assets])
    chart = np.concatenate([found.face_chart + begin for found, begin in zip(charts, first, strict=False)])
    corner_uv = np.concatenate([found.corner_uv for found in charts])
    method = tuple(name for found in charts for name in found.method)
    whole = Asset(np.concatenate([asset.positions for asset in assets]), faces, weld, Surface(vertices, weld[faces]))
    return whole, Charts(chart, corner_uv, chart, np.arange(len(method)), method)


def packed_page(
    parts: list[Part], wanted: Wanted, seed: int, deadline: Deadline, config: PageConfig = PageConfig()
) -> Page:
    """All meshes on one page, at one texel density; a page without side where nothing can be charted.

    Charts lie in rows where the deadline is too near for anything better.
    """
    assets = [part.asset for part in parts if part.asset is not None]
    if not assets:
        nothing = np.zeros((0, 3, 2)), np.zeros(0, dtype=np.int64)
        return Page(0, 0.0, 0.0, 0, [handed_back(part, *nothing) for part in parts])
    asset, charts = joined(assets, [part.charts for part in parts if part.charts is not None])
    packing = Packing(asset, seed, deadline, max(part.pace for part in parts))
    packed, charts, side = packing.on_page(charts, wanted, config)
    area = float(np.abs(signed_areas(packed.atlas.corner_uv)).sum())
    meshes, face = [], 0
    for part in parts:
        placed = np.zeros((0, 3, 2)), np.zeros(0, dtype=np.int64)
        if part.asset is not None:
            own = slice(face, face + len(part.asset.faces))
            placed = packed.atlas.corner_uv[own], packed.atlas.face_chart[own]
            face = own.stop
        meshes.append(handed_back(part, *placed))
    return Page(side, packed.report["chart_scale"] * side, area, len(charts.method), meshes)


class Packing(NamedTuple):
    """What charts of a mesh are packed by; pace: how many times as long as foreseen things take."""

    asset: Asset
    seed: int
    deadline: Deadline
    pace: float
    budget: BudgetConfig = BudgetConfig()

    def on_page(self, charts: Charts, wanted: Wanted, config: PageConfig) -> tuple[Packed, Charts, int]:
        """The charts on a page of the side asked for; on a larger one where padding or texel density want it."""
        side = min(wanted.resolution or config.side, config.largest)
        while True:
            try:
                packed, charts = self.valid(charts, side, wanted.padding)
            except InputError:
                if side >= config.largest:
                    raise
                LOG.warning("%d texels leave no room for %d of padding: %d", side, wanted.padding, 2 * side)
                side = min(2 * side, config.largest)
                continue
            density = packed.report["chart_scale"] * side
            needed = math.ceil(config.dense * side * wanted.texels_per_unit / density)
            if wanted.resolution or not wanted.texels_per_unit or abs(needed - side) <= 0.02 * side:
                break
            if side == (side := min(max(needed, 1), config.largest)):
                break
            wanted = wanted._replace(resolution=side)
        if density < wanted.texels_per_unit:
            text = "%g texels per unit on one page of %d, fewer than the %g asked for"
            LOG.warning(text, density, side, wanted.texels_per_unit)
        return packed, charts, side

    def valid(self, charts: Charts, side: int, padding: int) -> tuple[Packed, Charts]:
        """The charts packed, those that float32 can't hold drawn again; layouts of others stay as they are."""
        packed, recuts = self.packed(charts, side, padding), PackConfig().recuts
        for _ in range(recuts):
            if len(packed.invalid) == 0 or "uv" in charts.method:
                break
            least, written = PackConfig().least_edge, packed.atlas.corner_uv
            charts = drawn_again(self.asset.surface, charts, packed.invalid, written, least)[0]
            packed = self.packed(charts, side, padding)
        if len(packed.invalid):
            LOG.warning("%d charts hold triangles that overlap or lie upside down", len(packed.invalid))
        return packed, charts

    def packed(self, charts: Charts, side: int, padding: int) -> Packed:
        """The charts close together, or in rows where there is no time for that."""
        needed = self.pace * self.budget.packs(len(self.asset.faces), len(charts.method))
        config = PackConfig(hurried=self.deadline.passed(needed))
        return pack(self.asset, charts, size=side, padding=padding, seed=self.seed, config=config)

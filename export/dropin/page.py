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
from ...runtime.geometry.rows import by_first_appearance, equal_rows, first_of_each
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
from ...train.finish.config import ProjectConfig
from ...train.finish.projected import projected
from ...train.pipeline import as_charts

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

LOG = logging.getLogger("flexpara.xatlas")
NOWHERE = 2**32 - 1
"""Chart of a vertex that is in none."""


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


class Part(NamedTuple):
    """A mesh as handed over: the number of its vertices, its faces (f, 3), and what can be charted of it.

    asset: its origin and face_material are the vertex (of n) and the face (of f) that each of its own is, or None.
    """

    vertices: int
    faces: NDArray[np.int64]
    asset: Asset | None
    charts: Charts | None


class Page(NamedTuple):
    """The packed page: texels of its side, texels per unit, share that charts cover, number of charts, meshes."""

    side: int
    texels_per_unit: float
    utilization: float
    charts: int
    meshes: list[Placed]


class Placed(NamedTuple):
    """A mesh of a page: mapping (m,), faces (f, 3), uv (m, 2) in [0, 1]²; chart of faces (f,), −1 for none."""

    mapping: NDArray[np.uint32]
    faces: NDArray[np.uint32]
    uv: NDArray[np.float32]
    face_chart: NDArray[np.int64]

    def vertex_chart(self) -> NDArray[np.uint32]:
        """(m,) the chart of each vertex, NOWHERE for none."""
        chart = np.full(len(self.mapping), -1, dtype=np.int64)
        np.maximum.at(chart, self.faces.reshape(-1), np.repeat(self.face_chart, 3))
        return np.where(chart < 0, NOWHERE, chart).astype(np.uint32)


class Waiting(NamedTuple):
    """A mesh that was handed over: the number of its faces, and how it becomes a part by a deadline."""

    faces: int
    part: Callable[[Deadline], Part]


def parts_in_time(waiting: Sequence[Waiting], budget: float | None) -> list[Part]:
    """Each mesh charted within its share, by faces, of what is left of a budget in seconds; None is no limit."""
    start, left, parts = time.monotonic(), sum(mesh.faces for mesh in waiting), list[Part]()
    for mesh in waiting:
        seconds = None
        if budget is not None:
            seconds = max(budget - (time.monotonic() - start), 0.0) * mesh.faces / max(left, 1)
        parts.append(mesh.part(Deadline(seconds)))
        left -= mesh.faces
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
    try:
        asset = clean(raw) if len(kept) else None
    except MeshError as error:
        LOG.warning("%s: its faces become points", error)
        asset = None
    if asset is None:
        return Part(len(positions), faces, None, None)
    return Part(len(positions), faces, asset, charted(asset.surface, charts, seed, deadline))


def charted(surface: Surface, charts: int, seed: int, deadline: Deadline) -> Charts:
    """Charts of a welded surface, in its units; projections where our own were refused, which is logged."""
    frame = Frame.of(surface.vertices)
    ball = Surface(frame.apply(surface.vertices), surface.faces)
    try:
        finished = chart_surface(ball, charts, FinishConfig(), seed, Stages(deadline=deadline))
    except FinishError as error:
        LOG.warning("charts by projection: %s", error)
        pieces = projected(ball, np.arange(len(ball.faces)), float(ball.face_areas().sum()), ProjectConfig())
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


def packed_page(parts: list[Part], wanted: Wanted, seed: int, config: PageConfig = PageConfig()) -> Page:
    """All meshes on one page, at one texel density; a page without side where nothing can be charted."""
    assets = [part.asset for part in parts if part.asset is not None]
    if not assets:
        nothing = np.zeros((0, 3, 2)), np.zeros(0, dtype=np.int64)
        return Page(0, 0.0, 0.0, 0, [handed_back(part, *nothing) for part in parts])
    asset, charts = joined(assets, [part.charts for part in parts if part.charts is not None])
    packed, charts, side = _in_page(asset, charts, wanted, seed, config)
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


def _in_page(asset: Asset, charts: Charts, wanted: Wanted, seed: int, config: PageConfig) -> tuple[Packed, Charts, int]:
    """The charts on a page of the side asked for; on a larger one where padding or texel density want it."""
    side = min(wanted.resolution or config.side, config.largest)
    while True:
        try:
            packed, charts = _valid(asset, charts, side, wanted.padding, seed)
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
        LOG.warning("%g texels per unit on one page of %d, fewer than the %g asked for", density, side, wanted[1])
    return packed, charts, side


def _valid(asset: Asset, charts: Charts, side: int, padding: int, seed: int) -> tuple[Packed, Charts]:
    """The charts packed, those that float32 can't hold drawn again; layouts of others stay as they are."""
    config = PackConfig()
    packed = pack(asset, charts, size=side, padding=padding, seed=seed, config=config)
    for _ in range(config.recuts):
        if len(packed.invalid) == 0 or "uv" in charts.method:
            break
        charts = drawn_again(asset.surface, charts, packed.invalid, packed.atlas.corner_uv, config.least_edge)[0]
        packed = pack(asset, charts, size=side, padding=padding, seed=seed, config=config)
    if len(packed.invalid):
        LOG.warning("%d charts hold triangles that overlap or lie upside down", len(packed.invalid))
    return packed, charts


def handed_back(part: Part, corner_uv: NDArray[np.float64], chart: NDArray[np.int64]) -> Placed:
    """The mesh as it was handed over, its vertices doubled along seams; corner_uv (m, 3, 2) of the faces charted."""
    uv, face_chart = np.zeros((len(part.faces), 3, 2)), np.full(len(part.faces), -1)
    if len(part.faces) == 0:
        return Placed(np.zeros(0, np.uint32), np.zeros((0, 3), np.uint32), np.zeros((0, 2), np.float32), face_chart)
    if part.asset is not None and part.asset.face_material is not None and part.asset.origin is not None:
        kept, corner = part.asset.face_material, part.asset.origin[part.asset.faces]
        turned = corner[:, 1] != part.faces[kept, 1]
        uv[kept] = np.where(turned[:, None, None], corner_uv[:, [0, 2, 1]], corner_uv)
        face_chart[kept] = chart
        left_out = np.flatnonzero(face_chart < 0)
        uv[left_out] = _points(part, uv, kept, left_out)[:, None]
    bits = uv.astype(np.float32).view(np.int32).reshape(-1, 2).astype(np.int64)
    label = by_first_appearance(equal_rows(np.column_stack([part.faces.reshape(-1), bits])))
    first = first_of_each(label)
    return Placed(
        part.faces.reshape(-1)[first].astype(np.uint32),
        label.reshape(-1, 3).astype(np.uint32),
        uv.reshape(-1, 2)[first].astype(np.float32),
        face_chart,
    )


def _points(
    part: Part, uv: NDArray[np.float64], kept: NDArray[np.int64], left_out: NDArray[np.int64]
) -> NDArray[np.float64]:
    """(d, 2) where each face that is no triangle lies: at one of its vertices, (0, 0) where none is charted."""
    place, known = np.zeros((part.vertices, 2)), np.zeros(part.vertices, dtype=np.bool_)
    place[part.faces[kept]] = uv[kept]
    known[part.faces[kept]] = True
    corners = part.faces[left_out]
    chosen = corners[np.arange(len(corners)), np.argmax(known[corners], axis=1)]
    return place[chosen]

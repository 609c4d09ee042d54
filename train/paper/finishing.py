"""From a learned global map to valid charts, one per connected component.   f faces · v vertices · unit ball.

Valid means: no flipped triangle, no overlap, by exact tests.  Each component is opened along its learned seam, slit
where a disk cannot carry it without stretch (slits lie inside the chart, and are found on a proxy), and
flattened: from the network's own uv where those are valid once the band is laid out anew, or from the circle.
Conformal energy spreads that out, SLIM lowers the symmetric Dirichlet energy, contacts hold apart what would overlap,
and a few last steps of conformal energy trade a little area for angles, which is what the paper's losses ask for.

A disk always has a valid map to the circle, so one chart fails only where a triangle is too thin for float64; then the
faces are split as everywhere else, and the report says so.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import igl
import numpy as np

from ...runtime.errors import ShapeError
from ...runtime.geometry.overlap import flipped_triangles
from ...runtime.geometry.rows import grouped
from ...runtime.geometry.topology import boundary_loops, edge_table, split_non_manifold_vertices
from ...runtime.geometry.triangles import signed_areas
from ...runtime.mesh import Surface
from ..carry.proxy import simplified
from ..charts.charts import Finished
from ..charts.proof import verify
from ..config import FinishConfig
from ..finish.contact import Relaxed, excess_energy, is_valid, relax
from ..finish.disks import cut_open
from ..finish.flatten import circle_map
from ..finish.openings import slit_along
from ..finish.pieces import Piece, border_length
from ..finish.slits import Flat, Slit, slit_where_it_pays
from ..search.labels import connected_pieces, dual_graph
from ..search.search import Search
from ..workers import parallel_map
from .conformal import ConformalConfig, conformal_steps
from .learnedseams import SeamConfig, seam_edges, tears

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ..search.labels import DualGraph


@dataclass(frozen=True)
class GlobalFinishConfig:
    """Numbers of finishing a global map."""

    seam: SeamConfig = field(default_factory=SeamConfig)
    """From the band to seam edges."""
    finish: FinishConfig = field(default_factory=FinishConfig)
    """Flattening and slits, as for charts."""
    proxy_faces: int = 5000
    """Faces of the simplified disk on which slits are tried."""
    slits: int = 24
    """Slits a component may get: one chart has to do what eight do elsewhere."""
    failures: int = 6
    """Slits that may fail to pay before the component is left as it is."""
    loosened: int = 6
    """Rounds in which flips of the learned uv are let go with their neighbours and laid out anew."""
    kept: float = 0.25
    """Share of the vertices that must keep their learned uv; with less, that start is given up."""
    steps: int = 30
    """Steps of SLIM with contacts, where the chart would overlap: long cuts need more of them than slits do."""
    conformal: ConformalConfig = field(default_factory=ConformalConfig)
    """Angles for areas, before and after the isometric steps."""


class LearnedDisk(NamedTuple):
    """A component opened into a disk.  Faces are in the component's order.

    surface: the disk.  uv (v, 2): learned, both sides of a cut with their vertex's.  torn (f,) bool: in the band.
    """

    surface: Surface
    uv: NDArray[np.float64]
    torn: NDArray[np.bool_]


class GlobalFinish(NamedTuple):
    """finished: valid charts.  components: per component, JSON-ready facts about its seam and flattening."""

    finished: Finished
    components: list[dict[str, Any]]


def finish_global(
    surface: Surface,
    uv: NDArray[np.float64],
    stage: Callable[[str], None],
    config: GlobalFinishConfig = GlobalFinishConfig(),
) -> GlobalFinish:
    """Valid charts of a surface from one learned map: one per connected component, more only where that can't be had.

    Args:
        surface: in the unit ball; edges that are not manifold are cut.
        uv: (v, 2) learned map at the vertices, any units.
        stage: called with the name of each stage as it begins.
        config: numbers.

    Raises:
        ShapeError: uv doesn't fit the vertices, or is not finite.
        FinishError: the result failed the exact check (a defect).
    """
    if uv.shape != (len(surface.vertices), 2) or not np.isfinite(uv).all():
        raise ShapeError(
            f"learned uv must be ({len(surface.vertices)}, 2) and finite, got {uv.shape} with "
            f"{int((~np.isfinite(uv)).sum())} values that are not; train again, with a smaller rate where it diverged"
        )
    graph = dual_graph(surface, edge_table(surface.faces), config.finish.labels.seams)
    component = connected_pieces(np.zeros(len(surface.faces), dtype=np.int64), graph)
    stage("flatten")
    done = [finish_component(surface, ids, uv, graph, config) for ids in grouped(component)]
    pieces = sorted((piece for found, _ in done for piece in found), key=lambda piece: int(piece.ids.min()))
    stage("exact check")
    verify(pieces)
    price = config.finish.slit.price
    cost = sum(piece.cost(price) for piece in pieces)
    return GlobalFinish(Finished(pieces, cost, {"parts": len(done)}, ()), [row for _, row in done])


def finish_component(
    surface: Surface,
    ids: NDArray[np.int64],
    uv: NDArray[np.float64],
    graph: DualGraph,
    config: GlobalFinishConfig,
) -> tuple[list[Piece], dict[str, Any]]:
    """Valid pieces of one component, faces ids (m,), and the facts about it; lengths in √(area of the surface)."""
    total = float(surface.face_areas().sum())
    unit = float(np.sqrt(total))
    whole, opened = open_along_seam(surface, ids, uv, config.seam)
    border = border_length(whole)
    seam = (border_length(opened.surface) - border) / 2.0 / unit
    slits = find_slits(opened.surface, total, config)
    row: dict[str, Any] = {"faces": len(ids), "seam_length": seam, "slits": len(slits)}
    flat, row["start"] = flattened(opened, slits, config)
    if flat is None:
        search = Search(surface, graph, config.finish)
        search.add_valid(ids)
        return list(search.pieces.values()), {**row, "charts": len(search.pieces)}
    energy = excess_energy(flat.surface, flat.uv) / total
    length = (border_length(flat.surface) - border) / 2.0 / unit
    return [Piece(ids, flat, energy, length, slits)], {**row, "charts": 1}


def open_along_seam(
    surface: Surface, ids: NDArray[np.int64], uv: NDArray[np.float64], config: SeamConfig
) -> tuple[Surface, LearnedDisk]:
    """One component (m,) of faces as a manifold piece, and opened along its seam."""
    faces, old = split_non_manifold_vertices(surface.faces[ids])
    piece, flat = Surface(surface.vertices[old], faces), uv[old]
    table = edge_table(faces)
    torn = tears(piece, flat, config, table).face > config.torn
    opened, source = cut_open(faces, seam_edges(piece, flat, config), table)
    return piece, LearnedDisk(Surface(piece.vertices[source], opened), flat[source], torn)


def find_slits(disk: Surface, total_area: float, config: GlobalFinishConfig) -> tuple[Slit, ...]:
    """The slits that pay, by the disk's proxy; none where the proxy has no valid start."""
    if config.slits == 0:
        return ()
    proxy = simplified(disk, config.proxy_faces)
    loops = boundary_loops(proxy.faces)
    start = circle_start(proxy) if len(loops) == 1 else None
    if start is None:
        return ()
    slit = replace(config.finish.slit, most=config.slits, failures=config.failures)
    flat = Flat(proxy, *lowest(proxy, {"circle": start}, config)[1])
    return slit_where_it_pays(flat, total_area, slit)[1]


def flattened(opened: LearnedDisk, slits: tuple[Slit, ...], config: GlobalFinishConfig) -> tuple[Flat | None, str]:
    """The disk with slits, valid, and where it began: "network" or "circle".

    None and "none" where neither start is valid.
    """
    disk = slit_along(opened.surface, slits, config.finish.slit)
    circle, learned = circle_start(disk), learned_start(opened, config)
    starts = {} if circle is None else {"circle": circle}
    if learned is not None:  # a slit leaves the flattening as it is: both sides take the uv of their vertex
        starts["network"] = np.zeros((len(disk.vertices), 2))
        starts["network"][disk.faces] = learned[opened.surface.faces]
    if not starts:
        return None, "none"
    name, state = lowest(disk, starts, config)
    return Flat(disk, conformal_steps(disk, state.uv, config.conformal, config.finish.slit.contact), {}), name


def lowest(disk: Surface, starts: dict[str, NDArray[np.float64]], config: GlobalFinishConfig) -> tuple[str, Relaxed]:
    """The state of least energy that SLIM with contacts reaches, and the valid uv (v, 2) that it began with, by name.

    Any of them may end in an overlap that contacts hardly loosen, so each is tried as it is and after conformal steps:
    straight from a circle, isometric energy mostly unfolds long strips over each other.
    """
    contact = replace(config.finish.slit.contact, steps=config.steps)

    def tried(start: tuple[str, bool]) -> Relaxed:
        name, spread = start
        uv = conformal_steps(disk, starts[name], config.conformal, contact) if spread else starts[name]
        return relax(disk, Relaxed(uv, {}), contact)

    tries = [(name, spread) for name in starts for spread in (True, False)]
    states = parallel_map(tried, tries)
    best = min(range(len(tries)), key=lambda number: excess_energy(disk, states[number].uv))
    return tries[best][0], states[best]


def learned_start(opened: LearnedDisk, config: GlobalFinishConfig) -> NDArray[np.float64] | None:
    """The network's uv at the disk's scale, the band and what folds laid out anew: valid, or None.

    Vertices of the band follow from the others by least squares of conformality (LSCM), so each side of the seam goes
    on as it was; where a flip is left, its vertices and their neighbours are let go too, ``config.loosened`` times.
    """
    surface, uv = opened.surface, at_scale(opened)
    if uv is None:
        return None
    loose = np.zeros(len(uv), dtype=bool)
    wrong_faces = opened.torn | flipped_triangles(uv[surface.faces])
    for _ in range(config.loosened):
        loose[surface.faces[wrong_faces]] = True
        kept = np.flatnonzero(~loose)
        if len(kept) < max(3, int(config.kept * len(uv))):  # too little of the learned map is left to follow
            return None
        if len(kept) < len(uv):
            corners, faces = np.asfortranarray(surface.vertices), np.asfortranarray(surface.faces)
            uv = np.asarray(igl.lscm(corners, faces, kept, uv[kept])[0], dtype=np.float64)
        if is_valid(surface, uv):
            return uv
        if not np.isfinite(uv).all():
            return None
        flipped = flipped_triangles(uv[surface.faces])
        around = np.zeros(len(uv), dtype=bool)
        around[surface.faces[flipped]] = True
        wrong_faces = around[surface.faces].any(axis=1)
    return None


def at_scale(opened: LearnedDisk) -> NDArray[np.float64] | None:
    """The learned uv scaled to the area of the faces outside the band, and mirrored where most of them are flipped."""
    whole = ~opened.torn
    area = signed_areas(opened.uv[opened.surface.faces[whole]])
    if area.sum() == 0.0:
        return None
    scale = np.sqrt(opened.surface.face_areas()[whole].sum() / np.abs(area).sum())
    return opened.uv * scale * [np.sign(area.sum()), 1.0]


def circle_start(disk: Surface) -> NDArray[np.float64] | None:
    """The map (v, 2) to the circle; None where float64 can't hold it without a flip."""
    uv = circle_map(disk, boundary_loops(disk.faces)[0])
    return uv if np.isfinite(uv).all() and not flipped_triangles(uv[disk.faces]).any() else None

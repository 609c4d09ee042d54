"""From a surface to valid charts: part by part, exactly where unfolding is exact, else by the best of several searches.

Valid means: each chart a flattened disk (holes allowed), no flipped triangle, no overlap, by exact tests.
f faces · a part has area 1.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.geometry.topology import edge_table
from ...runtime.mesh import Surface
from ..carry.arcs import with_straight_arcs
from ..carry.carry import carried_back
from ..carry.fine import refined
from ..carry.proxy import simplified, thinned
from ..carry.straighten import straightened
from ..finish.fallback import unwrapped_by_xatlas
from ..finish.pieces import Piece, measured
from ..finish.slits import Flat
from ..workers import one_thread_each, parallel_map
from .develop import Development, unfold
from .notes import hurried, notes
from .objective import objective, rank
from .parts import Part, split_parts
from .planar import flat_regions, least_seam
from .proof import all_proven, is_valid
from .shorten import Page, shortened
from .slivers import steadied
from .starts import Starts, best_search
from .tighten import back_on, is_asked, spent_fine, tightened

if TYPE_CHECKING:
    from ...runtime.deadline import Late
    from ...runtime.geometry.cutgraph import SeamPrices
    from ...runtime.progress import Stages
    from ..config import FinishConfig
    from ..search.search import Search
    from .starts import Scores


class Finished(NamedTuple):
    """Valid charts in the order of their first face.

    pieces: by chart.  objective: what the search lowered.  parts: how many there are, those that are copies of others,
    and by which way the rest were charted.  notes: sentences on what a user may not expect.
    """

    pieces: list[Piece]
    objective: float
    parts: dict[str, int]
    notes: tuple[str, ...]


class Solved(NamedTuple):
    """Charts of one part, at area 1, and how they were found: "unfolded" or "searched"."""

    pieces: list[Piece]
    way: str


def chart_surface(
    surface: Surface, charts: int, config: FinishConfig, seed: int, stage: Stages, scores: Scores | None = None
) -> Finished:
    """Valid charts of a surface.

    Args:
        surface: welded, any units; edges that are not manifold are cut.
        charts: the most charts a part gets, unless fewer than it needs to keep its stretch within bounds.
        config: numbers.
        seed: of the searches' first labels.
        stage: called with the name of each stage as it begins.  Once its deadline is about to pass, searches end with
            what they have, and it is laid out on the surface in the shortest way.
        scores: (n, 3) points in the surface's units → (n, k) log chart probabilities, learned elsewhere: the one start
            of each search.  None starts from geometry.

    Raises:
        FinishError: the result failed the exact check (a defect).
    """
    stage("parts")
    parts = split_parts(surface, config.congruence)
    total = sum(part.scale**2 for part in parts)
    stage("charts")
    late = partial(stage.deadline.passed, config.haste.seconds + config.haste.seconds_per_face * len(surface.faces))
    first = [number for number, part in enumerate(parts) if part.copy_of < 0]

    def solve(number: int) -> Solved:
        part = parts[number]._replace(surface=steadied(parts[number].surface, config.sliver))
        own = priced(config, config.slit.seams.moved(part.origin, part.scale))
        starts = Starts(part, config.closing.charts, part.scale**2 / total, own, seed, scores, late)
        solved = solve_part(part.surface, charts, starts, own)
        polygon = None if surface.polygon is None else surface.polygon[part.ids]
        page = Page(float(np.sqrt(total)) / part.scale, charts, polygon)
        return solved if config.stretch else solved._replace(pieces=shortened(part.surface, solved.pieces, page, own))

    largest_first = sorted(first, key=lambda number: -len(parts[number].ids))
    # one that is most of the work uses all cores itself; else each core works on a part of its own
    apart = int(2 * len(parts[largest_first[0]].ids) > sum(len(parts[number].ids) for number in first))
    with one_thread_each():
        found = [solve(number) for number in largest_first[:apart]] + parallel_map(solve, largest_first[apart:])
    solved = dict(zip(largest_first, found, strict=True))
    pieces = [
        placed(piece, part, surface, total)
        for number, part in enumerate(parts)
        for piece in solved[part.copy_of if part.copy_of >= 0 else number].pieces
    ]
    stage("exact check")
    pieces = sorted(all_proven(surface, pieces, config.project, late), key=lambda piece: int(piece.ids.min()))
    stage.end()
    ways = Counter(found.way for found in solved.values())
    facts = {"parts": len(parts), "copies": len(parts) - len(solved), **ways}
    told = (*hurried(stage.deadline, late), *notes(solved, charts, config))
    return Finished(pieces, objective(surface, pieces, config.slit.price), facts, told)


def priced(config: FinishConfig, seams: SeamPrices) -> FinishConfig:
    """The same with other prices of seams."""
    return replace(config, labels=replace(config.labels, seams=seams), slit=replace(config.slit, seams=seams))


def placed(piece: Piece, part: Part, surface: Surface, total: float) -> Piece:
    """A chart of a part, or of the one it is a copy of, as a chart of the whole surface."""
    ids = part.ids[piece.ids]
    uv, faces = piece.flat.uv * part.scale, piece.flat.surface.faces
    if part.mirrored:
        uv, faces = uv * [-1.0, 1.0], faces[:, [0, 2, 1]]
    vertices = np.zeros((len(uv), 3))
    corner = faces if not part.mirrored else piece.flat.surface.faces[:, [0, 2, 1]]
    vertices[corner.reshape(-1)] = surface.vertices[surface.faces[ids]].reshape(-1, 3)
    share = part.scale**2 / total
    return replace(
        piece,
        ids=ids,
        flat=Flat(Surface(vertices, faces), uv, {}),
        energy=piece.energy * share,
        slit_length=piece.slit_length * float(np.sqrt(share)),
        slits=(),
    )


def solve_part(surface: Surface, charts: int, starts: Starts, config: FinishConfig) -> Solved:
    """Charts of a connected manifold of area 1."""
    exact = unfolded_part(surface, charts, starts.handles, config)
    if exact is not None and exact.way == "unfolded":
        return exact
    many = len(surface.faces) > config.fine.above * starts.middle
    middle = thinned(surface, replace(config.fine, faces=starts.middle)) if many else surface
    whole = exact is not None and len(middle.faces) <= starts.whole
    coarse = middle if whole else simplified(middle, starts.faces)
    found = best_search(coarse, charts, starts, config, exact.pieces if whole and exact is not None else [])
    asked = is_asked(found, charts, config)
    if not starts.late():
        found = tightened(found, charts, config, starts.late) if asked else found
        found = found if starts.holed else straightened(found, config.bands)
    pieces = brought_back((surface, middle, coarse), found, charts, config, starts.late, asked=asked)
    facets = exact.pieces if exact is not None and exact.way == "facets" else []
    if facets and rank(facets, surface, charts, config) <= rank(pieces, surface, charts, config):
        return Solved(facets, "facets")
    energy = sum(piece.energy for piece in pieces)
    if energy > config.resort_excess and not starts.late():
        resort = unwrapped_by_xatlas(surface, np.arange(len(surface.faces)), 1.0)
        if sum(piece.energy for piece in resort) < energy:
            return Solved(resort, "xatlas")
    return Solved(pieces, "searched")


def brought_back(
    levels: tuple[Surface, Surface, Surface],
    found: Search,
    charts: int,
    config: FinishConfig,
    late: Late,
    *,
    asked: bool,
) -> list[Piece]:
    """What was found on the proxy, on the surface itself; levels: the surface, its middle mesh, the proxy.

    asked: few charts or short seams were, so that what was closed is led back as a network of seams.
    """
    surface, middle, coarse = levels
    if late() and coarse is not surface:
        return refined(surface, coarse, list(found.pieces.values()), config, late)
    if coarse is not middle:
        found = (back_on if asked else carried_back)(middle, coarse, found, charts, config)
    if not late():
        found = straightened(found, config.bands_carried) if coarse is not middle else found
        found.slit_all(config.slit_above, contacts=True)
        found.polish()  # so that what an arc seems to gain is not what more steps would have
        before, found = found, with_straight_arcs(found, config.arcs, late)
        if found is not before:
            found.polish()
        found = spent_fine(found, charts, config, late) if config.stretch else found
    found.mend()
    pieces = list(found.pieces.values())
    return pieces if middle is surface else refined(surface, middle, pieces, config, late)


def unfolded_part(surface: Surface, charts: int, handles: int, config: FinishConfig) -> Solved | None:
    """A part made of flat facets, unfolded: "unfolded" where that is the answer, "facets" where it is one among others.

    None where too little of it is flat; "overlapping" where some of it lies over itself, which is no more than a start.
    A plate with more holes than charts were asked for can't do with those: the
    side of each hole is one.
    """
    table = edge_table(surface.faces)
    region = flat_regions(surface, table, config.planar)
    count = int(region.max()) + 1
    faceted = count <= config.planar.facets or count <= config.planar.flat_share * len(surface.faces)
    dear = config.slit.price * least_seam(surface, table, config.planar.bent) > config.planar.dear
    if count > config.planar.most or (dear and not faceted):
        return None
    found = unfold(surface, table, region, config.planar)
    if len(found) > config.planar.most_charts + handles:
        return None
    answer = len(found) <= min(config.planar.few, charts) or (faceted and (len(found) <= charts or handles >= charts))
    pieces = [as_piece(surface, development) for development in found]
    if not all(is_valid(piece) for piece in pieces):
        return Solved(pieces, "overlapping")
    return Solved(pieces, "unfolded" if answer else "facets")


def as_piece(surface: Surface, development: Development) -> Piece:
    """A development as a piece: its corners are one vertex where they are in space and in the plane."""
    corner = surface.faces[development.ids].reshape(-1)
    uv = development.uv.reshape(-1, 2)
    order = np.lexsort((uv[:, 1], uv[:, 0], corner))
    fresh = np.ones(len(order), dtype=bool)
    fresh[1:] = (corner[order][1:] != corner[order][:-1]) | (uv[order][1:] != uv[order][:-1]).any(axis=1)
    index = np.zeros(len(order), dtype=np.int64)
    index[order] = np.cumsum(fresh) - 1
    first = order[fresh]
    flat = Flat(Surface(surface.vertices[corner[first]], index.reshape(-1, 3)), uv[first], {})
    return measured(surface, development.ids, flat, 1.0)

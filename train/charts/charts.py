"""From a surface to valid charts: part by part, exactly where unfolding is exact, else by the best of several searches.

Valid means: each chart a flattened disk (holes allowed), no flipped triangle, no overlap, by exact tests.
f faces · a part has area 1.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.geometry.topology import edge_table
from ...runtime.mesh import Surface
from ...runtime.process.progress import Stages
from ..carry.fine import refined
from ..carry.proxy import simplified, thinned
from ..carry.straighten import straightened
from ..finish.energies import finished_by
from ..finish.fallback import unwrapped_by_xatlas
from ..finish.pieces import Piece, measured
from ..finish.slits import Flat
from ..swift.swift import better, joined, swift_pieces, swift_rest, swift_sheet
from ..workers import one_thread_each, parallel_map
from .anew import uncrumpled
from .develop import Development, unfold
from .given import Improved, best_of_copies, given_charts, improvement, no_worse
from .haste import Haste
from .mirror import mirror_of, mirrored_charts
from .notes import hurried, kept_isometric, mirror_facts, notes
from .objective import objective, priced, rank
from .parts import Part, placed, split_parts
from .planar import flat_regions, least_seam
from .proof import all_proven, is_valid
from .ribbons import ribbon
from .shorten import Page, shortened
from .slivers import steadied
from .starts import NOTHING, Starts, best_search
from .tighten import led_back, room_spent, settled, way_down

if TYPE_CHECKING:
    from ..config import FinishConfig
    from ..search.search import Search
    from .starts import Known
    from .tighten import Way


class Finished(NamedTuple):
    """Valid charts in the order of their first face.

    pieces: by chart.  objective: what the search lowered.  parts: how many there are, those that are copies of others,
    and by which way the rest were charted.  notes: sentences on what a user may not expect.  start: what came of an
    atlas that was given.
    """

    pieces: list[Piece]
    objective: float
    parts: dict[str, int]
    notes: tuple[str, ...]
    start: Improved | None = None


class Solved(NamedTuple):
    """Charts of one part, at area 1, and how they were found: "unfolded", "searched", "mirrored" and so on.

    unlike: faces beyond the mirror plane that are no mirror image; None where the part has no such plane.
    """

    pieces: list[Piece]
    way: str
    unlike: int | None = None


UNSOLVED = Solved([], "swift")
"""A part that there is no time to search: all such parts are charted together."""


@dataclass(frozen=True, eq=False)
class Work:
    """What the parts of a surface are charted by; total: their area.  given: atlases to improve, one a part."""

    surface: Surface
    parts: list[Part]
    total: float
    charts: int
    config: FinishConfig
    seed: int
    stage: Stages
    known: Known
    given: dict[int, Search]
    haste: Haste

    def solve(self, number: int) -> Solved:
        """Charts of a part."""
        part, config = self.parts[number], self.config
        if self.haste.last():
            return UNSOLVED
        part = part._replace(surface=steadied(part.surface, config.sliver))
        own = priced(config, config.slit.seams.moved(part.origin, part.scale))
        bound = self.given.get(number)
        solved = self.mirrored(part, own, bound) if config.symmetry.axis != "none" else self.plain(part, own, bound)
        if bound is None:
            return solved
        return solved._replace(pieces=no_worse(solved.pieces, bound, self.charts, own, self.haste.late))

    def plain(self, part: Part, config: FinishConfig, bound: Search | None) -> Solved:
        """Charts as they come, those too long for the page cut; bound: an atlas to start from."""
        share, most = part.scale**2 / self.total, config.closing.charts
        starts = Starts(part, most, share, config, self.seed, self.known.scores, self.haste, bound)
        polygon = None if self.surface.polygon is None else self.surface.polygon[part.ids]
        page = Page(float(np.sqrt(self.total)) / part.scale, self.charts, polygon)
        solved = solve_part(part.surface, starts, page, config)
        whole = solved.way == "swift" or (starts.carried and solved.way == "searched")
        if config.stretch or whole or self.haste.last():
            return solved
        return solved._replace(pieces=shortened(part.surface, solved.pieces, page, config))

    def mirrored(self, part: Part, config: FinishConfig, bound: Search | None) -> Solved:
        """Charts that are mirror images, where there is a plane; where that is looked for, if they are no worse."""
        mirror = mirror_of(part.surface, config.symmetry)
        if mirror is None:
            return self.plain(part, config, bound)

        def half(surface: Surface, most: int, own: FinishConfig) -> list[Piece]:
            return chart_surface(surface, most, own, self.seed, Stages(deadline=self.stage.deadline)).pieces

        pieces = mirrored_charts(part.surface, mirror, self.charts, config, half, self.haste.late)
        found = Solved(pieces, "mirrored", mirror.unlike)
        if config.symmetry.axis != "auto":
            return found
        ways = [found, self.plain(part, config, bound)._replace(unlike=mirror.unlike)]
        return min(ways, key=lambda way: rank(way.pieces, part.surface, self.charts, config))


def chart_surface(
    surface: Surface, charts: int, config: FinishConfig, seed: int, stage: Stages, known: Known = NOTHING
) -> Finished:
    """Valid charts of a surface.

    Args:
        surface: welded, any units; edges that are not manifold are cut.
        charts: the most charts a part gets, unless fewer than it needs to keep its stretch within bounds.
        config: numbers.
        seed: of the searches' first labels.
        stage: called with the name of each stage as it begins.  Once its deadline is about to pass, searches end with
            what they have, and it is laid out on the surface in the shortest way.
        known: what was found elsewhere.

    Raises:
        FinishError: the result failed the exact check (a defect).
    """
    config = replace(config, page=replace(config.page, free=charts < config.closing.charts))
    haste = Haste(stage.deadline, len(surface.faces), config.haste)
    late = haste.late
    if haste.is_hopeless(len(surface.faces)):
        pieces = swift_pieces(surface, config, haste.left)
        return Finished(pieces, objective(surface, pieces, config.slit.price), {}, tuple(hurried(stage.deadline, late)))
    stage("parts")
    parts = split_parts(surface, config.congruence)
    total = sum(part.scale**2 for part in parts)
    stage("charts")
    given = given_charts(parts, known.corner_uv, config)
    first = [number for number, part in enumerate(parts) if part.copy_of < 0]
    bounds = best_of_copies(given, parts, charts)
    work = Work(surface, parts, total, charts, config, seed, stage, known, bounds, haste)
    largest_first = sorted(first, key=lambda number: -len(parts[number].ids))
    # one that is most of the work uses all cores itself; else each core works on a part of its own
    apart = int(2 * len(parts[largest_first[0]].ids) > sum(len(parts[number].ids) for number in first))
    with one_thread_each():
        found = [work.solve(number) for number in largest_first[:apart]]
        found += parallel_map(work.solve, largest_first[apart:])
    solved = dict(zip(largest_first, found, strict=True))
    pieces = [
        placed(piece, part, surface, total)
        for number, part in enumerate(parts)
        for piece in solved[part.copy_of if part.copy_of >= 0 else number].pieces
    ]
    pieces += swift_rest(surface, pieces, config, haste.left)
    stage("exact check")
    pieces = sorted(all_proven(surface, pieces, config.project, late), key=lambda piece: int(piece.ids.min()))
    stage.end()
    better = improvement(surface, parts, given, pieces, config) if given else None
    hurry = late()
    pieces, left = (pieces, 0) if hurry else finished_by(pieces, total, config.energy)
    ways = Counter(found.way for found in solved.values())
    facts = {"parts": len(parts), "copies": len(parts) - len(solved), **ways}
    told = (
        *hurried(stage.deadline, late),
        *notes(solved, charts, config),
        *mirror_facts(solved, config),
        *kept_isometric(left, config, late=hurry),
        *(() if better is None else (better.sentence(),)),
    )
    cost = objective(surface, pieces, config.slit.price)
    return Finished(pieces, cost, facts, told, better)


def solve_part(surface: Surface, starts: Starts, page: Page, config: FinishConfig) -> Solved:
    """Charts of a connected manifold of area 1; where they are carried to it from another mesh, they fit the page.

    Where a budget counts, a part of many faces gets charts without a search first, and one only if there is no noise.
    """
    haste = starts.haste
    if starts.is_hopeless:
        return UNSOLVED
    exact = unfolded_part(surface.shape, page, starts.handles, config)
    if exact is not None and exact.way == "unfolded":
        return exact
    if not (starts.many and haste.is_strict):
        return searched_part(surface, starts, page, config, exact)
    sheet = swift_sheet(surface, config)
    if sheet.stretch > config.swift.noisy or haste.is_hopeless(len(surface.faces), starts.handles):
        return Solved(joined(sheet, haste.left), "swift")
    found = searched_part(surface, starts, page, config, exact)
    swift = better(found.pieces, sheet, lambda pieces: objective(surface, pieces, config.slit.price), haste.left)
    return found if swift is None else Solved(swift, "swift")


def searched_part(surface: Surface, starts: Starts, page: Page, config: FinishConfig, exact: Solved | None) -> Solved:
    """Charts by the best of several searches; exact: what unfolding gave, if anything."""
    charts, shape = page.most, surface.shape
    middle = thinned(shape, replace(config.fine, faces=starts.middle)) if starts.many else shape
    whole = exact is not None and len(middle.faces) <= starts.whole
    coarse = middle if whole else simplified(middle, starts.faces)
    bests = best_search(coarse, charts, starts, config, exact.pieces if whole and exact is not None else [])
    ways = [way_down(best, charts, starts) for best in bests]
    pieces = brought_back((surface, middle, coarse), ways, starts, page)
    if not (config.stretch or config.page.free):
        stage = Stages(deadline=starts.haste.deadline)
        pieces = uncrumpled(
            surface,
            pieces,
            config.crumpled,
            lambda alone: chart_surface(alone, charts, config, starts.seed, stage).pieces,
            starts.late,
        )
    facets = exact.pieces if exact is not None and exact.way == "facets" else []
    if facets and rank(facets, surface, charts, config) <= rank(pieces, surface, charts, config):
        return Solved(facets, "facets")
    energy = sum(piece.energy for piece in pieces)
    if energy > config.resort_excess and not starts.late():
        resort = unwrapped_by_xatlas(surface, np.arange(len(surface.faces)), 1.0)
        if sum(piece.energy for piece in resort) < energy:
            return Solved(resort, "xatlas")
    return Solved(pieces, "searched")


def brought_back(levels: tuple[Surface, Surface, Surface], ways: list[Way], starts: Starts, page: Page) -> list[Piece]:
    """The best of what was found on the proxy, on the surface itself; levels: the surface, its middle mesh, the proxy.

    Where there is a middle mesh, charts too long for the page are cut there: a tenth of the faces says where as well.
    """
    (surface, middle, coarse), late, last = levels, starts.haste.late, starts.haste.last
    charts, config = page.most, starts.config
    if late() and coarse is not surface:
        return refined(surface, coarse, list(ways[-1].found.pieces.values()), config, late, last)
    found = [way.found for way in ways]
    if coarse is not middle:
        found = [led for way in ways for led in led_back(middle, coarse, way, charts, config)]
    if late():
        found = found[0]
    else:
        straight = [straightened(way, config.bands_carried) for way in found] if coarse is not middle else found
        found = settled(straight, charts, config, late)
        if config.stretch and coarse is not middle:
            found = room_spent(found, ways[-1], coarse, charts, late)
    found.mend()
    found.join_crumbs(late)
    pieces = list(found.pieces.values())
    if starts.carried and not (config.stretch or late()):
        pieces = shortened(middle, pieces, page if middle is surface else page._replace(polygon=None), config)
    return pieces if middle is surface else refined(surface, middle, pieces, config, late, last)


def unfolded_part(surface: Surface, page: Page, handles: int, config: FinishConfig) -> Solved | None:
    """A part made of flat facets, unfolded: "unfolded" where that is the answer, "facets" where it is one among others.

    None where too little of it is flat; "overlapping" where some of it lies over itself, which is no more than a start.
    A plate with more holes than charts were asked for can't do with those: the
    side of each hole is one.
    """
    table, charts = edge_table(surface.faces), page.most
    region = flat_regions(surface, table, config.planar)
    count = int(region.max()) + 1
    faceted = count <= config.planar.facets or count <= config.planar.flat_share * len(surface.faces)
    dear = config.slit.price * least_seam(surface, table, config.planar.bent) > config.planar.dear
    if count > config.planar.most or (dear and not faceted):
        return None
    found = ribbon(surface, table, region, config.planar, page.side)
    found = found or unfold(surface, table, region, config.planar, page.side)
    if len(found) > config.planar.most_charts + handles:
        return None
    answer = len(found) <= min(config.planar.few, charts) or (faceted and (len(found) <= charts or handles >= charts))
    pieces = [as_piece(surface, development) for development in found]
    if not all(is_valid(piece) for piece in pieces):
        return Solved(pieces, "overlapping")
    return Solved(pieces, "unfolded" if answer else "facets")


def as_piece(surface: Surface, development: Development) -> Piece:
    """A development as a piece: its corners are one vertex where they are in space and in the plane."""
    return measured(surface, development.ids, Flat.of(surface, development.ids, development.uv), 1.0)

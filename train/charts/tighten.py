"""Fewer charts and shorter seams than the search left: closed, straightened, and closed again.   A part has area 1."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...runtime.process.deadline import Late, never
from ..carry.arcs import with_straight_arcs
from ..carry.carry import carried_back
from ..carry.network import network_carried
from ..seams.closing import Bounds, Closing
from ..workers import parallel_map
from .objective import rank

if TYPE_CHECKING:
    from ...runtime.mesh import Surface
    from ..config import FinishConfig
    from ..search.search import Search


def is_asked(search: Search, charts: int, config: FinishConfig) -> bool:
    """Whether fewer charts or shorter seams are asked for than the search found.

    Where neither is, closing lowers the objective by a few percent, and packing by a tenth: charts that branch waste
    the page.  Far more charts than asked for are left as they are.
    """
    above = len(search.pieces) - charts
    return config.stretch > 0.0 or 0 < above <= config.start.crowded


def tightened(search: Search, charts: int, config: FinishConfig, late: Late = never) -> Search:
    """The search with seams closed as far as the bounds on charts and stretch ask for it, and where that pays."""
    closing, price = config.closing, config.slit.price
    bounds = Bounds(charts, config.stretch or config.most_excess)
    if config.stretch:
        opened_up(search, bounds.excess, config, late)
    Closing(search, bounds, closing, late).close(price, closing.tries)
    if not late():
        search = with_straight_seams(search)
    return spent(search, bounds, config, closing.tries_dearer, late) if config.stretch else search


def spent(search: Search, bounds: Bounds, config: FinishConfig, tries: int, late: Late = never) -> Search:
    """The search with seams closed at higher and higher prices, up to the bound on stretch."""
    work = Closing(search, bounds, config.closing, late)
    for price in config.closing.prices:
        if price > config.slit.price and search.energy() < bounds.excess:
            work.close(price, tries)
    return search


def spent_fine(search: Search, charts: int, config: FinishConfig, late: Late = never) -> Search:
    """As `spent`, on the surface itself, in few tries; slits come first where the stretch is too much."""
    opened_up(search, config.stretch, config, late)
    return spent(search, Bounds(charts, config.stretch), config, config.closing.tries_fine, late)


def settled(searches: list[Search], charts: int, config: FinishConfig, late: Late = never) -> Search:
    """The best search on the surface itself with slits that pay, straight arcs, and its stretch spent if asked for.

    Under a bound on stretch a slit may be a detour, or the room that two seams are closed in: both ways are gone.
    """
    ways = [(search, True) for search in searches]
    ways += [(search, False) for search in searches if 0.0 < search.energy() <= config.stretch]
    found = parallel_map(lambda way: settled_way(way[0], charts, config, late, slits=way[1]), ways)
    return min(found, key=lambda search: place_of(search, charts))


def settled_way(search: Search, charts: int, config: FinishConfig, late: Late, *, slits: bool) -> Search:
    """As `settled`, with slits or without; the search given stays as it is."""
    found = search.twin()
    if slits:
        found.slit_all(config.slit_above, contacts=True)
    found.polish()  # so that what an arc seems to gain is not what more steps would have
    before, found = found, with_straight_arcs(found, config.arcs, late)
    if found is not before:
        found.polish()
    return spent_fine(found, charts, config, late) if config.stretch else found


def with_straight_seams(search: Search) -> Search:
    """The search with each seam on the cheapest way between its ends, where that lowers the objective."""
    found = network_carried(search.surface, search, search.config.carry.winding[0])
    return found if found is not None and found.objective() < search.objective() else search


def back_on(surface: Surface, coarse: Surface, found: Search, charts: int, config: FinishConfig) -> list[Search]:
    """The search of a proxy on the surface: its seams as a network, or its labels where that comes out better.

    Where the best of these has too many charts, the best of the others is the second: its stretch may be opened up.
    """
    most = max(charts, len(found.pieces))
    ways: list[Search] = []
    for winding in config.carry.winding:
        network = network_carried(surface, found, winding)
        if network is not None:
            ways.append(network)
        if network is not None and len(network.pieces) <= most:
            if network.objective() <= found.objective():
                return [network]
            break
    ways = sorted([*ways, carried_back(surface, coarse, found, charts, config)], key=lambda way: place_of(way, most))
    few = [way for way in ways if len(way.pieces) <= most]
    return [*dict.fromkeys((ways[0], *few[:1]))]


def place_of(search: Search, charts: int) -> tuple[bool, bool, float]:
    """The rank of a search."""
    return rank(list(search.pieces.values()), search.surface, charts, search.config)


def opened_up(search: Search, excess: float, config: FinishConfig, late: Late = never) -> None:
    """Slits at lower and lower prices until the stretch is within bounds, or the lowest is reached; in place."""
    price = config.slit.price
    while search.energy() > excess and price > config.closing.cheapest * config.slit.price and not late():
        search.slit_all(config.slit_above * excess, price=price)
        price *= config.closing.cheaper

"""Fewer charts and shorter seams than the search left: closed, straightened, and closed again.   A part has area 1."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.process.deadline import Late, never
from ..carry.arcs import with_straight_arcs
from ..carry.carry import carried_back
from ..carry.network import network_carried
from ..carry.straighten import straightened
from ..seams.closing import Bounds, Closing
from ..seams.growing import as_one_chart, grown, opened_to
from ..seams.network import seam_edges
from ..workers import parallel_map
from .objective import rank, search_cost

if TYPE_CHECKING:
    from ...runtime.mesh import Surface
    from ..config import FinishConfig
    from ..search.search import Search
    from .starts import Starts


class Way(NamedTuple):
    """A state of a search on the proxy that is laid out on the surface.

    before: the state that seams were closed from.  forced: fewer charts or short seams alone were asked for.
    """

    found: Search
    before: Search
    forced: bool = False


def way_down(search: Search, charts: int, starts: Starts) -> Way:
    """The search with its borders straightened, and seams closed: where that pays, or where it is asked for."""
    config, late = starts.config, starts.late
    crowded = len(search.pieces) - charts > config.start.crowded
    if late():
        return Way(search, search)
    few = config.stretch > 0.0 or (config.page.free and not crowded and len(search.pieces) > charts)
    if few:
        thinner = len(search.surface.faces) < len(starts.part.surface.faces)
        search = tightened(search, charts, config, late, proxy=thinner)
    straight = search if starts.holed else straightened(search, config.bands)
    if few or crowded:
        return Way(straight, straight, forced=few)
    return closed(straight, charts, 0 if starts.small else config.page.tries, late)


def closed(search: Search, charts: int, tries: int, late: Late) -> Way:
    """The best state of a search on its way down to few enough charts.

    First closings that pay are made, whatever the limit on charts, so that all limits share them; then, where there are
    still more or the page is free, those that make fewer.
    """
    config = search.config
    work = Closing(search.twin(), Bounds(len(search.pieces), config.most_excess), config.closing, late)
    work.close(config.slit.price, tries)
    if not late() and (len(work.search.pieces) > charts or (tries and not config.page_price)):
        work.bounds = Bounds(charts, config.most_excess)
        work.close(config.slit.price, config.page.tries_fewer)
    seen = [search, *work.seen]
    found = best_of([state for state in seen if len(state.pieces) <= charts] or seen[-1:])
    forced = found is not search and not (config.page_price and found is best_of(seen))
    return Way(with_straight_seams(found) if forced else found, search, forced)


def best_of(states: list[Search]) -> Search:
    """The state of fewest charts among those that cost about as little as the best, the best of equals."""
    config = states[0].config
    ranked = [(len(state.pieces), search_cost(state, config), n) for n, state in enumerate(states)]
    most = config.page.near * min(cost for _, cost, _ in ranked)
    return states[min(each for each in ranked if each[1] <= most)[-1]]


def led_back(surface: Surface, coarse: Surface, way: Way, charts: int, config: FinishConfig) -> list[Search]:
    """A way on the surface: by labels, as a network of seams where more were closed than pay.

    Where closed seams do not come back as what they were, what they were closed from is another.
    """
    if way.forced:
        return back_on(surface, coarse, way.found, charts, config)
    led = [carried_back(surface, coarse, way.found, charts, config)]
    if way.before is not way.found and search_cost(led[0], config) > search_cost(way.before, config):
        led.append(carried_back(surface, coarse, way.before, charts, config))
    cost = [search_cost(search, config) for search in led]
    return [search for search, each in zip(led, cost, strict=True) if each <= config.page.far * min(cost)]


def tightened(search: Search, charts: int, config: FinishConfig, late: Late = never, *, proxy: bool = False) -> Search:
    """The search with seams closed as far as the bounds on charts and stretch ask for it, and where that pays.

    Where stretch is asked for, seams grown are tried too, and from then on scaffolds hold charts apart.  On a proxy,
    stretch may be some more: the surface itself is stretched less.
    """
    closing, price = config.closing, config.slit.price
    if not config.stretch:
        Closing(search, Bounds(charts, config.most_excess), closing, late).close(price, closing.tries)
        return search if late() else with_straight_seams(search)
    found, loose = search.twin(), config.stretch * (closing.growing.proxy if proxy else 1.0)
    found.config = replace(config, stretch=loose)
    found = opened_and_closed(found, charts, late)
    ways = [found, *other_ways(found, charts, late)]
    best = held(min(ways, key=lambda way: place_of(way, charts)))
    if best.energy() * closing.growing.room < loose:
        best = spent(best, Bounds(charts, loose), best.config, closing.growing.tries_closing, late)
    best.config = replace(best.config, stretch=config.stretch)
    return best


def room_spent(found: Search, way: Way, coarse: Surface, charts: int, late: Late) -> Search:
    """The search on the surface, or a shorter one: where its stretch is well within the bound that was asked for.

    Seams are closed further on the proxy by as much as that leaves, and brought back once more.
    """
    bound, stretch = found.config.stretch, found.energy()
    if late() or not stretch or stretch * found.config.closing.growing.room >= bound:
        return found
    proxy, config = held(way.found), found.config
    loose = proxy.energy() * min(bound / stretch, config.closing.growing.most_room)
    proxy.config = replace(proxy.config, stretch=loose)
    proxy = spent(proxy, Bounds(charts, loose), proxy.config, config.closing.growing.tries_closing, late)
    if np.array_equal(seam_edges(proxy), seam_edges(way.found)):
        return found
    proxy.config = replace(proxy.config, stretch=bound)
    led = back_on(found.surface, coarse, proxy, charts, config)
    other = settled([straightened(each, config.bands_carried) for each in led], charts, config, late)
    return min((found, other), key=lambda search: place_of(search, charts))


def opened_and_closed(search: Search, charts: int, late: Late) -> Search:
    """The search, changed in place, with slits until the stretch is within bounds, and closed as far as that allows."""
    config, bounds = search.config, Bounds(charts, search.config.stretch)
    opened_up(search, bounds.excess, config, late)
    Closing(search, bounds, config.closing, late).close(config.slit.price, config.closing.tries)
    found = search if late() else with_straight_seams(search)
    return spent(found, bounds, config, config.closing.tries_dearer, late)


def other_ways(search: Search, charts: int, late: Late) -> list[Search]:
    """Seams grown, and where bounds are not kept, the search gone on with as scaffolds hold charts apart."""
    if late():
        return []
    ways = grown_ways(search, charts, late)
    kept = [way for way in [search, *ways] if place_of(way, charts)[:2] == (False, False)]
    return ways if kept else [*ways, opened_and_closed(held(search), charts, late)]


def held(search: Search) -> Search:
    """The search with scaffolds that hold its charts apart."""
    config = search.config
    scaffold = replace(config.slit.contact.scaffold, rounds=config.closing.growing.rounds)
    found = search.twin()
    found.config = replace(config, slit=replace(config.slit, contact=replace(config.slit.contact, scaffold=scaffold)))
    return found


def grown_ways(search: Search, charts: int, late: Late = never) -> list[Search]:
    """Searches of one chart from seams grown, slit and closed; those that are stretched too much are left out."""
    bare, growing, stretch = held(search), search.config.closing.growing, search.config.stretch
    cuts = grown(search.surface, tuple(share * stretch for share in growing.energies), bare.config)
    begun = [way for way in parallel_map(lambda cut: as_one_chart(bare, cut), cuts) if way is not None]
    begun = sorted((way for way in begun if way.energy() <= growing.hopeful * stretch), key=lambda way: way.energy())
    found = parallel_map(lambda way: slit_and_closed(way, charts, late), begun[: growing.most_ways])
    return [way for way in found if way.energy() <= stretch]


def slit_and_closed(search: Search, charts: int, late: Late) -> Search:
    """The search of one chart with slits until the stretch is within bounds, and seams closed as far as that allows."""
    config = search.config
    opened_by_need(search, config.stretch, late)
    bounds = Bounds(charts, config.stretch)
    return spent(with_straight_seams(search), bounds, config, config.closing.growing.tries_closing, late)


def opened_by_need(search: Search, excess: float, late: Late) -> None:
    """Slits, to where curvature asks for them, until the stretch is within bounds: in place, the worst piece first."""
    for key in sorted(search.pieces, key=lambda key: -search.pieces[key].energy):
        piece, over = search.pieces[key], search.energy() - excess
        if over <= 0.0 or late():
            return
        search.pieces[key] = opened_to(piece, search.area, piece.energy - over, search.config, late)


def spent(search: Search, bounds: Bounds, config: FinishConfig, tries: int, late: Late = never) -> Search:
    """The search with seams closed at higher and higher prices, up to the bound on stretch."""
    work = Closing(search, bounds, config.closing, late)
    for price in config.closing.prices:
        if price > config.slit.price and search.energy() < bounds.excess:
            work.close(price, tries)
    return search


def spent_fine(search: Search, charts: int, config: FinishConfig, late: Late = never) -> Search:
    """As `spent`, on the surface itself, in few tries; slits come first where the stretch is too much."""
    opened_by_need(search, config.stretch, late)
    opened_up(search, config.stretch, config, late)
    return spent(search, Bounds(charts, config.stretch), config, config.closing.tries_fine, late)


def settled(searches: list[Search], charts: int, config: FinishConfig, late: Late = never) -> Search:
    """The best search on the surface itself with slits that pay, straight arcs, and its stretch spent if asked for.

    Under a bound on stretch that is kept a slit is a detour.
    """
    ways = [(search, not 0.0 < search.energy() <= config.stretch) for search in searches]
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

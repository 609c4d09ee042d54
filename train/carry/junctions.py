"""Junctions of seams moved together with the arcs that meet there: to where these are shortest.   e edges · v vertices.

Where a thin tooth of one chart lies between two others, its tip is a junction: no arc can leave alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.geometry.cutgraph import path_mask, shortest_paths, trace_back
from ...runtime.geometry.straightpaths import straightest_path
from ..seams.network import chains, seam_edges
from .exchange import Room, exchanged

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.geometry.straightpaths import Roads
    from ..seams.network import Chain
    from ..search.search import Search
    from .config import ArcConfig
    from .exchange import Arc


class Star(NamedTuple):
    """The ends of chains that meet in one vertex: paths from there outwards, and numbers of those chains."""

    arms: list[NDArray[np.int64]]
    chains: frozenset[int]
    sides: tuple[int, ...]


def straighter_junctions(search: Search, width: float, longest: int, config: ArcConfig, *, shifted: bool) -> list[Arc]:
    """Junctions that have a better place no farther off than ``width`` mean edges of their arms; any may be moved.

    No two of them share a chain.  longest: edges of an arm.  shifted: others come first.
    """
    seam = seam_edges(search)
    room, found, taken = Room(search, seam), [], set[int]()
    met = stars(chains(search, seam), on_the_border(search), longest)
    for star in met[::-1] if shifted else met:
        old = np.flatnonzero(path_mask(search.table, [arm.tolist() for arm in star.arms]))
        if star.chains & taken or len(old) < config.least:
            continue
        ways = shortest_star(room.around(old, width), star, config.turning)
        new = np.flatnonzero(path_mask(search.table, ways)) if ways else old
        if not np.array_equal(new, old):
            room.barred[np.concatenate(ways)] = True
            taken |= star.chains
            found.append(exchanged(search, seam, old, new, star.sides))
    return found


def on_the_border(search: Search) -> NDArray[np.bool_]:
    """(v,) bool: vertices on edges that are cut anyway."""
    border = np.zeros(len(search.surface.vertices), dtype=bool)
    border[search.table.edges[~search.table.manifold]] = True
    return border


def stars(found: list[Chain], border: NDArray[np.bool_], longest: int) -> list[Star]:
    """The stars of all junctions off the border where three arms or more meet; those of one ring are parts of it."""
    arms: dict[int, list[tuple[int, NDArray[np.int64]]]] = {}
    for number, chain in enumerate(found):
        ring = chain.path[0] == chain.path[-1]
        edges = min(longest, len(chain.edges) // 3) if ring else longest
        for path in (chain.path, chain.path[::-1]):
            arms.setdefault(int(path[0]), []).append((number, path[: edges + 1]))
    met = []
    for vertex, ends in sorted(arms.items()):
        numbers = frozenset(number for number, _ in ends)
        if len(ends) < 3 or min(len(path) for _, path in ends) < 2 or border[vertex]:
            continue
        sides = sorted({side for number in numbers for side in found[number].sides})
        met.append(Star([path for _, path in ends], numbers, tuple(sides)))
    return met


def shortest_star(roads: Roads, star: Star, turning: float) -> list[list[int]]:
    """Paths from the ends of a star's arms to the vertex to which all are near; empty where some would touch."""
    count, ends = len(roads.points), [int(arm[-1]) for arm in star.arms]
    if len(set(ends)) < len(ends):
        return []
    found = [shortest_paths(count, roads.ends, roads.cost, np.array([end])) for end in ends]
    total = np.sum([paths.distance for paths in found], axis=0)
    total[ends] = np.inf
    middle = int(total.argmin())
    if not np.isfinite(total[middle]):
        return []
    straight = [straightest_path(roads, end, middle, turning) for end in ends]
    short = [trace_back(paths.parent, middle)[::-1] for paths in found]
    for ways in (straight, short):
        inner = [vertex for way in ways for vertex in way[:-1]]
        if all(ways) and len(set(inner)) == len(inner):
            return ways
    return []

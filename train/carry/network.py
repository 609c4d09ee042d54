"""The seams of the proxy carried back as a network: junctions to vertices nearby, chains to the cheapest ways between.

So cuts inside a chart keep their places as borders do, and each runs as straight as the edges of the surface allow.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from ...runtime.geometry.cutgraph import edge_costs, path_mask, shortest_paths, trace_back
from ...runtime.geometry.topology import edge_table, face_components
from ..finish.openings import detour
from ..finish.slits import Slit
from ..seams.closing import laid_open, valid
from ..seams.network import chains, seam_edges
from ..search.labels import dual_graph
from ..search.search import Search
from ..workers import parallel_map
from .layout import carried_uv

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Surface
    from ..finish.flaps import Trimmed


def network_carried(surface: Surface, found: Search, winding: float) -> Search | None:
    """The pieces of the proxy on the surface; None where its seams can't all be led there, or a piece is not valid.

    winding: length of a seam, as a multiple of its ends' distance, above which it is led along in parts.
    """
    graph = dual_graph(surface, edge_table(surface.faces), found.config.labels.seams)
    search = Search(surface, graph, found.config)
    seam = carried_seams(search, found, winding)
    if seam is None:
        return None
    pairs = search.table.edge_faces[search.table.manifold & ~seam]
    piece = face_components(len(surface.faces), pairs)
    count = int(piece.max()) + 1
    if count != len(found.pieces):
        return None
    nearest = KDTree(found.centroids).query(search.centroids)[1]
    label = found.label()[nearest]
    sides = [np.flatnonzero(piece == number) for number in range(count)]

    def lay(ids: NDArray[np.int64]) -> Trimmed | None:
        source = found.pieces[int(np.bincount(label[ids]).argmax())]
        part = laid_open(search, ids, seam, np.inf, lambda disk: carried_uv(disk, source.flat, found.config.carry))
        return valid(search, part, found.config.slit.contact.rounds)

    for part in parallel_map(lay, sides):
        if part is None or not search.is_bearable(part.piece):
            return None
        search.add_trimmed(part)
    search.place_loose()
    return search


def carried_seams(search: Search, found: Search, winding: float) -> NDArray[np.bool_] | None:
    """(e,) bool: the seams of the proxy's search on the surface of another; None where one finds no way."""
    points = found.surface.vertices
    ways = [part for chain in chains(found, seam_edges(found)) for part in stretches(chain.path, points, winding)]
    place = places(search, found, sorted({int(end) for way in ways for end in (way[0], way[-1])}))
    if place is None:
        return None
    table, points = search.table, search.surface.vertices
    taken = np.zeros(len(points), dtype=bool)
    taken[table.edges[~table.manifold]] = True
    taken[list(place.values())] = True
    plain = edge_costs(search.surface, table, search.config.slit.seams)
    mask = np.zeros(len(table.edges), dtype=bool)
    for way in sorted(ways, key=len):
        ends = [place[int(way[0])], place[int(way[-1])]]
        barred = taken.copy()
        barred[ends] = False
        free = table.manifold & ~barred[table.edges].any(axis=1) & ~mask
        cost = plain * detour(points[table.edges], Slit(found.surface.vertices[way]))
        paths = shortest_paths(len(points), table.edges[free], cost[free], np.array(ends[:1]))
        if not np.isfinite(paths.distance[ends[1]]):
            return None
        path = trace_back(paths.parent, ends[1])
        mask |= path_mask(table, [path])
        taken[path] = True
    return mask


def stretches(path: NDArray[np.int64], points: NDArray[np.float64], winding: float) -> list[NDArray[np.int64]]:
    """The vertices of a chain, cut in two as long as the way along a part is over ``winding`` times its ends' distance.

    A way that winds comes near itself, where the cheapest one would leave a bend out.
    """
    along = float(np.linalg.norm(points[path[1:]] - points[path[:-1]], axis=1).sum())
    if len(path) <= 2 or along <= winding * float(np.linalg.norm(points[path[-1]] - points[path[0]])):
        return [path]
    half = len(path) // 2
    return [part for end in (path[: half + 1], path[half:]) for part in stretches(end, points, winding)]


def places(search: Search, found: Search, nodes: list[int]) -> dict[int, int] | None:
    """A vertex near each node of the proxy, on the border for one on its border; None where there are too few."""
    sides = []
    for table, surface in ((found.table, found.surface), (search.table, search.surface)):
        border = np.zeros(len(surface.vertices), dtype=bool)
        border[table.edges[~table.manifold]] = True
        sides.append(border)
    place = {}
    for edge in (True, False):
        mine = [node for node in nodes if sides[0][node] == edge]
        theirs = np.flatnonzero(sides[1] == edge)
        if mine and not len(theirs):
            return None
        if mine:
            count = min(found.config.carry.candidates, len(theirs))
            distance, near = KDTree(search.surface.vertices[theirs]).query(found.surface.vertices[mine], k=count)
            shape = len(mine), count
            place |= shared_out(mine, theirs[near].reshape(shape), np.reshape(distance, shape))
    return place if len(place) == len(nodes) else None


def shared_out(nodes: list[int], near: NDArray[np.int64], distance: NDArray[np.float64]) -> dict[int, int]:
    """A vertex of those near (n, c) for each node, none twice, by least distance (n, c) first; some may be left out."""
    place, taken = dict[int, int](), set[int]()
    for at in np.argsort(distance, axis=None, kind="stable").tolist():
        node, vertex = nodes[at // near.shape[1]], int(near.flat[at])
        if node not in place and vertex not in taken:
            place[node] = vertex
            taken.add(vertex)
    return place

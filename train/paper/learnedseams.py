"""Seams of a learned global map: the paper's cut points, and the mesh edges along which the surface is opened.

A network is continuous, so where it tears the surface it leaves a steep *band*: triangles stretched across the gap.
n points · v vertices · f faces · e edges.  uv (v, 2), any units.  The *tear* of an edge is the uv distance from face to
face across it per distance on the surface, over the usual value nearby: 1 where the map is locally a similarity.  A
conformal map may shrink an ear as it likes and has no tear there; a band has tears of ten and more.

The seam is made of shortest paths that find the band cheap (Erickson & Whittlesey 2005 for handles and holes), so it is
thin and straight however wide and ragged the band.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial import KDTree

from ...runtime.errors import ShapeError
from ...runtime.geometry.cutgraph import (
    SeamPrices,
    closing_paths,
    edge_costs,
    path_mask,
    prune,
    shortest_paths,
    trace_back,
)
from ...runtime.geometry.topology import EdgeTable, edge_table
from ...runtime.geometry.triangles import signed_areas
from ..finish.disks import disk_cuts
from ..sampling import sample_surface

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Surface


@dataclass(frozen=True)
class SeamConfig:
    """From a learned band to seam edges.  Lengths are shares of √(area of the piece)."""

    torn: float = 3.0
    """Tear from which an edge lies in the band; paths there cost half, and less the steeper the band."""
    cheapest: float = 0.01
    """Cost per length in the steepest band."""
    prices: SeamPrices = field(default_factory=SeamPrices)
    """What a seam costs outside the band."""
    shortest: float = 0.15
    """Branches that end inside the surface are kept from this length on: they relieve distortion."""
    within: float = 0.6
    """Share of a branch's vertices that must lie in the band."""
    most: int = 24
    """Branches that are tried."""
    samples: int = 4000
    """Surface samples from which the usual stretch nearby is taken …"""
    nearby: int = 200
    """… as a quantile of so many nearest ones, …"""
    quantile: float = 0.25
    """… this one, since a band has too much …"""
    least: float = 0.1
    """… and at least so much of the median over all."""
    counted: int = 10_000
    """Surface samples among which the paper's cut points are counted, so that the count doesn't depend on the mesh."""


class Tears(NamedTuple):
    """Where a map tears.

    edge (e,): the tear across each edge, 0 at the border.  face (f,): the largest of a face's edges.  band (v,) bool:
    ends of torn edges.
    """

    edge: NDArray[np.float64]
    face: NDArray[np.float64]
    band: NDArray[np.bool_]


def cut_points(
    points: NDArray[np.float64], uv: NDArray[np.float64], neighbours: int = 3, share: float = 0.02
) -> NDArray[np.bool_]:
    """Points on the learned seam, as the paper finds them: η > τ (FlexPara, equation of η, section on implementation).

    Args:
        points: (n, 3) surface points, evenly sampled.
        uv: (n, 2) their images.
        neighbours: J_cut, nearest points in space that are looked at.
        share: τ as a share of the side of the square bounding box of uv.

    Returns:
        (n,) bool: the largest uv distance η to the neighbours exceeds τ.

    Raises:
        ShapeError: uv doesn't fit the points.
    """
    if points.ndim != 2 or points.shape[1] != 3 or uv.shape != (len(points), 2):
        raise ShapeError(
            f"expected points (n, 3) and uv (n, 2), got {points.shape} and {uv.shape}; pass one uv a point"
        )
    count = min(neighbours + 1, len(points))
    if count < 2:
        return np.zeros(len(points), dtype=bool)
    nearest = np.reshape(KDTree(points).query(points, k=count)[1], (len(points), count))
    eta = np.linalg.norm(uv[:, None] - uv[nearest], axis=2).max(axis=1)
    return eta > share * float(np.ptp(uv, axis=0).max())


def tears(piece: Surface, uv: NDArray[np.float64], config: SeamConfig, table: EdgeTable | None = None) -> Tears:
    """The tears of a map of a manifold piece, uv (v, 2)."""
    table = table or edge_table(piece.faces)
    inside = np.flatnonzero(table.manifold)
    i, j = table.edge_faces[inside].T
    centre, flat = piece.triangles.mean(axis=1), uv[piece.faces].mean(axis=1)
    middle = piece.vertices[table.edges[inside]].mean(axis=1)
    apart = np.linalg.norm(centre[i] - middle, axis=1) + np.linalg.norm(centre[j] - middle, axis=1)
    stretch = np.linalg.norm(flat[i] - flat[j], axis=1) / np.maximum(apart, 1e-300)
    edge = np.zeros(len(table.edges))
    least = 1e-6 * float(stretch.max(initial=0.0)) + 1e-300  # a map that collapses has no usual stretch
    edge[inside] = stretch / np.maximum(usual_stretch(piece, uv, middle, config), least)
    band = np.zeros(len(piece.vertices), dtype=bool)
    band[table.edges[edge > config.torn]] = True
    return Tears(edge, edge[table.face_edges].max(axis=1), band)


def usual_stretch(
    piece: Surface, uv: NDArray[np.float64], places: NDArray[np.float64], config: SeamConfig
) -> NDArray[np.float64]:
    """(m,) √(uv area / area) around places (m, 3): a low quantile, as bands have too much; never near 0."""
    flat = np.abs(signed_areas(uv[piece.faces]))
    scale = np.sqrt(flat / np.maximum(piece.face_areas(), 1e-300))
    samples = sample_surface(piece, config.samples, np.random.default_rng(0))  # fixed: seams follow from the map alone
    value = scale[samples.face]
    local = np.quantile(value[KDTree(samples.xyz).query(samples.xyz, k=config.nearby)[1]], config.quantile, axis=1)
    return np.maximum(local, config.least * float(np.median(value)))[KDTree(samples.xyz).query(places)[1]]


def seam_edges(piece: Surface, uv: NDArray[np.float64], config: SeamConfig = SeamConfig()) -> NDArray[np.bool_]:
    """The mesh edges along the learned band that, cut open, leave one disk.

    Args:
        piece: one connected oriented manifold, any genus, any number of boundary loops.
        uv: (v, 2) its image under the learned map.
        config: numbers.

    Returns:
        (e,) bool over ``edge_table(piece.faces)``.  Handles and holes are opened along the band where it leads there,
        elsewhere along short paths; long branches of the band that end inside the piece are kept.
    """
    table = edge_table(piece.faces)
    torn = tears(piece, uv, config, table)
    plain = edge_costs(piece, table, config.prices)
    cost = plain * np.maximum(1.0 / (1.0 + (torn.edge / config.torn) ** 2), config.cheapest)
    border = np.unique(table.edges[table.edge_count == 1])
    root = border if len(border) else np.array([far_end(piece, table, torn)])
    paths = shortest_paths(len(piece.vertices), table.edges, cost, root)
    mask = path_mask(table, closing_paths(table, cost, paths))
    if len(border) == 0:
        mask = prune(table, mask)
    start = np.union1d(border, table.edges[mask]) if mask.any() or len(border) else root
    mask = mask | path_mask(table, branches(piece, table, torn.band, cost, start, config))
    if len(border) == 0 and mask.sum() < 2:  # a closed piece without handles, and no band to open it along
        return far_cut(piece, table, plain, config)
    return mask


def far_cut(piece: Surface, table: EdgeTable, cost: NDArray[np.float64], config: SeamConfig) -> NDArray[np.bool_]:
    """(e,) bool: a shortest path between two far vertices of a closed piece without handles."""
    first = int(shortest_paths(len(piece.vertices), table.edges, cost, np.array([0])).distance.argmax())
    paths = shortest_paths(len(piece.vertices), table.edges, cost, np.array([first]))
    path = trace_back(paths.parent, int(paths.distance.argmax()))
    # one edge alone opens nothing
    return path_mask(table, [path]) if len(path) > 2 else disk_cuts(piece, table, config.prices)


def far_end(piece: Surface, table: EdgeTable, torn: Tears) -> int:
    """A vertex at an end of the steepest band: the one farthest from its steepest place, within the band."""
    if not torn.band.any():
        return 0
    ends = piece.vertices[table.edges]
    length = np.maximum(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), 1e-300)
    inside = torn.band[table.edges].all(axis=1)
    steepest = table.edges[int(torn.edge.argmax()), :1]
    distance = shortest_paths(len(piece.vertices), table.edges[inside], length[inside], steepest).distance
    return int(np.where(np.isfinite(distance), distance, -1.0).argmax())


def branches(
    piece: Surface,
    table: EdgeTable,
    band: NDArray[np.bool_],
    cost: NDArray[np.float64],
    start: NDArray[np.int64],
    config: SeamConfig,
) -> list[list[int]]:
    """Paths along the long branches of the band (v,), longest first; each begins on the seam or border, start (b,)."""
    found: list[list[int]] = []
    ends = piece.vertices[table.edges]
    length = np.maximum(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), 1e-300)
    shortest = config.shortest * float(np.sqrt(piece.face_areas().sum()))
    open_ends = band.copy()
    for _ in range(config.most):
        distance = shortest_paths(len(piece.vertices), table.edges, length, start).distance
        distance = np.where(open_ends & np.isfinite(distance), distance, 0.0)
        target = int(distance.argmax())
        if distance[target] < shortest:
            break
        path = trace_back(shortest_paths(len(piece.vertices), table.edges, cost, start).parent, target)
        if len(path) > 2 and band[path].mean() >= config.within:
            found.append(path)
            start = np.union1d(start, path)
        else:
            open_ends &= np.linalg.norm(piece.vertices - piece.vertices[target], axis=1) > shortest
    return found

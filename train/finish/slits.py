"""Slits: a chart that no disk can carry without stretch is slit from its border to where it hurts.

A cut leaves the flattening as it is (both sides keep their uv), so SLIM goes on from there and opens the slit.
Lengths and areas are shares: length / √(area of the whole surface), area / (area of the whole surface).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import sparse

from ...runtime.geometry.cutgraph import PLAIN, counted_length
from ...runtime.geometry.distortion import excess, oriented_energy
from ...runtime.geometry.topology import EdgeTable, edge_table
from ...runtime.mesh import Surface
from ...runtime.pack.exact.seamvertices import split_vertices
from .contact import Relaxed, excess_energy, relax
from .curvature import Curvature, foretold_energies
from .disks import ShortestPaths, cut_open, edge_costs, path_mask, shortest_paths, trace_back
from .flatten import jacobians
from .scaffold import relaxed_within

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from ...runtime.geometry.cutgraph import SeamPrices
    from .config import ContactConfig, SlitConfig


class Flat(NamedTuple):
    """A flattened piece, without flips and overlap.  pins: contacts that hold it apart, by vertex."""

    surface: Surface
    uv: NDArray[np.float64]
    pins: dict[int, NDArray[np.float64]]

    @classmethod
    def of(cls, surface: Surface, ids: NDArray[np.int64], corner_uv: NDArray[np.float64]) -> Flat:
        """Faces ids (m,) with uv (m, 3, 2) of their corners, each vertex once for each uv it has."""
        faces, source, uv = split_vertices(surface.faces[ids], np.zeros(len(ids), np.int64), corner_uv)
        return cls(Surface(surface.vertices[source], faces), uv, {})

    def relaxed(self, config: ContactConfig, *, goal: float = np.inf) -> Flat:
        """The piece after SLIM, still valid; unchanged where the goal (excess energy) is out of sight."""
        if config.scaffold.rounds:
            return self._replace(uv=relaxed_within(self.surface, self.uv, config, goal))
        state = relax(self.surface, Relaxed(self.uv, self.pins), config, goal=goal)
        return self._replace(uv=state.uv, pins=state.pins)


def stress(flat: Flat, table: EdgeTable, radius: float, rings: int) -> NDArray[np.float64]:
    """(v,) excess energy density around each vertex, smoothed over about ``radius`` (source units), at most ``rings``.

    Only squeezed faces count: a slit lets a cone open; at a saddle, which is stretched, its two sides would overlap.
    """
    faces, count = flat.surface.faces, len(flat.surface.vertices)
    areas = flat.surface.face_areas()
    mass = np.bincount(faces.reshape(-1), np.repeat(areas, 3), minlength=count)
    jacobian = jacobians(flat.surface, flat.uv)
    energy, squeezed = excess(oriented_energy(jacobian)), np.linalg.det(jacobian) < 1.0
    load = np.bincount(faces.reshape(-1), np.repeat(areas * energy * squeezed, 3), minlength=count)
    ends = flat.surface.vertices[table.edges]
    spacing = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean())
    i, j = table.edges.T
    links = sparse.coo_array(
        (np.ones(2 * len(i)), (np.concatenate([i, j]), np.concatenate([j, i]))), shape=(count, count)
    )
    links = (links + sparse.eye_array(count)).tocsr()
    links = sparse.diags_array(1.0 / links.sum(axis=0)) @ links  # columns pass on all they have
    for _ in range(int(np.clip((radius / spacing) ** 2, 1, rings))):
        mass, load = links.T @ mass, links.T @ load
    return load / np.maximum(mass, 1e-300)


class Slit(NamedTuple):
    """A cut inside a piece, by its points in space (n, 3): from a border vertex to an inner one.

    through: it ends on a border too, of another hole or across a handle, and opens what is not a disk.
    """

    points: NDArray[np.float64]
    through: bool = False

    @property
    def length(self) -> float:
        """Length of the polyline, in source units."""
        return float(np.linalg.norm(self.points[1:] - self.points[:-1], axis=1).sum())

    @property
    def step(self) -> float:
        """Mean distance between its points."""
        return self.length / max(len(self.points) - 1, 1)


def slit_to(flat: Flat, path: list[int], table: EdgeTable) -> Flat:
    """The piece slit along a vertex path that begins or ends on its border; both sides keep their uv."""
    faces, old = cut_open(flat.surface.faces, path_mask(table, [path]), table)
    pins = {new: flat.pins[vertex] for new, vertex in enumerate(old.tolist()) if vertex in flat.pins}
    return Flat(Surface(flat.surface.vertices[old], faces), flat.uv[old], pins)


def border_paths(surface: Surface, table: EdgeTable, sources: NDArray[np.int64], config: SlitConfig) -> ShortestPaths:
    """Cheapest ways from the source vertices (b,) to each vertex."""
    cost = edge_costs(surface, table, config.seams)
    return shortest_paths(len(surface.vertices), table.edges, cost, sources)


def most_stressed(
    flat: Flat,
    table: EdgeTable,
    distance: NDArray[np.float64],
    spared: list[NDArray[np.float64]],
    unit: float,
    config: SlitConfig,
) -> int | None:
    """The vertex a slit should lead to: no closer to the border than ``config.near``, and 2 radii from spared points.

    ``unit``: √(surface area).
    """
    reach = config.radius * unit
    pressure = stress(flat, table, reach, config.rings)
    pressure[~(distance >= config.near * unit)] = 0.0
    for point in spared:
        pressure[np.linalg.norm(flat.surface.vertices - point, axis=1) < 2.0 * reach] = 0.0
    target = int(pressure.argmax())
    return target if pressure[target] > 0.0 else None


def candidate_paths(surface: Surface, table: EdgeTable, target: int, config: SlitConfig) -> Iterator[list[int]]:
    """Ways from the border to a vertex: the cheapest, then one from elsewhere, which unrolls to the other side."""
    border = np.unique(table.edges[table.edge_count == 1])
    sources = border
    for _ in range(config.ways):
        if len(sources) == 0:
            return
        paths = border_paths(surface, table, sources, config)
        if not np.isfinite(paths.distance[target]):
            return
        path = trace_back(paths.parent, target)
        # a way that touches the border before its source would cut the piece in two: it starts where it last does
        path = path[: int(np.isin(path, border).argmax()) + 1]
        yield path
        start = surface.vertices[path[-1]]
        apart = config.apart * path_length(surface, path)
        sources = sources[np.linalg.norm(surface.vertices[sources] - start, axis=1) > apart]


def path_length(surface: Surface, path: list[int], prices: SeamPrices = PLAIN) -> float:
    """Length of a vertex path, in source units, as the objective counts it at these prices."""
    points = surface.vertices[path]
    return counted_length(np.stack([points[:-1], points[1:]], axis=1), prices)


def slit_where_it_pays(flat: Flat, total_area: float, config: SlitConfig) -> tuple[Flat, tuple[Slit, ...]]:
    """The piece with every slit that pays, and those slits.

    A slit pays where it lowers the excess by more than ``config.price`` times its length.  Greedy: slit to the most
    stressed vertex, run SLIM, keep the slit if it paid, else leave that neighbourhood alone.
    """
    unit = float(np.sqrt(total_area))
    spared: list[NDArray[np.float64]] = []
    slits: list[Slit] = []
    energy = excess_energy(flat.surface, flat.uv) / total_area
    while len(spared) < config.failures and len(slits) < config.most and energy > config.price * config.shortest:
        table = edge_table(flat.surface.faces)
        border = np.unique(table.edges[table.edge_count == 1])
        distance = border_paths(flat.surface, table, border, config).distance
        target = most_stressed(flat, table, distance, spared, unit, config)
        if target is None:
            break
        point = flat.surface.vertices[target]
        found = best_slit(flat, table, target, energy, total_area, config)
        if found is None:
            spared.append(point)
            continue
        flat, slit = found
        energy = excess_energy(flat.surface, flat.uv) / total_area
        slits.append(slit)
    return flat, tuple(slits)


def best_slit(
    flat: Flat, table: EdgeTable, target: int, energy: float, total_area: float, config: SlitConfig
) -> tuple[Flat, Slit] | None:
    """The first way to slit to a vertex that pays; ``energy`` is the piece's share of excess before."""
    for path in candidate_paths(flat.surface, table, target, config):
        length = path_length(flat.surface, path, config.seams) / float(np.sqrt(total_area))
        needed = energy - config.price * max(length, config.shortest)
        trial = slit_to(flat, path, table).relaxed(config.contact, goal=needed * total_area)
        if excess_energy(trial.surface, trial.uv) < needed * total_area:
            return trial, Slit(flat.surface.vertices[path[::-1]])
    return None


def foreseen_slits(curvature: Curvature, total_area: float, config: SlitConfig) -> tuple[Surface, tuple[Slit, ...]]:
    """The disk with the slits that its curvature asks for before anything is flattened, and those slits.

    Greedy: slit to the vertex that a conformal map would squeeze most, as long as the energy foretold falls by
    ``config.sure`` times what the slit costs.  To fix u = 0 along a path is to open it: all are cut at the end.
    """
    surface = curvature.surface
    unit, count = float(np.sqrt(total_area)), len(surface.vertices)
    table = edge_table(surface.faces)
    cost = edge_costs(surface, table, config.seams)
    rim = border_of(table, count)
    u = curvature.factor(rim)
    areas = surface.face_areas()
    energy = float(foretold_energies(surface.faces, areas, u).sum()) / total_area
    paths: list[list[int]] = []
    spared: list[NDArray[np.float64]] = []
    while len(spared) < config.failures and len(paths) < config.foreseen and energy > config.price * config.shortest:
        ways = shortest_paths(count, table.edges, cost, np.flatnonzero(rim))
        tip = lowest_factor(surface, u, ways.distance, spared, config.near * unit)
        if tip is None:
            break
        path = trace_back(ways.parent, tip)
        wider = rim.copy()
        wider[path] = True
        trial = curvature.factor(wider)
        left = float(foretold_energies(surface.faces, areas, trial).sum()) / total_area
        length = path_length(surface, path, config.seams) / unit
        if energy - left < config.sure * config.price * max(length, config.shortest):
            spared.append(surface.vertices[tip])
            continue
        rim, u, energy = wider, trial, left
        paths.append(path)
    if not paths:
        return surface, ()
    faces, old = cut_open(surface.faces, path_mask(table, paths), table)
    return Surface(surface.vertices[old], faces), tuple(Slit(surface.vertices[path[::-1]]) for path in paths)


def border_of(table: EdgeTable, count: int) -> NDArray[np.bool_]:
    """(v,) bool: the vertex lies on the border."""
    border = np.zeros(count, dtype=bool)
    border[table.edges[table.edge_count == 1]] = True
    return border


def lowest_factor(
    surface: Surface,
    u: NDArray[np.float64],
    distance: NDArray[np.float64],
    spared: list[NDArray[np.float64]],
    near: float,
) -> int | None:
    """The vertex of lowest u, at least ``near`` off the border and 2 · near off spared points; None where u ≥ 0."""
    pressure = np.where(np.isfinite(distance) & (distance >= near), -u, 0.0)
    for point in spared:
        pressure[np.linalg.norm(surface.vertices - point, axis=1) < 2.0 * near] = 0.0
    tip = int(pressure.argmax())
    return tip if pressure[tip] > 0.0 else None

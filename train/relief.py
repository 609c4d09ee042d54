"""Relief cuts: a chart that no disk can carry without stretch is slit from its border to where it hurts.

A cut leaves the flattening as it is (both sides keep their uv), so SLIM goes on from there, flip-free, and opens the slit.
Lengths and areas are shares: length / √(area of the whole surface), area / (area of the whole surface).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import sparse

from ..runtime.mesh import Surface
from ..runtime.topology import EdgeTable, edge_table
from .contact import Relaxed, excess_energy, relax
from .disks import ShortestPaths, cut_open, edge_costs, path_mask, shortest_paths, trace_back
from .flatten import jacobians, symmetric_dirichlet

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .config import ContactConfig, ReliefConfig


class Flat(NamedTuple):
    """A flattened piece, without flips and overlap.  pins: contacts that hold it apart, by vertex."""

    surface: Surface
    uv: NDArray[np.float64]
    pins: dict[int, NDArray[np.float64]]

    def relaxed(self, config: ContactConfig, *, goal: float = np.inf) -> Flat:
        """The piece after SLIM, still valid; unchanged where the goal (excess energy, source units squared) is out of sight."""
        state = relax(self.surface, Relaxed(self.uv, self.pins), config, goal=goal)
        return self._replace(uv=state.uv, pins=state.pins)


def stress(flat: Flat, table: EdgeTable, radius: float) -> NDArray[np.float64]:
    """(v,) excess energy density around each vertex, smoothed over about ``radius`` (source units).

    Only squeezed faces count: a slit lets a cone open; at a saddle, which is stretched, its two sides would overlap.
    """
    faces, count = flat.surface.faces, len(flat.surface.vertices)
    areas = flat.surface.face_areas()
    mass = np.bincount(faces.reshape(-1), np.repeat(areas, 3), minlength=count)
    energy = np.minimum(symmetric_dirichlet(jacobians(flat.surface, flat.uv)) - 1.0, 10.0)
    squeezed = np.linalg.det(jacobians(flat.surface, flat.uv)) < 1.0
    load = np.bincount(faces.reshape(-1), np.repeat(areas * energy * squeezed, 3), minlength=count)
    ends = flat.surface.vertices[table.edges]
    spacing = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean())
    i, j = table.edges.T
    links = sparse.coo_array(
        (np.ones(2 * len(i)), (np.concatenate([i, j]), np.concatenate([j, i]))), shape=(count, count)
    )
    links = (links + sparse.eye_array(count)).tocsr()
    links = sparse.diags_array(1.0 / links.sum(axis=0)) @ links  # columns pass on all they have
    for _ in range(int(np.clip((radius / spacing) ** 2, 1, 60))):
        mass, load = links.T @ mass, links.T @ load
    return load / np.maximum(mass, 1e-300)


def slit_to(flat: Flat, target: int, paths: ShortestPaths, table: EdgeTable) -> Flat:
    """The piece slit along the path tree from its boundary to a vertex; both sides keep their uv."""
    cut = path_mask(table, [trace_back(paths.parent, target)])
    faces, old = cut_open(flat.surface.faces, cut, table)
    pins = {new: flat.pins[vertex] for new, vertex in enumerate(old.tolist()) if vertex in flat.pins}
    return Flat(Surface(flat.surface.vertices[old], faces), flat.uv[old], pins)


def border_paths(surface: Surface, table: EdgeTable, config: ReliefConfig) -> ShortestPaths:
    """Cheapest ways from the boundary to each vertex."""
    boundary = np.unique(table.edges[table.edge_count == 1])
    cost = edge_costs(surface, table, config.crease_discount)
    return shortest_paths(len(surface.vertices), table.edges, cost, boundary)


def next_slit(
    flat: Flat, spared: list[NDArray[np.float64]], unit: float, config: ReliefConfig
) -> tuple[Flat, float, NDArray[np.float64]] | None:
    """The piece slit to its most stressed vertex: (piece, length / unit, that vertex's position), or None.

    ``spared``: points around which (2 · config.radius · unit) no slit is tried.
    """
    surface = flat.surface
    table = edge_table(surface.faces)
    paths = border_paths(surface, table, config)
    pressure = stress(flat, table, config.radius * unit)
    pressure[~(paths.distance >= config.near * unit)] = 0.0
    for point in spared:
        pressure[np.linalg.norm(surface.vertices - point, axis=1) < 2.0 * config.radius * unit] = 0.0
    target = int(pressure.argmax())
    if pressure[target] <= 0.0:
        return None
    points = surface.vertices[trace_back(paths.parent, target)]
    length = float(np.linalg.norm(points[1:] - points[:-1], axis=1).sum()) / unit
    return slit_to(flat, target, paths, table), length, surface.vertices[target]


def slit_along(surface: Surface, targets: list[NDArray[np.float64]], config: ReliefConfig) -> Surface:
    """The piece slit to the vertices nearest to the targets, in their order; targets on its border ask for nothing."""
    flat = Flat(surface, np.zeros((len(surface.vertices), 2)), {})
    for target in targets:
        table = edge_table(flat.surface.faces)
        paths = border_paths(flat.surface, table, config)
        nearest = int(np.linalg.norm(flat.surface.vertices - target, axis=1).argmin())
        flat = slit_to(flat, nearest, paths, table)
    return flat.surface


def relieve(flat: Flat, total_area: float, config: ReliefConfig) -> tuple[Flat, list[NDArray[np.float64]]]:
    """The piece with every slit that pays, and the points they lead to.

    A slit pays where it lowers the excess by more than ``config.price`` times its length.  Greedy: slit to the most stressed
    vertex, run SLIM, keep the slit if it paid, else leave that neighbourhood alone.
    """
    unit = float(np.sqrt(total_area))
    spared: list[NDArray[np.float64]] = []
    targets: list[NDArray[np.float64]] = []
    energy = excess_energy(flat.surface, flat.uv) / total_area
    while len(spared) < config.failures and len(targets) < config.most and energy > config.price * config.shortest:
        found = next_slit(flat, spared, unit, config)
        if found is None:
            break
        trial, length, point = found
        needed = energy - config.price * max(length, config.shortest)
        trial = trial.relaxed(config.contact, goal=needed * total_area)
        lowered = excess_energy(trial.surface, trial.uv) / total_area
        if lowered < needed:
            flat, energy = trial, lowered
            targets.append(point)
        else:
            spared.append(point)
    return flat, targets

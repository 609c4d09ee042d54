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
from .contact import Relaxed, relax
from .disks import cut_open, edge_costs, path_mask, shortest_paths, trace_back
from .flatten import jacobians, symmetric_dirichlet

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .config import ContactConfig, ReliefConfig


class Flat(NamedTuple):
    """A flattened piece, without flips and overlap.  pins: contacts that hold it apart, by vertex."""

    surface: Surface
    uv: NDArray[np.float64]
    pins: dict[int, NDArray[np.float64]]

    def relaxed(self, iterations: int, config: ContactConfig) -> Flat:
        """The piece after so many SLIM iterations, still valid."""
        state = relax(self.surface, Relaxed(self.uv, self.pins), iterations, config)
        return self._replace(uv=state.uv, pins=state.pins)


def excess(flat: Flat) -> NDArray[np.float64]:
    """(f,) symmetric Dirichlet energy above isometry, capped at 10 so that one sliver decides nothing."""
    return np.minimum(symmetric_dirichlet(jacobians(flat.surface, flat.uv)) - 1.0, 10.0)


def stress(flat: Flat, table: EdgeTable, radius: float) -> NDArray[np.float64]:
    """(v,) excess energy density around each vertex, smoothed over about ``radius`` (source units).

    Only squeezed faces count: a slit lets a cone open; at a saddle, which is stretched, its two sides would overlap.
    """
    faces, count = flat.surface.faces, len(flat.surface.vertices)
    areas = flat.surface.face_areas()
    mass = np.bincount(faces.reshape(-1), np.repeat(areas, 3), minlength=count)
    squeezed = np.linalg.det(jacobians(flat.surface, flat.uv)) < 1.0
    load = np.bincount(faces.reshape(-1), np.repeat(areas * excess(flat) * squeezed, 3), minlength=count)
    ends = flat.surface.vertices[table.edges]
    spacing = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean())
    i, j = table.edges.T
    links = sparse.coo_array((np.ones(2 * len(i)), (np.concatenate([i, j]), np.concatenate([j, i]))), shape=(count, count))
    links = (links + sparse.eye_array(count)).tocsr()
    links = sparse.diags_array(1.0 / links.sum(axis=0)) @ links  # columns pass on all they have
    for _ in range(int(np.clip((radius / spacing) ** 2, 1, 60))):
        mass, load = links.T @ mass, links.T @ load
    return load / np.maximum(mass, 1e-300)


def slit(flat: Flat, spared: list[NDArray[np.float64]], unit: float, config: ReliefConfig) -> tuple[Flat, float, int] | None:
    """The piece slit from its boundary to its most stressed vertex: (piece, length / unit, that vertex), or None.

    ``spared``: points around which (2 · config.radius · unit) no slit is tried.
    """
    surface = flat.surface
    table = edge_table(surface.faces)
    boundary = np.unique(table.edges[table.edge_count == 1])
    pressure = stress(flat, table, config.radius * unit)
    pressure[boundary] = 0.0
    for point in spared:
        pressure[np.linalg.norm(surface.vertices - point, axis=1) < 2.0 * config.radius * unit] = 0.0
    target = int(pressure.argmax())
    if pressure[target] <= 0.0:
        return None
    cost = edge_costs(surface, table, config.crease_discount)
    path = trace_back(shortest_paths(len(surface.vertices), table.edges, cost, boundary).parent, target)
    points = surface.vertices[path]
    length = float(np.linalg.norm(points[1:] - points[:-1], axis=1).sum()) / unit
    faces, old = cut_open(surface.faces, path_mask(table, [path]), table)
    pins = {new: flat.pins[vertex] for new, vertex in enumerate(old.tolist()) if vertex in flat.pins}
    return Flat(Surface(surface.vertices[old], faces), flat.uv[old], pins), length, target


def relieve(flat: Flat, total_area: float, config: ReliefConfig) -> Flat:
    """The piece with every slit that pays: each lowers the excess by more than ``config.price`` times its length.

    Greedy: slit to the most stressed vertex, run SLIM, keep the slit if it paid, else leave that neighbourhood alone.
    """
    unit = float(np.sqrt(total_area))
    spared: list[NDArray[np.float64]] = []
    cuts = 0
    energy = float(flat.surface.face_areas() @ excess(flat)) / total_area
    while len(spared) < config.failures and cuts < config.most and energy > config.price * config.shortest:
        found = slit(flat, spared, unit, config)
        if found is None:
            break
        trial, length, target = found
        point = flat.surface.vertices[target]
        trial = trial.relaxed(config.iterations, config.contact)
        lowered = float(trial.surface.face_areas() @ excess(trial)) / total_area
        if energy - lowered > config.price * max(length, config.shortest):
            flat, energy, cuts = trial, lowered, cuts + 1
        else:
            spared.append(point)
    return flat

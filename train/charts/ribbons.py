"""Ribbons: parts that are one strip of triangles, as hair, grass, belts and tape are; each becomes one straight chart.

A ribbon unrolls without stretch into a strip that is curved as it is in its own surface.  Where that strip would fill
little of the page, it is bent straight: lengths along its middle and across it stay, and only what lies beside the
middle is stretched, the less the thinner it is.   f faces · f − 1 rungs: the edges between one triangle and the next.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.overlap import flipped_triangles
from ...runtime.mesh import Surface
from ..finish.contact import excess_energy
from .develop import Development, unfold

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.geometry.topology import EdgeTable
    from ..config import PlanarConfig


def ribbon(
    surface: Surface, table: EdgeTable, region: NDArray[np.int64], config: PlanarConfig, side: float
) -> list[Development]:
    """The part of flat regions (f,) as one development, if it is a ribbon that fits the page; else nothing.

    side: of the page, √(area of all parts) in the units of this one.
    """
    walk = rungs(surface, table)
    if walk is None:
        return []
    found = unfold(surface, table, region, replace(config, shared=0.0, fill=0.0, aspect=np.inf), side)
    if len(found) != 1:
        return []
    (whole,) = found
    if whole.fill < config.fill:
        uv = straight(surface.faces, whole.uv, walk)
        if flipped_triangles(uv).any() or stretch(surface, uv) > config.bent_straight:
            return []
        whole = replace(whole, uv=uv)
    return [whole] if float(whole.box[0]) <= config.span * max(side, float(np.sqrt(surface.face_areas().sum()))) else []


def rungs(surface: Surface, table: EdgeTable) -> NDArray[np.int64] | None:
    """(f − 1, 2) ends of the edges between the triangles of a strip, left and right, in its order; None for others."""
    pairs = table.edge_faces[table.manifold]
    count = len(surface.faces)
    degree = np.bincount(pairs.reshape(-1), minlength=count)
    if count < 2 or len(pairs) != count - 1 or degree.max() > 2:
        return None
    around: list[list[int]] = [[] for _ in range(count)]
    for edge in np.flatnonzero(table.manifold).tolist():
        for face in table.edge_faces[edge].tolist():
            around[face].append(edge)
    face, edge, order = int(np.flatnonzero(degree == 1)[0]), -1, list[int]()
    while more := [each for each in around[face] if each != edge]:
        edge = more[0]
        order.append(edge)
        face = int(table.edge_faces[edge].sum()) - face
    ends = table.edges[np.array(order)]
    if len(order) != count - 1:
        return None
    first = surface.faces[int(np.flatnonzero(degree == 1)[0])]
    turn = np.roll(first, -int(np.flatnonzero(~np.isin(first, ends[0]))[0]))  # the corner that is on no rung leads
    ends[0] = turn[[2, 1]]
    for number in range(1, len(ends)):
        stays = ends[number] == ends[number - 1]
        if not stays.any():
            ends[number] = ends[number, ::-1]
    return ends


def straight(faces: NDArray[np.int64], uv: NDArray[np.float64], walk: NDArray[np.int64]) -> NDArray[np.float64]:
    """(f, 3, 2) uv of a strip of triangles bent straight along the middles of its rungs (f − 1, 2)."""
    place = np.zeros((int(faces.max()) + 1, 2))
    place[faces] = uv
    middle = place[walk].mean(axis=1)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(middle, axis=0), axis=1))])
    first, last = np.full(len(place), len(walk)), np.full(len(place), -1)
    for end in walk.T:
        np.minimum.at(first, end, np.arange(len(walk)))
        np.maximum.at(last, end, np.arange(len(walk)))
    tips = np.flatnonzero(last < 0)  # the corners of the first and the last triangle that are on no rung
    near = np.linalg.norm(place[tips, None] - middle[[0, -1]], axis=2).argmin(axis=1)
    first[tips] = last[tips] = np.array([0, len(walk) - 1])[near]
    centre, reach = (middle[first] + middle[last]) / 2.0, (along[first] + along[last]) / 2.0
    way = middle[np.minimum(last + 1, len(walk) - 1)] - middle[np.maximum(first - 1, 0)]
    if len(walk) == 1:
        way = np.broadcast_to(place[walk[0, 0]] - place[walk[0, 1]], place.shape) @ np.array([[0.0, -1.0], [1.0, 0.0]])
    way = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-300)
    offset = place - centre
    across = way[:, 0] * offset[:, 1] - way[:, 1] * offset[:, 0]
    return np.stack([reach + (way * offset).sum(axis=1), across], axis=1)[faces]


def stretch(surface: Surface, uv: NDArray[np.float64]) -> float:
    """Mean excess energy of uv (f, 3, 2)."""
    flat = np.zeros((len(surface.vertices), 2))
    flat[surface.faces] = uv
    return excess_energy(surface, flat) / float(surface.face_areas().sum())

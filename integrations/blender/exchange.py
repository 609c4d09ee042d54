# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes as flexpara reads them, and its answers as Blender wants them: a uv for each loop of each polygon.

v vertices · p polygons · l loops (corners of polygons, one polygon after the other) · f triangles of the answer.
numpy only: nothing here knows Blender.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

SAME_UV = 1e-6


@dataclass(frozen=True, eq=False)
class Mesh:
    """Polygons.

    positions: (v, 3) float64.  loop_vertex: (l,) int32.  size: (p,) int32.  uv: (l, 2) float64 or None.
    """

    positions: NDArray[np.float64]
    loop_vertex: NDArray[np.int32]
    size: NDArray[np.int32]
    uv: NDArray[np.float64] | None = None

    @property
    def start(self) -> NDArray[np.int64]:
        """(p,) the first loop of each polygon."""
        return np.cumsum(self.size) - self.size

    @property
    def loop_polygon(self) -> NDArray[np.int64]:
        """(l,) the polygon of each loop."""
        return np.repeat(np.arange(len(self.size)), self.size)


class Answer(NamedTuple):
    """What came back.

    uv: (l, 2) float32.  chart: (p,) int64, −1 where there is none.  answered: (l,) bool.  cut: polygons with a seam
    through them, which lie in their largest chart as a whole.
    """

    uv: NDArray[np.float32]
    chart: NDArray[np.int64]
    answered: NDArray[np.bool_]
    cut: int


def joined(meshes: list[Mesh]) -> Mesh:
    """Several meshes as one, in their order."""
    first = np.cumsum([0, *(len(mesh.positions) for mesh in meshes)])
    with_uv = [mesh.uv for mesh in meshes if mesh.uv is not None]
    return Mesh(
        np.concatenate([mesh.positions for mesh in meshes]),
        np.concatenate([mesh.loop_vertex + start for mesh, start in zip(meshes, first[:-1], strict=True)]),
        np.concatenate([mesh.size for mesh in meshes]),
        np.concatenate(with_uv) if len(with_uv) == len(meshes) else None,
    )


def part_of(mesh: Mesh, chosen: NDArray[np.bool_]) -> Mesh:
    """Some polygons (p,) of a mesh, with all its vertices."""
    loops = np.repeat(chosen, mesh.size)
    uv = None if mesh.uv is None else mesh.uv[loops]
    return Mesh(mesh.positions, mesh.loop_vertex[loops], mesh.size[chosen], uv)


def write_ply(mesh: Mesh, path: Path) -> None:
    """Write a binary PLY file of polygons, uv per corner where there are any."""
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(mesh.positions)}"]
    lines += [f"property double {axis}" for axis in "xyz"]
    lines += [f"element face {len(mesh.size)}", "property list int int vertex_indices"]
    lines += ["property list int float texcoord"] * (mesh.uv is not None)
    with path.open("wb") as file:
        file.write(("\n".join([*lines, "end_header"]) + "\n").encode("ascii"))
        file.write(np.ascontiguousarray(mesh.positions, "<f8").tobytes())
        file.write(_rows(mesh).tobytes())


def _rows(mesh: Mesh) -> NDArray[np.int32]:
    """Number of corners and corners of each polygon, then number of coordinates and those, all four bytes wide."""
    with_uv = 0 if mesh.uv is None else 2
    width = mesh.size * (1 + with_uv) + 1 + bool(with_uv)
    row = np.cumsum(width) - width
    values = np.zeros(int(width.sum()), "<i4")
    values[row] = mesh.size
    corner = np.arange(len(mesh.loop_vertex)) - np.repeat(mesh.start, mesh.size)
    values[np.repeat(row, mesh.size) + 1 + corner] = mesh.loop_vertex
    if mesh.uv is not None:
        values[row + 1 + mesh.size] = 2 * mesh.size
        place = np.repeat(row + 2 + mesh.size, mesh.size) + 2 * corner
        bits = np.ascontiguousarray(mesh.uv, "<f4").view("<i4")
        values[place], values[place + 1] = bits[:, 0], bits[:, 1]
    return values


def write_cuts(ends: NDArray[np.float64], path: Path) -> None:
    """Write the ends (s, 2, 3) of edges to be cut, one edge a line, as flexpara unwrap --cut reads them."""
    lines = (" ".join(map(repr, row)) for row in ends.reshape(-1, 6).tolist())
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def fan_centres(mesh: Mesh) -> NDArray[np.float64]:
    """(n, 3) centres of the triangles of each polygon's fans, whichever corner they begin at."""
    found = [np.zeros((0, 3))]
    for size in np.unique(mesh.size).tolist():
        corners = mesh.positions[mesh.loop_vertex[mesh.start[mesh.size == size, None] + np.arange(size)]]
        apex, first, second = corners[:, :, None], corners[:, None], np.roll(corners, -1, axis=1)[:, None]
        found.append(((apex + first + second) / 3.0).reshape(-1, 3))
    return np.concatenate(found)


def read_answer(path: Path, mesh: Mesh) -> Answer:
    """The uv of each loop, out of an npz file that flexpara wrote of the mesh."""
    with np.load(path, allow_pickle=False) as found:
        faces, uv, charts, polygons = (found[name] for name in ("faces", "uv", "charts", "polygons"))
        positions = found["positions"][faces.reshape(-1)]
    largest = _largest_chart(charts, polygons, len(mesh.size))
    loop = _loops_of_corners(mesh, np.repeat(polygons, 3), positions)
    corner_uv = uv[faces.reshape(-1)]
    own = (np.repeat(charts == largest[polygons], 3)) & (loop >= 0)
    answer, answered = np.zeros((len(mesh.loop_vertex), 2), np.float32), np.zeros(len(mesh.loop_vertex), bool)
    answer[loop[own]], answered[loop[own]] = corner_uv[own], True
    cut = np.unique(polygons[charts != largest[polygons]])
    for polygon in cut:
        _extend(mesh, int(polygon), answer, answered)
    return Answer(answer, largest, answered, len(cut))


def _largest_chart(charts: NDArray[np.int64], polygons: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """(p,) the chart with most triangles of each polygon, −1 where it has none."""
    pairs, number = np.unique(np.stack([polygons, charts], axis=1), axis=0, return_counts=True)
    order = np.lexsort((number, pairs[:, 0]))
    largest = np.full(count, -1, np.int64)
    largest[pairs[order, 0]] = pairs[order, 1]  # the last of each polygon stays
    return largest


def _loops_of_corners(mesh: Mesh, polygon: NDArray[np.int64], positions: NDArray[np.float64]) -> NDArray[np.int64]:
    """(3 f,) the loop of its polygon at which each corner of the answer lies, −1 where there is none."""
    known = np.column_stack([mesh.loop_polygon, mesh.positions[mesh.loop_vertex]])
    asked = np.column_stack([polygon, positions])
    _, label = np.unique(np.concatenate([known, asked]), axis=0, return_inverse=True)
    label = label.reshape(-1)
    loop = np.full(int(label.max(initial=0)) + 1, -1, np.int64)
    loop[label[: len(known)]] = np.arange(len(known))
    return loop[label[len(known) :]]


def _extend(mesh: Mesh, polygon: int, uv: NDArray[np.float32], answered: NDArray[np.bool_]) -> None:
    """Give the loops of a polygon that lie in other charts the uv of its largest chart's plane, in place."""
    loops = mesh.start[polygon] + np.arange(mesh.size[polygon])
    there = loops[answered[loops]]
    points = mesh.positions[mesh.loop_vertex]
    away = loops[~answered[loops]]
    origin = points[there].mean(axis=0)
    shape, *_ = np.linalg.lstsq(points[there] - origin, uv[there] - uv[there].mean(axis=0), rcond=None)
    uv[away] = (points[away] - origin) @ shape + uv[there].mean(axis=0)
    answered[away] = True


def seam_edges(mesh: Mesh, loop_edge: NDArray[np.int32], uv: NDArray[np.float32]) -> NDArray[np.int64]:
    """Numbers of the edges at which polygons meet and their uv do not.

    loop_edge: (l,) the edge from each loop to the next of its polygon.
    """
    after = np.arange(len(loop_edge)) + 1
    after[mesh.start + mesh.size - 1] = mesh.start
    forward = mesh.loop_vertex < mesh.loop_vertex[after]
    ends = np.where(forward[:, None], np.hstack([uv, uv[after]]), np.hstack([uv[after], uv]))
    order = np.argsort(loop_edge, kind="stable")
    same_edge = loop_edge[order][1:] == loop_edge[order][:-1]
    apart = np.abs(ends[order][1:] - ends[order][:-1]).max(axis=1, initial=0.0) > SAME_UV
    return np.unique(loop_edge[order][1:][same_edge & apart]).astype(np.int64)

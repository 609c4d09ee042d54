# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's meshes: read as arrays, and given uv, seams, attributes and colours.  Objects are in object mode."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from . import exchange
from .exchange import Mesh

if TYPE_CHECKING:
    from numpy.typing import NDArray

UV_NAME = "UVMap"
CHARTS, DISTORTION, SEAMS = "flexpara charts", "flexpara distortion", "flexpara seams"
"""Attributes that the overlays show: of faces, of faces, of edges; the first two have colours besides."""
PROTECTED = 0.5
"""Weight in a vertex group from which a vertex is spared seams."""
HEAT_TOP = 1.2
"""Distortion at which the colour is deepest."""


@dataclass(frozen=True, eq=False)
class Chosen:
    """Polygons of one object that are worked on.

    polygons: (p,) bool.  mesh: these alone, as they stand in the world.
    """

    thing: Any
    polygons: NDArray[np.bool_]
    mesh: Mesh

    @property
    def loops(self) -> NDArray[np.bool_]:
        """(l,) bool over the loops of the object."""
        return np.repeat(self.polygons, column(self.thing.data.polygons, "loop_total", np.int32))


def column(rows: Any, name: str, kind: type, width: int = 1) -> NDArray[Any]:
    """One property of all rows of a collection of Blender."""
    values = np.zeros(len(rows) * width, kind)
    rows.foreach_get(name, values)
    return values.reshape(-1, width) if width > 1 else values


def things(context: Any) -> list[Any]:
    """The mesh objects worked on, one for each mesh: those in edit mode, else those selected."""
    editing = [thing for thing in context.objects_in_mode_unique_data if thing.type == "MESH"]
    if context.mode == "EDIT_MESH" and editing:
        return editing
    selected = [thing for thing in context.selected_objects if thing.type == "MESH" and thing.data.polygons]
    return list({thing.data: thing for thing in selected}.values())


def chosen_of(thing: Any, *, selected_only: bool, with_uv: bool) -> Chosen | None:
    """The polygons of an object that are worked on, or None where there are none."""
    if thing.mode == "EDIT":
        thing.update_from_editmode()
    data = thing.data
    matrix = np.array(thing.matrix_world)
    positions = column(data.vertices, "co", np.float32, 3).astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    whole = Mesh(positions, column(data.loops, "vertex_index", np.int32), column(data.polygons, "loop_total", np.int32))
    if with_uv and data.uv_layers.active is not None:
        uv = column(data.uv_layers.active.uv, "vector", np.float32, 2).astype(np.float64)
        whole = Mesh(whole.positions, whole.loop_vertex, whole.size, uv)
    polygons = column(data.polygons, "select", bool) if selected_only else np.ones(len(data.polygons), bool)
    return Chosen(thing, polygons, exchange.part_of(whole, polygons)) if polygons.any() else None


def split(values: NDArray[Any], chosen: list[Chosen], *, loops: bool) -> list[NDArray[Any]]:
    """Values of the joined mesh, object by object.  loops: of loops, or else of polygons."""
    counts = [len(entry.mesh.loop_vertex if loops else entry.mesh.size) for entry in chosen]
    return np.split(values, np.cumsum(counts)[:-1])


def write_uv(entry: Chosen, uv: NDArray[np.float32], answered: NDArray[np.bool_], *, mark_seams: bool) -> None:
    """Give the chosen loops their uv in the active layer, made where there is none, and mark seams between them."""
    data = entry.thing.data
    layer = data.uv_layers.active or data.uv_layers.new(name=UV_NAME)
    values, loops = column(layer.uv, "vector", np.float32, 2), np.flatnonzero(entry.loops)
    values[loops[answered]] = uv[answered]
    set_uv(data, layer.name, values)
    if mark_seams:
        mark(entry, uv)
    data.update()


def set_uv(data: Any, name: str, values: NDArray[np.float32]) -> None:
    """Write the uv (l, 2) of a layer as an attribute: what is written by layer.uv, undo has too, and can't undo."""
    data.attributes[name].data.foreach_set("vector", values.reshape(-1))


def mark(entry: Chosen, uv: NDArray[np.float32]) -> NDArray[np.int64]:
    """Blender's seams of the chosen polygons: the edges at which their uv (l, 2) part, which are returned."""
    data = entry.thing.data
    loop_edge = column(data.loops, "edge_index", np.int32)[entry.loops]
    seams = column(data.edges, "use_seam", bool)
    seams[loop_edge] = False
    found = exchange.seam_edges(entry.mesh, loop_edge, uv)
    seams[found] = True
    data.edges.foreach_set("use_seam", seams)
    return found


def marked_edges(entry: Chosen) -> NDArray[np.float64]:
    """(s, 2, 3) where the ends of the chosen polygons' edges lie that are Blender's seams, in the world."""
    data = entry.thing.data
    edges = np.unique(column(data.loops, "edge_index", np.int32)[entry.loops])
    marked = edges[column(data.edges, "use_seam", bool)[edges]]
    return entry.mesh.positions[column(data.edges, "vertices", np.int32, 2)[marked]]


def protected_part(entry: Chosen, group: str) -> Mesh:
    """The chosen polygons all of whose corners are in a vertex group, in the world."""
    rows, found = entry.thing.data.vertices, entry.thing.vertex_groups.get(group)
    if found is None:
        return exchange.part_of(entry.mesh, np.zeros(len(entry.mesh.size), bool))
    held = ((part.weight for part in row.groups if part.group == found.index) for row in rows)
    inside = np.array([max(weights, default=0.0) >= PROTECTED for weights in held])
    whole = np.minimum.reduceat(inside[entry.mesh.loop_vertex], entry.mesh.start)
    return exchange.part_of(entry.mesh, whole)


def show_seams(entry: Chosen) -> None:
    """The edges at which the uv of the chosen polygons part, as Blender's seams and as an attribute."""
    data = entry.thing.data
    there = np.zeros(len(data.edges), bool)
    if entry.mesh.uv is not None:
        there[mark(entry, entry.mesh.uv.astype(np.float32))] = True
    replaced(data.attributes, SEAMS, "BOOLEAN", "EDGE").data.foreach_set("value", there)
    data.update()


def show_faces(entry: Chosen, chart: NDArray[np.int64], distortion: NDArray[np.float64]) -> None:
    """Charts and distortion of the chosen polygons as attributes of faces, and as colours to look at."""
    data = entry.thing.data
    for name, kind, values in ((CHARTS, "INT", chart), (DISTORTION, "FLOAT", distortion)):
        attribute = replaced(data.attributes, name, kind, "FACE")
        whole = np.zeros(len(data.polygons), np.int32 if kind == "INT" else np.float32)
        whole[entry.polygons] = values
        attribute.data.foreach_set("value", whole)
    for name, colors in ((f"{CHARTS} color", chart_colors(chart)), (f"{DISTORTION} color", heat_colors(distortion))):
        attribute = replaced(data.color_attributes, name, "BYTE_COLOR", "CORNER")
        whole = np.ones((len(data.loops), 4), np.float32)
        whole[entry.loops, :3] = np.repeat(colors, entry.mesh.size, axis=0)
        attribute.data.foreach_set("color_srgb", whole.reshape(-1))
    data.update()


def replaced(attributes: Any, name: str, kind: str, domain: str) -> Any:
    """A new attribute in the place of one of that name."""
    if name in attributes:
        attributes.remove(attributes[name])
    return attributes.new(name=name, type=kind, domain=domain)


def chart_colors(chart: NDArray[np.int64]) -> NDArray[np.float32]:
    """(p, 3) a hue for each chart, a golden section of the circle apart."""
    hue = (0.07 + 0.618034 * chart[:, None] + np.array([0.0, 1.0 / 3.0, 2.0 / 3.0])) % 1.0
    return (0.55 + 0.35 * np.cos(2.0 * np.pi * hue)).astype(np.float32)


def heat_colors(distortion: NDArray[np.float64]) -> NDArray[np.float32]:
    """(p, 3) white where a polygon keeps its shape, red where it is distorted."""
    share = np.clip((distortion - 1.0) / (HEAT_TOP - 1.0), 0.0, 1.0)[:, None]
    return (np.array([0.93, 0.93, 0.93]) * (1.0 - share) + np.array([0.72, 0.0, 0.05]) * share).astype(np.float32)


def show_colors(things: list[Any], name: str) -> None:
    """Make a colour the one that the viewport draws, on each mesh that has it."""
    for thing in things:
        colors = thing.data.color_attributes
        if name in colors:
            colors.active_color = colors[name]

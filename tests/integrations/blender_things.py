"""Meshes in Blender to try the extension on, and what is true of their uv: for in_blender.py."""

from __future__ import annotations

import importlib
import sys
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

bpy: Any = importlib.import_module("bpy")  # the checkers of types have none


def enabled(folder: Path, program: str) -> Any:
    """Enable the extension by its folder, as a package of the name that its folder has."""
    sys.path.insert(0, str(folder.parent))
    extension = importlib.import_module(folder.name)
    extension.register()
    extension.child.find = lambda preferred="": program or preferred
    return extension


def empty() -> None:
    """A scene without anything."""
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)


def picked(*things: Any) -> None:
    """Select these, the last one active."""
    bpy.ops.object.select_all(action="DESELECT")
    for thing in things:
        thing.select_set(True)
    bpy.context.view_layer.objects.active = things[-1]


def select_faces(thing: Any, *numbers: int) -> None:
    """Go into edit mode with these faces selected, and no other."""
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.context.tool_settings.mesh_select_mode = (False, False, True)
    bpy.ops.mesh.select_all(action="DESELECT")
    bpy.ops.object.mode_set(mode="OBJECT")
    for number in numbers:
        thing.data.polygons[number].select = True
    bpy.ops.object.mode_set(mode="EDIT")


def uv_of(thing: Any) -> np.ndarray:
    """(l, 2) float64 of the active layer."""
    values = np.zeros(2 * len(thing.data.loops), np.float32)
    thing.data.uv_layers.active.uv.foreach_get("vector", values)
    return values.reshape(-1, 2).astype(np.float64)


def signed_area(uv: np.ndarray) -> float:
    x, y = uv.T
    return 0.5 * float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())


def areas(thing: Any) -> tuple[np.ndarray, np.ndarray]:
    """Of each polygon: area in the world, signed area in uv."""
    uv, scale = uv_of(thing), thing.matrix_world.to_scale()
    assert len(set(np.round(scale, 6))) == 1
    space = np.array([face.area for face in thing.data.polygons]) * scale[0] ** 2
    return space, np.array([signed_area(uv[list(face.loop_indices)]) for face in thing.data.polygons])


def seams_are_where_uv_part(thing: Any) -> bool:
    """Blender's seams are the edges at which the uv of two polygons differ."""
    uv, ends = uv_of(thing), dict[int, set[tuple[float, ...]]]()
    for face in thing.data.polygons:
        loops = list(face.loop_indices)
        for loop, after in zip(loops, loops[1:] + loops[:1], strict=True):
            entry = thing.data.loops
            pair = sorted([(entry[loop].vertex_index, *uv[loop]), (entry[after].vertex_index, *uv[after])])
            ends.setdefault(entry[loop].edge_index, set()).add(tuple(number for row in pair for number in row))
    return all(thing.data.edges[edge].use_seam == (len(pairs) > 1) for edge, pairs in ends.items())


def same_density(*things: Any) -> bool:
    """All polygons are the right way up, and have nearly as much uv for each unit."""
    pairs = [areas(thing) for thing in things]
    space, flat = (np.concatenate(column) for column in zip(*pairs, strict=True))
    share = flat / space * space.sum() / flat.sum()
    return bool((flat > 0.0).all() and np.quantile(share, 0.05) > 0.6 and np.quantile(share, 0.95) < 1.6)


def undone(name: str) -> Any:
    """The object of that name after one step of undo, which makes all objects anew."""
    assert bpy.ops.ed.undo() == {"FINISHED"}
    return bpy.data.objects[name]


def seams_of(thing: Any) -> set[int]:
    """Numbers of the edges that are Blender's seams."""
    return {edge.index for edge in thing.data.edges if edge.use_seam}


def refused(command: Callable[[], object]) -> str:
    """The error that a command ends with, "" where it does not."""
    try:
        command()
    except RuntimeError as error:
        return str(error)
    return ""

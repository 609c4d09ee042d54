"""What Blender finds in a mesh file: `PYTHON benchmarks/blender_scene.py FILE RESULT.npz [EXPORT.glb]`.

A script that needs numpy and bpy and nothing of ours, as `blender.py`.  RESULT.npz receives `facts` (JSON: objects with
their names, types, parents, materials, uv sets, vertex groups, shape keys; actions) and for object number i its sizes_i
(p,) corners of each polygon, normals_i (c, 3) of each corner, poses_i (3, p, 3) the polygons' centres in the world at
three times.  EXPORT.glb receives the scene as Blender's own exporter writes it.
"""

from __future__ import annotations

import json
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

TIMES = (0.0, 0.37, 0.81)
"""Of the length of the longest action."""


def open_file(bpy: Any, path: Path) -> None:
    """An empty scene with the file in it."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    kind = path.suffix.lower()
    if kind in (".glb", ".gltf"):
        bpy.ops.import_scene.gltf(filepath=str(path))
    elif kind == ".obj":
        bpy.ops.wm.obj_import(filepath=str(path))
    elif kind == ".ply":
        bpy.ops.wm.ply_import(filepath=str(path))
    else:
        bpy.ops.wm.stl_import(filepath=str(path))


def object_facts(thing: Any) -> dict[str, Any]:
    """Names of an object and of what it has."""
    facts = {"name": thing.name, "type": thing.type, "parent": thing.parent.name if thing.parent else None}
    if thing.type != "MESH":
        return facts
    keys = thing.data.shape_keys
    return {
        **facts,
        "mesh": thing.data.name,
        "polygons": len(thing.data.polygons),
        "materials": [slot.material.name if slot.material else None for slot in thing.material_slots],
        "uv_sets": len(thing.data.uv_layers),
        "groups": sorted(group.name for group in thing.vertex_groups),
        "keys": [block.name for block in keys.key_blocks] if keys else [],
        "colors": len(thing.data.color_attributes),
        "skinned": any(modifier.type == "ARMATURE" for modifier in thing.modifiers),
    }


def mesh_arrays(mesh: Any) -> tuple[np.ndarray, np.ndarray]:
    """Corners of each polygon (p,), and normals (c, 3) of the corners."""
    sizes = np.zeros(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_total", sizes)
    normals = np.zeros(3 * len(mesh.loops), np.float32)
    mesh.corner_normals.foreach_get("vector", normals)
    return sizes, normals.reshape(-1, 3)


def centres(bpy: Any, thing: Any) -> np.ndarray:
    """(p, 3) centres of the polygons in the world, as the scene stands."""
    evaluated = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    found = np.zeros(3 * len(mesh.polygons), np.float32)
    mesh.polygons.foreach_get("center", found)
    world = np.array(evaluated.matrix_world)
    evaluated.to_mesh_clear()
    return found.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3]


def main(given: str, result: str, export: str = "") -> None:
    """Read a file, say what is in it, and write it again where asked."""
    bpy = import_module("bpy")
    open_file(bpy, Path(given))
    things = sorted(bpy.data.objects, key=lambda entry: entry.name)
    meshes = [thing for thing in things if thing.type == "MESH"]
    actions = sorted(action.name for action in bpy.data.actions)
    last = max((action.frame_range[1] for action in bpy.data.actions), default=1.0)
    arrays: dict[str, Any] = {}
    for number, thing in enumerate(meshes):
        arrays[f"sizes_{number}"], arrays[f"normals_{number}"] = mesh_arrays(thing.data)
    poses: list[list[np.ndarray]] = [[] for _ in meshes]
    for time in TIMES:
        frame = time * last
        bpy.context.scene.frame_set(int(frame), subframe=frame - int(frame))
        for found, thing in zip(poses, meshes, strict=True):
            found.append(centres(bpy, thing))
    arrays |= {f"poses_{number}": np.stack(found) for number, found in enumerate(poses)}
    materials = {entry.name: entry.surface_render_method for entry in bpy.data.materials} if bpy.data.materials else {}
    facts = {
        "blender": bpy.app.version_string,
        "objects": [object_facts(thing) for thing in things],
        "meshes": [thing.name for thing in meshes],
        "actions": actions,
        "materials": materials,
    }
    np.savez(result, facts=json.dumps(facts), **arrays)
    if export:
        bpy.ops.export_scene.gltf(filepath=export, export_extras=True, export_cameras=True, export_lights=True)


if __name__ == "__main__":
    main(*sys.argv[1:])

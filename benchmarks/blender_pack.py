"""Blender's packer on islands that exist: `PYTHON benchmarks/blender_pack.py ISLANDS.npz RESULT.npz MARGIN`.

A script that needs numpy and bpy and nothing of ours, as `blender.py`.  ISLANDS.npz holds vertices (v, 3), faces (f, 3)
and corner_uv (f, 3, 2); RESULT.npz receives corner_uv and seconds, of processor time.  MARGIN: share of the side.
"""

from __future__ import annotations

import sys
import time
from importlib import import_module
from typing import Any

import numpy as np


def packed(bpy: Any, given: Any, margin: float) -> tuple[np.ndarray, float]:
    """(corner_uv (f, 3, 2), seconds): `uv.pack_islands` with exact outlines at any rotation, the operator alone."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    mesh = bpy.data.meshes.new("surface")
    mesh.from_pydata(given["vertices"].tolist(), [], given["faces"].tolist())
    mesh.uv_layers.new(name="uv")
    uv = np.ascontiguousarray(given["corner_uv"], dtype=np.float32).reshape(-1)
    mesh.uv_layers.active.data.foreach_set("uv", uv)
    thing = bpy.data.objects.new("surface", mesh)
    bpy.context.collection.objects.link(thing)
    bpy.context.view_layer.objects.active = thing
    thing.select_set(True)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.uv.select_all(action="SELECT")
    start = time.process_time()
    bpy.ops.uv.pack_islands(
        rotate=True, rotate_method="ANY", scale=True, margin_method="FRACTION", margin=margin, shape_method="CONCAVE"
    )
    seconds = time.process_time() - start
    bpy.ops.object.mode_set(mode="OBJECT")
    mesh.uv_layers.active.data.foreach_get("uv", uv)
    return uv.reshape(-1, 3, 2).astype(np.float64), seconds


def main(given: str, result: str, margin: str) -> None:
    """Pack the islands of one file into another."""
    with np.load(given, allow_pickle=False) as found:
        corner_uv, seconds = packed(import_module("bpy"), found, float(margin))
    np.savez(result, corner_uv=corner_uv, seconds=seconds)


if __name__ == "__main__":
    main(*sys.argv[1:])

"""Blender's Smart UV Project on one surface: `PYTHON benchmarks/blender.py SURFACE.npz RESULT.npz`.

A script that needs numpy and bpy and nothing of ours: bpy wants a Python, and a numpy, of its own choice (bpy 5.0 is
built for numpy 1), so it often lives in another environment.  Files as in `benchmarks.systems`: vertices (v, 3) and
faces (f, 3) in; status, why, corner_uv (f, 3, 2) float64, seconds and report out.
"""

from __future__ import annotations

import json
import sys
import time
from importlib import import_module
from typing import Any

import numpy as np


def smart_uv(bpy: Any, vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, float]:
    """(corner_uv (f, 3, 2), seconds): `uv.smart_project` with Blender's own defaults, the operator alone timed."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    mesh = bpy.data.meshes.new("surface")
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    thing = bpy.data.objects.new("surface", mesh)
    bpy.context.collection.objects.link(thing)
    bpy.context.view_layer.objects.active = thing
    thing.select_set(True)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    start = time.perf_counter()
    bpy.ops.uv.smart_project()
    seconds = time.perf_counter() - start
    bpy.ops.object.mode_set(mode="OBJECT")
    uv = np.zeros(6 * len(faces), dtype=np.float32)
    mesh.uv_layers.active.data.foreach_get("uv", uv)
    return uv.reshape(-1, 3, 2).astype(np.float64), seconds


def main(given: str, result: str) -> None:
    """Unwrap the surface of one file into another; where bpy can't be imported, the result says so."""
    try:
        bpy = import_module("bpy")
    except ImportError as error:
        remedy = "name a Python that has it: --blender-python PATH (python3.11 -m venv v; v/bin/pip install bpy)"
        np.savez(result, status="not run", why=f"bpy can't be imported ({error}), expected Blender's module; {remedy}")
        return
    with np.load(given, allow_pickle=False) as found:
        corner_uv, seconds = smart_uv(bpy, found["vertices"], found["faces"])
    report = json.dumps({"blender": bpy.app.version_string})
    np.savez(result, status="done", why="", corner_uv=corner_uv, seconds=seconds, report=report)


if __name__ == "__main__":
    main(*sys.argv[1:])

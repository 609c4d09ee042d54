"""Blender's Cycles bake of one pair of meshes: `PYTHON benchmarks/blender_bake.py MESHES.npz RESULT.npz`.

A script that needs numpy and bpy and nothing of ours (see blender.py).  MESHES.npz: vertices (v, 3) and faces (f, 3) of
the low-poly mesh, corner_uv (f, 3, 2), corner_normals (f, 3, 3), high_vertices, high_faces (or empty), kind (AO or
NORMAL), size in texels, samples, reach in source units.  RESULT.npz: image (h, w, 3) float32 in [0, 1], row 0 = top,
seconds of the bake operator alone.
"""

from __future__ import annotations

import sys
import time
from importlib import import_module
from typing import Any

import numpy as np


def make_object(bpy: Any, name: str, vertices: np.ndarray, faces: np.ndarray) -> Any:
    """An object with a smoothly shaded mesh, linked to the scene."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    mesh.shade_smooth()
    thing = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(thing)
    return thing


def target_image(bpy: Any, thing: Any, size: int) -> Any:
    """A float image that the object's material bakes into."""
    image = bpy.data.images.new("baked", size, size, float_buffer=True, is_data=True)
    material = bpy.data.materials.new("baked")
    material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    material.node_tree.nodes.active = node
    thing.data.materials.append(material)
    return image


def bake(bpy: Any, given: Any) -> tuple[np.ndarray, float]:
    """(image (h, w, 3), seconds)."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene, size = bpy.context.scene, int(given["size"])
    scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", int(given["samples"])
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    low = make_object(bpy, "low", given["vertices"], given["faces"])
    layer = low.data.uv_layers.new(name="uv")
    layer.data.foreach_set("uv", given["corner_uv"].astype(np.float32).reshape(-1))
    low.data.normals_split_custom_set(given["corner_normals"].reshape(-1, 3).tolist())
    image = target_image(bpy, low, size)
    has_high = len(given["high_faces"]) > 0
    if has_high:
        make_object(bpy, "high", given["high_vertices"], given["high_faces"]).select_set(True)
    low.select_set(True)
    bpy.context.view_layer.objects.active = low
    reach = float(given["reach"])
    start = time.perf_counter()
    bpy.ops.object.bake(
        type=str(given["kind"]),
        margin=0,
        use_selected_to_active=has_high,
        cage_extrusion=reach,
        max_ray_distance=2.0 * reach,
    )
    seconds = time.perf_counter() - start
    pixels = np.zeros(size * size * 4, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(size, size, 4)[::-1, :, :3].copy(), seconds


def main(meshes: str, result: str) -> None:
    """Bake the meshes of one file into another."""
    bpy = import_module("bpy")
    with np.load(meshes, allow_pickle=False) as given:
        image, seconds = bake(bpy, given)
    np.savez(result, image=image, seconds=seconds, blender=bpy.app.version_string)


if __name__ == "__main__":
    main(*sys.argv[1:])

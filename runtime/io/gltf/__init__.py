"""glTF 2.0 (.glb, .gltf): bytes, scene and materials of a file that is read.  Written by bake/files.

Public face: `scene.read_gltf`.
"""

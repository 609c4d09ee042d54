"""Evaluate, pack and store atlases: numpy, scipy, trimesh, xatlas and onnxruntime only, never torch or OpenGL."""

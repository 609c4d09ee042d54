"""Wavefront OBJ: its reader, its writer, and the material libraries (.mtl) beside it.

Public face: `read.read_obj`, `write.write_obj`.
"""

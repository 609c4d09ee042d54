"""Wavefront OBJ: its reader, its writer, and the material libraries (.mtl) beside it."""

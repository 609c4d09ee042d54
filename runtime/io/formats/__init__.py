"""Formats that need one module each: OFF, STL, npz, and 3MF, and those that trimesh reads (dae, …).

Public face: `off.read_off`, `stl.read_stl`, `others.read_with_trimesh`, `npz.write_npz`.
"""

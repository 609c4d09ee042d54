"""What float32 holds: uv on a lattice, proven valid there, and vertices doubled along seams.

Public face: `lattice.snap`, `seamvertices.split_vertices`.
"""

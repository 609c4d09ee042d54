"""Charts packed into the unit square with padding, valid as written, and the vertices doubled along their seams.

Public face: `packing.pack` and its `config.PackConfig`; `packing.atlas_from_uv` for uv that a mesh already has.
"""

"""One valid chart of a set of faces: cut to a disk, flattened (SLIM, ARAP), slit, held apart, checked exactly.

Public face: `pieces.try_piece` and `pieces.slit_further`; `arap` and `flatten` (SLIM) are the two flattenings.
"""

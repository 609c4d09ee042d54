"""Formulas of triangles: topology, exact signs and overlaps, distortion, gaps, and the metrics made of them.

Public face: `metrics.measure`, `overlap.overlapping_pairs`, `topology.edge_table`, and each module's formulas.
"""

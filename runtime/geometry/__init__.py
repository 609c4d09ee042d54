"""Formulas of triangles: topology, exact signs and overlaps, distortion, gaps, and the metrics made of them."""

"""Triangles laid over a point cloud."""

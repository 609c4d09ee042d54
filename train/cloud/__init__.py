"""Triangles laid over a point cloud.

Public face: `reconstruct.reconstruct` and `config.CloudConfig`.
"""

"""Seam length over distortion: settings of flexpara beside other tools.

Public face: `plot.drawn`, run as `python -m benchmarks.frontier`.
"""

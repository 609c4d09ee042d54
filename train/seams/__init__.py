"""Seams as a network of edges: charts joined by bridges, and seams closed from their ends, as far as that pays.

Public face: `closing.Closing`.
"""

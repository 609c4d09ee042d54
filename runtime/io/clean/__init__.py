"""Triangles as a file holds them → a surface to work on: welded, second sides apart, oriented; `clean` does it all.

Public face: `clean.clean`.
"""

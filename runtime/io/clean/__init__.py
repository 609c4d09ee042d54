"""Triangles as a file holds them → a surface to work on: welded, degenerate faces left out, oriented."""

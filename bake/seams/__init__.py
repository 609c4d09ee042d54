"""Both sides of a seam: how far they differ in a texture, and texels moved until they agree.

Public face: `seamcheck.seam_report`, `closing.closed_seams`.
"""

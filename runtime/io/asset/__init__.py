"""What is done to an asset once it is read: normals where it has none, pages, wanted seams, what changed in words.

Public face: `shading.shaded`, `pages.pages_of`, `wantedseams.wanted_seams`, `changes.told`.
"""

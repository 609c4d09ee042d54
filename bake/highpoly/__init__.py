"""The same maps taken from high-poly meshes: rays from the low-poly surface or a cage find the point of each texel.

Public face: `highmaps.HighSource` and `cage.CageSettings`.
"""

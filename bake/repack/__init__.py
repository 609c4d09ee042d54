"""`flexpara pack`: the islands that meshes have on a page of their own, and their textures moved there.

Public face: `commands.pack` for the command line, `repacked.pack` for Python, which returns a `repacked.PackResult`.
"""

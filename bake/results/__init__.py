"""What a run leaves: textures and meshes of one atlas, of several pages, of UDIM tiles.

Public face: `output.write_outputs`, `pages.write_pages`, `udim.bake_udim`,
`compared.write_comparison`.
"""

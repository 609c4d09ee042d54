"""Files: PNG and EXR images, engine targets, glTF and USD with their textures.

Public face: `images.write_texture`, `textures.write_textures`, `targets.write_target`, `exr.write_layers`,
`gltf.write_glb`, `usd.write_usda`.
"""

"""Pictures that a mesh file names or holds, read without leaving its folder, and the colours of its vertices.

Public face: `pictures.decode_image`, `pictures.read_in_folder`, `ktx2.decode_ktx2`, `colors.as_rgba`.
"""

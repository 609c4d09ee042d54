"""The surface behind each texel: OpenGL or numpy draws positions, normals and faces in uv space; gutters around them.

Public face: `plan.open_rasterizer`, `gbuffer.GBuffer`, `gutter.fill_gutters`.
"""

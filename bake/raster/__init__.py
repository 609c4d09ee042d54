"""The surface behind each texel: OpenGL or numpy draws positions, frames and faces in uv space; gutters."""

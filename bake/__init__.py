"""Texture baking with OpenGL, image and glTF files."""

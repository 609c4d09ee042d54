"""Formats that people bring and that are not read, each with the way out."""

from __future__ import annotations

CONVERTED = {
    "fbx": "FBX, a format without a public description, is not read; import it in Blender and export glTF (.glb)",
    "blend": "Blender's own files are not read; export glTF (.glb) there, or use flexpara's add-on",
    **dict.fromkeys(("usd", "usda", "usdc", "usdz"), "USD is written, not read; import it in Blender and export .glb"),
    **dict.fromkeys(("iges", "igs"), "CAD surfaces hold no triangles; tessellate them to .glb, .obj or .stl"),
    **dict.fromkeys(("max", "ma", "mb", "c4d", "skp", "3ds"), "is a format of one program; export .glb or .obj there"),
}
"""What is said of a file, by its ending."""

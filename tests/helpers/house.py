"""Two quads on half of a texture, the first red and the second blue: what packing moves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

if TYPE_CHECKING:
    from pathlib import Path

HOUSE = """mtllib house.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 3 0 0
v 4 0 0
v 4 1 0
v 3 1 0
vt 0 0
vt 0.5 0
vt 0.5 0.5
vt 0 0.5
vt 0.5 0.5
vt 1 0.5
vt 1 1
vt 0.5 1
o wall
usemtl paint
f 1/1 2/2 3/3 4/4
o roof
f 5/5 6/6 7/7 8/8
"""
RED, BLUE = (255, 0, 0), (0, 0, 255)


def write_house(folder: Path) -> Path:
    """Write house.obj, its material and its texture; the path of the first."""
    path = folder / "house.obj"
    path.write_text(HOUSE, encoding="utf-8")
    (folder / "house.mtl").write_text("newmtl paint\nmap_Kd house.png\n", encoding="utf-8")
    pixels = np.zeros((64, 64, 3), np.uint8)
    pixels[32:, :32], pixels[:32, 32:] = RED, BLUE
    Image.fromarray(pixels).save(folder / "house.png")
    return path

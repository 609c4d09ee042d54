"""A function of the surface as a texture: contour lines every tenth of a unit.

`python examples/own_map.py [FOLDER]`
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import flexpara
from flexpara.bake.files.textures import write_textures
from flexpara.runtime.samples import make_sample


def contours(positions: np.ndarray, normals: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(n, 1): dark where the height is near a whole tenth."""
    del normals, faces
    return np.minimum(np.abs((positions[:, 2:] * 10.0) % 1.0 - 0.5) * 8.0, 1.0)


folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/contours")
folder.mkdir(parents=True, exist_ok=True)
result = flexpara.unwrap(make_sample("sphere", resolution=12), size=256)
textures = flexpara.bake.bake(result.atlas, {"contours": contours})
print(*write_textures(textures, folder, "sphere"))

"""An output folder made by hand, with words that a page must not run."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

if TYPE_CHECKING:
    from pathlib import Path

EVIL = "</script><img src=x onerror=hacked=1><b>"
OBJ = """v -1 -1 0\nv 0 -1 0\nv 0 1 0\nv -1 1 0\nv 1 -1 0\nv 1 1 0
vt 0.1 0.1\nvt 0.4 0.1\nvt 0.4 0.7\nvt 0.1 0.7\nvt 0.6 0.1\nvt 0.9 0.1\nvt 0.9 0.7\nvt 0.6 0.7
f 1/1 2/2 3/3\nf 1/1 3/3 4/4\nf 2/5 5/6 6/7\nf 2/5 6/7 3/8\n"""
"""Two squares side by side facing +z, a chart each: the left half is lower in u."""


def write_result(folder: Path, stem: str = "card", obj: str = OBJ) -> Path:
    """An output folder: mesh, picture and report."""
    folder.mkdir(exist_ok=True)
    (folder / f"{stem}.obj").write_text(obj, encoding="utf-8")
    pixels = np.zeros((64, 64, 3), np.uint8)
    pixels[:, :32] = (200, 30, 30)
    Image.fromarray(pixels).save(folder / "halves.png")
    report = {
        "producer": "flexpara",
        "source": {"sha256": EVIL},
        "settings": {"size": 64},
        "seconds": {EVIL: 1.5, "pack": float("nan"), "fit": "long"},
        "train": {"notes": [EVIL, 7]},
        "network": {"rms_texels": 0.25, "chart_agreement": EVIL, "charts": 99},
        "textures": {"files": {EVIL: "halves.png", "gone": "../secret.png"}},
        "changes": {"flipped_faces": 2, EVIL: 3},
    }
    (folder / f"{stem}.report.json").write_text(json.dumps(report), encoding="utf-8")
    return folder

"""Chart and uv of any point, from the ONNX file alone: here the points that a laser might hit.

`python examples/ask_points.py [FOLDER]`
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import flexpara
from flexpara.runtime.samples import make_sample

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/ask")
flexpara.unwrap(make_sample("sphere", resolution=12), size=512).save(folder, maps=(), force=True)

session = flexpara.runtime.UnwrapSession(folder / "mesh.onnx")
directions = np.random.default_rng(0).normal(size=(1000, 3))
hits = directions / np.linalg.norm(directions, axis=1, keepdims=True) * 0.99  # near the sphere, not on it
uv, chart, score = session.unwrap(hits)
for number in range(session.metadata.chart_count):
    print(f"chart {number}: {np.count_nonzero(chart == number)} hits, trusted {score[chart == number].mean():.2f}")

"""A pipeline that called xatlas, with one line changed.

`python examples/from_xatlas.py`
"""

from __future__ import annotations

import numpy as np

import flexpara.xatlas as xatlas
from flexpara.runtime.samples import make_sample

vertices, faces = make_sample("sphere", resolution=12)
xatlas.settings.time_budget = 10.0
atlas = xatlas.Atlas()
atlas.add_mesh(vertices.astype(np.float32), faces.astype(np.uint32))
options = xatlas.PackOptions()
options.resolution, options.padding = 512, 4
atlas.generate(pack_options=options)
mapping, indices, uv = atlas[0]
print(f"{atlas.chart_count} charts on {atlas.width} × {atlas.height}; {len(mapping)} vertices, uv up to {uv.max():.2f}")

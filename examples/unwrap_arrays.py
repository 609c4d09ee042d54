"""A mesh in memory, unwrapped: arrays in, arrays out, and what was measured.

`python examples/unwrap_arrays.py`
"""

from __future__ import annotations

import flexpara
from flexpara.runtime.samples import make_sample

vertices, faces = make_sample("sphere", resolution=12)
result = flexpara.unwrap((vertices, faces), charts=4, size=512)
atlas = result.atlas
print(f"{len(vertices)} vertices became {len(atlas.uv)}: doubled along seams")
print(f"face 0 lies at {atlas.uv[atlas.faces[0]].tolist()}")
metrics = result.report["metrics"]
print(f"{metrics['charts']} charts, distortion {100 * (metrics['symmetric_dirichlet_mean'] - 1):.2f} %")

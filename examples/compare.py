"""The same mesh with few and with many charts, side by side in one HTML file.

`python examples/compare.py [FOLDER]`
"""

from __future__ import annotations

import sys
from pathlib import Path

import flexpara
from flexpara.bake.report.gather import results_in
from flexpara.bake.report.page import write_page
from flexpara.runtime.samples import make_sample

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/compare")
mesh = make_sample("sphere", resolution=12)
for charts in (2, 8):
    flexpara.unwrap(mesh, charts=charts, size=256).save(folder / f"{charts} charts", maps=(), force=True)
results = results_in([folder / "2 charts", folder / "8 charts"])
write_page(results, "Two charts or eight", folder / "compare.html")
print(f"open {folder / 'compare.html'}")

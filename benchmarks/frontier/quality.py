"""What a layout is worth: `-m benchmarks.frontier.quality LAYOUT RESULT.json EVALUATOR`, metrics as JSON.

LAYOUT: a mesh file with uv, or the .npz of a peer.  EVALUATOR: a Python file with `seam_quality(vertices, faces,
corner_uv)`, such as ../shared/check/seamquality.py, or `none`: then jaggedness, exposure, crease and compactness are
absent.  The rest is `benchmarks.corpus.judge`'s.
"""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path
from typing import Any

from benchmarks.corpus.judge import judged, read_layout

SEAM_COLUMNS = ("jaggedness", "exposure", "crease", "compactness")


def quality_of(layout: Path, evaluator: str) -> dict[str, Any]:
    """The metrics of a layout."""
    surface, corner_uv = read_layout(layout)
    own = judged(surface, corner_uv)
    names = ("faces", "charts", "stretch", "seam", "objective", "packing", "flips", "overlap")
    row = {name: own[name] for name in names}
    if evaluator == "none":
        return row
    spec = importlib.util.spec_from_file_location("seamquality", evaluator)
    if spec is None or spec.loader is None:
        raise FileNotFoundError(f"no evaluator at {evaluator}, expected a Python file; pass --evaluator none")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    said = module.seam_quality(surface.vertices, surface.faces, corner_uv)
    return row | {name: said.get(name) for name in SEAM_COLUMNS}


if __name__ == "__main__":
    source, result, file = sys.argv[1:]
    Path(result).write_text(json.dumps(quality_of(Path(source), file)), encoding="utf-8")

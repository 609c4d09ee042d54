"""The peers' side of a corpus run: `-m benchmarks.corpus.peer read FILE SURFACE.npz`, then `TOOL SURFACE ANSWER.npz`.

SURFACE.npz holds vertices (v, 3) and faces (f, 3) as flexpara reads and cleans the file.  ANSWER.npz adds corner_uv
(f, 3, 2); ANSWER.json holds the seconds of the tool's call.  Exit code 2: flexpara refuses the file.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from benchmarks.peers import PEERS
from flexpara.runtime.errors import FlexparaError
from flexpara.runtime.io.meshfile import load_asset


def main(task: str, given: str, result: str) -> int:
    """Read a file, or unwrap a surface by a tool."""
    if task == "read":
        try:
            surface = load_asset(Path(given)).surface
        except FlexparaError as error:
            print(error, file=sys.stderr)
            return error.exit_code
        np.savez(result, vertices=surface.vertices, faces=surface.faces)
        return 0
    with np.load(given, allow_pickle=False) as found:
        vertices, faces = found["vertices"], found["faces"]
    corner_uv, seconds = PEERS[task](vertices, faces)
    np.savez(result, vertices=vertices, faces=faces, corner_uv=corner_uv)
    Path(result).with_suffix(".json").write_text(json.dumps({"seconds": seconds}), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

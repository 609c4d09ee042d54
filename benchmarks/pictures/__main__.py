"""`python -m benchmarks.pictures MODELS [NAME…]`: all pictures of the documents, or those named.

MODELS is a folder of meshes.  Each picture is a small WebP in docs/pictures, named after what it shows.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from benchmarks.pictures.maps import maps
from benchmarks.pictures.options import OTHERS, SHOWN, Inputs, options
from benchmarks.pictures.stages import stages


def main() -> None:
    """Make all of them, or those named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("models", type=Path)
    every = [*SHOWN, *OTHERS, "maps", "stages"]
    parser.add_argument("which", nargs="*", choices=every, default=every)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        inputs = Inputs(asked.models, Path(folder))
        for name in asked.which:
            if name in SHOWN:
                options(inputs, name)
            elif name in OTHERS:
                OTHERS[name](inputs)
            else:
                {"maps": maps, "stages": stages}[name](asked.models)


if __name__ == "__main__":
    main()

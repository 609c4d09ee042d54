"""One unwrap by another tool, in a process of its own: `python -m benchmarks.peers TOOL SURFACE.npz UV.npz`.

SURFACE.npz holds vertices (v, 3) and faces (f, 3); UV.npz receives corner_uv (f, 3, 2) float64 and seconds, the time of
the tool's call.  Both tools normalise u and v separately, by the atlas' width and height; that is undone here: uv are
in texels of one scale.
"""

from __future__ import annotations

import sys
import time
from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray


def by_xatlas(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> tuple[NDArray[np.float64], float]:
    """(corner_uv in texels, seconds): what xatlas.parametrize does, with default options."""
    import xatlas  # a peer is imported only when it is asked for

    start = time.perf_counter()
    atlas = xatlas.Atlas()
    atlas.add_mesh(vertices.astype(np.float32), faces.astype(np.uint32))
    atlas.generate()
    _, corner, uv = atlas[0]
    seconds = time.perf_counter() - start
    return uv[corner].astype(np.float64) * (atlas.width, atlas.height), seconds


def by_uvunwrap(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> tuple[NDArray[np.float64], float]:
    """(corner_uv in texels, seconds): uvunwrap.generate with default options; pages lie side by side."""
    uvunwrap = import_module("uvunwrap")  # optional: static tools need not find it
    start = time.perf_counter()
    mesh = uvunwrap.Mesh(positions=vertices.astype(np.float32), indices=faces.astype(np.uint32))
    atlas = uvunwrap.generate([mesh])
    seconds = time.perf_counter() - start
    output = atlas.meshes[0]
    page = np.asarray(output.page)[np.asarray(output.indices)].reshape(-1, 3)
    uv = np.asarray(output.corner_uvs, dtype=np.float64).reshape(-1, 3, 2)
    uv[..., 0] += page
    return uv * (atlas.width, atlas.height), seconds


PEERS: dict[str, Callable[[NDArray[np.float64], NDArray[np.int64]], tuple[NDArray[np.float64], float]]] = {
    "xatlas": by_xatlas,
    "uvunwrap": by_uvunwrap,
}


def main(tool: str, surface: str, result: str) -> None:
    """Unwrap the surface of one file into another."""
    with np.load(surface, allow_pickle=False) as given:
        corner_uv, seconds = PEERS[tool](given["vertices"], given["faces"])
    np.savez(result, corner_uv=corner_uv, seconds=seconds)


if __name__ == "__main__":
    main(*sys.argv[1:])

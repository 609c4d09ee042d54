"""Packers on the same islands: `python -m benchmarks.packing [--blender-python PATH] FILE_OR_FOLDER…`.

Islands are those of xatlas and of uvunwrap, made here of each mesh.  Efficiency: area of all uv triangles over the
square of the longest side of the layout.  Gap: smallest distance of two islands, in texels where that side is 1024;
compare rows of like gap.  Seconds are of the processor.  uvunwrap packs only islands of its own.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flexpara.runtime.geometry.metrics import measure
from flexpara.runtime.geometry.triangles import signed_areas
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.mesh import Asset, Surface
from flexpara.runtime.pack.exact.seamvertices import split_vertices
from flexpara.runtime.pack.repack import repack
from flexpara.runtime.pack.square import Square

from .peers import by_xatlas

if TYPE_CHECKING:
    from numpy.typing import NDArray

SIZE, PADDING = 1024, 4


class Laid(NamedTuple):
    """A layout: corner_uv (f, 3, 2) in one scale, and the seconds that it took."""

    corner_uv: NDArray[np.float64]
    seconds: float


def uvunwrap_islands(surface: Surface) -> Laid:
    """The islands that uvunwrap makes, as it packs them."""
    uvunwrap = import_module("uvunwrap")  # optional: static tools need not find it
    start = time.process_time()
    positions, indices = surface.vertices.astype(np.float32), surface.faces.astype(np.uint32)
    atlas = uvunwrap.generate([uvunwrap.Mesh(positions=positions, indices=indices)], padding=PADDING, page_size=SIZE)
    uv = np.asarray(atlas.meshes[0].corner_uvs, dtype=np.float64).reshape(-1, 3, 2) * (atlas.width, atlas.height)
    return Laid(uv / max(atlas.width, atlas.height), time.process_time() - start)


def by_flexpara(surface: Surface, corner_uv: NDArray[np.float64]) -> Laid:
    """`flexpara pack --density kept`."""
    faces, source, uv = split_vertices(surface.faces, np.zeros(len(surface.faces), np.int64), corner_uv)
    asset = Asset(surface.vertices[source], faces, source, surface, uv=uv)
    start = time.process_time()
    packed = repack(asset, Square(SIZE, PADDING), equal=False)
    return Laid(packed.atlas.corner_uv, time.process_time() - start)


def by_xatlas_packer(surface: Surface, corner_uv: NDArray[np.float64]) -> Laid:
    """With brute force by xatlas; its page comes out larger than asked for, so padding is raised to a like gap."""
    import xatlas  # a peer is imported only when it is asked for

    faces, _, uv = split_vertices(surface.faces, np.zeros(len(surface.faces), np.int64), corner_uv)
    found, start = corner_uv, time.process_time()
    for padding in (PADDING, 6):
        start = time.process_time()
        atlas, options = xatlas.Atlas(), xatlas.PackOptions()
        atlas.add_uv_mesh((uv * SIZE).astype(np.float32), faces.astype(np.uint32))
        options.padding, options.bruteForce, options.resolution = padding, True, SIZE
        atlas.generate(xatlas.ChartOptions(), options)
        _, corner, flat = atlas[0]
        found = flat[corner].astype(np.float64) * (atlas.width, atlas.height)
        if max(atlas.width, atlas.height) < 1.2 * SIZE:
            break
    return Laid(found, time.process_time() - start)


def by_blender(python: str, surface: Surface, corner_uv: NDArray[np.float64]) -> Laid:
    """Blender's packer with exact outlines, in a Python that has bpy."""
    with tempfile.TemporaryDirectory() as folder:
        given, result = Path(folder) / "islands.npz", Path(folder) / "packed.npz"
        np.savez(given, vertices=surface.vertices, faces=surface.faces, corner_uv=corner_uv)
        script = Path(__file__).with_name("blender_pack.py")
        subprocess.run(
            [python, str(script), str(given), str(result), str(PADDING / SIZE)], check=True, capture_output=True
        )
        with np.load(result, allow_pickle=False) as found:
            return Laid(found["corner_uv"], float(found["seconds"]))


def row(name: str, packer: str, surface: Surface, laid: Laid) -> tuple[str, float]:
    """A line of the table, and the efficiency."""
    side = float(np.ptp(laid.corner_uv.reshape(-1, 2), axis=0).max())
    metrics = measure(surface, laid.corner_uv / side, size=SIZE)
    used = float(np.abs(signed_areas(laid.corner_uv)).sum()) / side**2
    gap = "" if metrics.chart_gap_texels is None else f"{metrics.chart_gap_texels:.1f}"
    return f"| {name} | {metrics.charts} | {packer} | {used:.3f} | {gap} | {laid.seconds:.1f} |", used


def main(argv: list[str] | None = None) -> int:
    """Print the table, then each packer's mean."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.packing", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("meshes", nargs="+", type=Path)
    parser.add_argument("--blender-python", help="a Python that has bpy; without it Blender is left out")
    arguments = parser.parse_args(argv)
    files = [file for path in arguments.meshes for file in (sorted(path.iterdir()) if path.is_dir() else [path])]
    means: dict[str, list[float]] = {}
    print("| islands | charts | packer | efficiency | gap | seconds |\n|---|---|---|---|---|---|", flush=True)
    for path in files:
        surface = load_asset(path).surface
        flat, _ = by_xatlas(surface.vertices, surface.faces)
        own = uvunwrap_islands(surface)
        for maker, uv in (("xatlas", flat / flat.max()), ("uvunwrap", own.corner_uv)):
            laid = {"flexpara": by_flexpara(surface, uv), "xatlas": by_xatlas_packer(surface, uv)}
            laid |= {"uvunwrap": own} if maker == "uvunwrap" else {}
            if arguments.blender_python:
                laid["blender"] = by_blender(arguments.blender_python, surface, uv)
            for packer, found in laid.items():
                line, used = row(f"{path.stem}, {maker}", packer, surface, found)
                means.setdefault(packer, []).append(used)
                print(line, flush=True)
    print("\n" + " · ".join(f"{packer} {np.mean(used):.3f} ({len(used)})" for packer, used in means.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())

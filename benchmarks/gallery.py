"""The paper's figures for any meshes: `python -m benchmarks.gallery --models DIR -o OUT [--preset fast]`.

OUT receives MESH.png, a contact sheet with a row for each system, and gallery.png, flexpara's rows of all meshes:
checker renders, seams in red, charts in colours, and the uv layout coloured by normals and by charts.
Systems run as in `benchmarks.paper`; one that gives no layout gives no row and is named on stderr.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flexpara.runtime.files import write_whole
from flexpara.runtime.geometry.metrics import measure, uv_charts
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.mesh import Asset, Atlas
from flexpara.runtime.pack.exact.seamvertices import atlas_normals, split_vertices

from .contact_sheet import render_sheet
from .paper import outcomes_of, with_common_options, with_meshes, words
from .systems import MODES, MULTI_CHART, NAMES

if TYPE_CHECKING:
    from numpy.typing import NDArray

UNIT = 1e-6
"""uv of the unit square are rounded to it, so that corners which agree but for rounding are drawn as joined."""


def atlas_of(asset: Asset, corner_uv: NDArray[np.float64]) -> Atlas:
    """Any system's uv, corner_uv (f, 3, 2) of any unit, as an atlas that fills the unit square; size and padding 0."""
    low, high = corner_uv.min(axis=(0, 1)), corner_uv.max(axis=(0, 1))
    centred = (corner_uv - (low + high) / 2.0) / max(float((high - low).max()), 1e-300) * 0.98 + 0.5
    rounded = np.round(centred / UNIT) * UNIT
    chart, _ = uv_charts(asset.surface.faces, corner_uv)
    faces, source, uv = split_vertices(asset.faces, chart, rounded)
    normals = atlas_normals(asset, source)
    return Atlas(asset.positions[source], faces, uv.astype(np.float32), normals, chart, source, size=0, padding=0)


def title_of(asset: Asset, system: str, corner_uv: NDArray[np.float64]) -> str:
    """Mesh, system, and the figures a reader of the picture asks for."""
    found = measure(asset.surface, corner_uv)
    count = f"{found.charts} chart{'' if found.charts == 1 else 's'}"
    figures = f"{count}, conformality {found.conformal_mean:.4f}, seam {found.seam_length:.2f}"
    return f"{asset.stem} - {system}: {figures}"


def entries_of(asset: Asset, arguments: argparse.Namespace) -> list[tuple[str, str, Atlas]]:
    """(system, title, atlas) of every job that gave a layout; what gave none is named on stderr."""
    found = list[tuple[str, str, Atlas]]()
    for job, outcome in outcomes_of(asset, arguments):
        name = f"{job.system} {job.preset} {job.mode}" if job.system == "flexpara" else f"{job.system} {job.mode}"
        why = "" if outcome.answer is not None else f": {outcome.status}: {outcome.why}"
        print(f"{asset.stem} · {name}{why}", file=sys.stderr, flush=True)
        if outcome.answer is not None:
            uv = outcome.answer.corner_uv
            found.append((job.system, title_of(asset, name, uv), atlas_of(asset, uv)))
    return found


def parse(argv: list[str] | None) -> argparse.Namespace:
    """The command line."""
    about_it = __doc__.splitlines()[0] if __doc__ else ""
    parser = with_common_options(argparse.ArgumentParser(prog="python -m benchmarks.gallery", description=about_it))
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for the pictures")
    parser.add_argument("--systems", type=lambda text: words(text, NAMES), default=("flexpara",), help=",".join(NAMES))
    parser.add_argument("--modes", type=lambda text: words(text, MODES), default=(MULTI_CHART,), help=",".join(MODES))
    return with_meshes(parser, argv)


def main(argv: list[str] | None = None) -> int:
    """Unwrap and draw; 1 when there is a mesh of which there is nothing to draw."""
    arguments, ours, missing = parse(argv), list[tuple[str, Asset, Atlas]](), 0
    arguments.output.mkdir(parents=True, exist_ok=True)
    for path in arguments.files:
        asset = load_asset(path)
        entries = entries_of(asset, arguments)
        missing += not entries
        if entries:
            draw_sheet([(title, asset, atlas) for _, title, atlas in entries], arguments.output / f"{path.stem}.png")
        ours += [(title, asset, atlas) for system, title, atlas in entries if system == "flexpara"]
        if len(arguments.files) > 1 and ours:
            draw_sheet(ours, arguments.output / "gallery.png")
    return 1 if missing else 0


def draw_sheet(entries: list[tuple[str, Asset, Atlas]], path: Path) -> None:
    """One contact sheet, written whole; its path goes to stdout."""
    write_whole(path, lambda place: render_sheet(entries, place), force=True)
    print(path)


if __name__ == "__main__":
    sys.exit(main())

"""The pictures of the documents, from real runs: `python -m benchmarks.pictures MODELS [options|maps|stages …]`.

MODELS is a folder of meshes.  Each picture is a small WebP in docs/pictures, named after what it shows.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

import flexpara
from flexpara.bake.colors.color import chart_colors, srgb_bytes_from_linear
from flexpara.bake.maps.catalogue import all_maps
from flexpara.bake.maps.rays import RaySettings
from flexpara.bake.pictures.canvas import Camera, Lines, Shape, draw, three_quarter_axes
from flexpara.bake.pictures.comparison import Compared, comparison_pixels
from flexpara.bake.pictures.preview import INK, PAPER, checker_cells, layout, shading_normals, solid
from flexpara.bake.raster.context import open_context
from flexpara.bake.seams.seamcheck import seam_edges
from flexpara.runtime.geometry.topology import edge_table
from flexpara.train.charts import charts as chart_module
from flexpara.train.config import FinishConfig
from flexpara.train.search.labels import dual_graph
from flexpara.train.search.starts import clusters

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flexpara.runtime.geometry.topology import EdgeTable
    from flexpara.runtime.mesh import Surface
    from flexpara.train.search.search import Search

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "pictures"
QUALITY = 78
WIDTH = 900
"""Pixels of a sheet at most."""
PANEL = 300
SHOWN: dict[str, tuple[str, tuple[dict[str, Any], ...]]] = {
    "charts": ("spot", ({"charts": 1}, {"charts": 16})),
    "seam-price": ("spot", ({"seam_price": 0.0005}, {"seam_price": 0.003}, {"seam_price": 0.02})),
    "max-stretch": ("spot", ({"max_stretch": 1.005}, {"max_stretch": 1.02}, {"max_stretch": 1.1})),
    "seed": ("spot", ({"seed": 0}, {"seed": 1}, {"seed": 2})),
    "padding": ("spot", ({"padding": 1}, {"padding": 8}, {"padding": 32})),
    "rotation": ("fandisk", ({"rotation": "off"}, {"rotation": "90"}, {"rotation": "any"})),
}
"""Option: mesh, and the settings that are set side by side."""
MAPS = (
    "normal",
    "normal-object",
    "position",
    "chart",
    "uv-checker",
    "ao",
    "bent-normal",
    "thickness",
    "curvature",
    "distortion",
)
SIZE = 512
"""Texels of the atlases that are shown: paddings are seen."""


def save(name: str, pixels: NDArray[np.floating]) -> None:
    """Linear light (h, w, 3) as a small WebP file."""
    image = Image.fromarray(srgb_bytes_from_linear(np.ascontiguousarray(pixels, np.float32)))
    image.thumbnail((WIDTH, WIDTH), Image.Resampling.LANCZOS)
    FOLDER.mkdir(exist_ok=True)
    image.save(FOLDER / f"{name}.webp", quality=QUALITY, method=6)
    print(f"{name}: {(FOLDER / f'{name}.webp').stat().st_size // 1024} KiB", flush=True)


def options(models: Path) -> None:
    """Each option at several settings, on the shape and in uv."""
    for name, (mesh, settings) in SHOWN.items():
        rows = []
        for setting in settings:
            result = flexpara.unwrap(models / f"{mesh}.obj", **{"size": SIZE, **setting})
            metrics = result.report["metrics"]
            numbers = {
                "charts": metrics["charts"],
                "stretch": metrics["symmetric_dirichlet_mean"],
                "seam": metrics["seam_length"],
            }
            rows.append(Compared(result.asset, result.atlas, numbers))
            print(name, setting, numbers, flush=True)
        save(name, comparison_pixels(rows))


def maps(models: Path) -> None:
    """Each map of one mesh on one atlas, numbers stretched over their range."""
    result = flexpara.unwrap(models / "spot.obj", size=SIZE)
    named: list[tuple[str, Any, dict[str, Any]]] = [(name, name, {}) for name in MAPS]
    few = all_maps("opengl", RaySettings(count=2))["ao"]
    named += [("normal-format", "normal", {"normal_format": "directx"}), ("rays", few, {})]
    for shown, wanted, settings in named:
        (name, texture), *_ = flexpara.bake.bake(result.atlas, result.asset, [wanted], size=SIZE, **settings).items()
        pixels = np.atleast_3d(texture.pixels)[..., :3].astype(np.float64)
        low, high = float(pixels.min()), float(pixels.max())
        signed = name in ("normal", "normal-object", "bent-normal", "bent-normal-object")
        pixels = 0.5 * (pixels + 1.0) if signed else (pixels - min(low, 0.0)) / max(high - min(low, 0.0), 1e-9)
        if texture.encoding == "srgb":
            pixels = srgb_bytes_from_linear(pixels.astype(np.float32)) / 255.0
        full = np.repeat(pixels, 3, axis=2) if pixels.shape[2] == 1 else pixels
        image = Image.fromarray((np.clip(full, 0.0, 1.0) * 255.0).round().astype(np.uint8))
        image.resize((PANEL, PANEL), Image.Resampling.LANCZOS).save(
            FOLDER / f"map-{shown}.webp", quality=QUALITY, method=6
        )
        print(f"map-{shown}", flush=True)


def stages(models: Path) -> None:
    """One mesh on its way: the surface, the proxy, a start, the search's charts, those of the surface, the page."""
    config = FinishConfig()
    kept: list[Search] = []
    original = chart_module.best_search

    def watched(*words: Any) -> Search:
        kept.append(original(*words))
        return kept[-1]

    chart_module.best_search = watched
    try:
        result = flexpara.unwrap(models / "bunny.obj", size=1024)
    finally:
        chart_module.best_search = original
    proxy, asset, atlas = kept[-1].surface, result.asset, result.atlas
    table = edge_table(proxy.faces)
    graph = dual_graph(proxy, table, config.labels.seams)
    start = clusters(proxy, graph, 8, config, np.random.default_rng(0))
    found = np.unique(kept[-1].label(), return_inverse=True)[1].reshape(-1)
    colors, plain = chart_colors(32), np.full((len(proxy.faces), 3), 0.5)
    with open_context() as context:
        whole = solid(atlas, shading_normals(asset), np.full((len(atlas.faces), 3), 0.5, np.float32))
        charted = solid(atlas, shading_normals(asset), colors[atlas.face_chart], cells=checker_cells(atlas))
        camera = Camera.fit(atlas.positions[atlas.faces].reshape(-1, 3), three_quarter_axes())
        seams = Lines(seam_edges(atlas), INK, 1.6)
        views = [
            draw(context, camera, whole, Lines(seams.segments[:1] * 0.0, INK, 0.1), pixels=PANEL, paper=PAPER),
            drawn(context, proxy, plain, table.edges),
            drawn(context, proxy, colors[start % 32], borders(table, start)),
            drawn(context, proxy, colors[found], borders(table, found)),
            draw(context, camera, charted, seams, pixels=PANEL, paper=PAPER),
            draw(context, *layout(atlas, colors), pixels=PANEL, paper=PAPER),
        ]
    save("stages", np.concatenate([np.concatenate(views[:3], axis=1), np.concatenate(views[3:], axis=1)]))


def borders(table: EdgeTable, label: NDArray[np.int64]) -> NDArray[np.int64]:
    """(e, 2) the edges between faces of two labels (f,)."""
    pairs = table.edge_faces[table.manifold]
    return table.edges[table.manifold][label[pairs[:, 0]] != label[pairs[:, 1]]]


def drawn(context: Any, surface: Surface, colors: NDArray[Any], lines: NDArray[np.int64]) -> NDArray[np.float32]:
    """A surface in colours of its faces (f, 3), some of its edges (e, 2) drawn."""
    corner, uv = surface.triangles, np.zeros((len(surface.faces), 3, 2))
    shape = Shape(corner, np.repeat(surface.face_normals()[:, None], 3, axis=1), uv, colors.astype(np.float32))
    camera = Camera.fit(corner.reshape(-1, 3), three_quarter_axes())
    return draw(context, camera, shape, Lines(surface.vertices[lines], INK, 0.8), pixels=PANEL, paper=PAPER)


def main() -> None:
    """Make all of them, or those named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("models", type=Path)
    parser.add_argument(
        "which", nargs="*", choices=["options", "maps", "stages"], default=["options", "maps", "stages"]
    )
    asked = parser.parse_args()
    for name in asked.which:
        {"options": options, "maps": maps, "stages": stages}[name](asked.models)


if __name__ == "__main__":
    main()

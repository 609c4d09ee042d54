"""One mesh on its way, from the surface to the ONNX file and a map: a panel for each stage."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import flexpara
from benchmarks.pictures.sheets import save
from flexpara.bake.colors.color import chart_colors
from flexpara.bake.pictures.canvas import Camera, Lines, Shape, draw, three_quarter_axes
from flexpara.bake.pictures.preview import INK, PAPER, checker_cells, layout, shading_normals, solid
from flexpara.bake.raster.context import open_context
from flexpara.bake.seams.seamcheck import seam_edges
from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.sessions.agreement import surface_points
from flexpara.train.charts import charts as chart_module
from flexpara.train.config import FinishConfig
from flexpara.train.search.labels import dual_graph
from flexpara.train.search.starts import clusters

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flexpara.runtime.geometry.topology import EdgeTable
    from flexpara.runtime.mesh import Asset, Atlas, Surface
    from flexpara.train.search.search import Search

PANEL, INNER = 300, 264
"""Pixels of a panel, and of a page in it."""
POINTS = 200_000


def stages(models: Path) -> None:
    """Eight panels of the bunny."""
    config = FinishConfig()
    kept: list[Search] = []
    original = chart_module.best_search

    def watched(*words: Any) -> list[Search]:
        found = original(*words)
        kept.append(found[0])
        return found

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
    views += [answers(result.onnx, atlas, colors), occlusion(atlas, asset)]
    save("stages", np.concatenate([np.concatenate(views[:4], axis=1), np.concatenate(views[4:], axis=1)]))


def answers(onnx: bytes, atlas: Atlas, colors: NDArray[np.float32]) -> NDArray[np.float32]:
    """Each point of the surface at the uv, and in the colour (k, 3) of the chart, that the ONNX file gives it."""
    points, *_ = surface_points(atlas, POINTS, np.random.default_rng(0))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.onnx"
        path.write_bytes(onnx)
        found = flexpara.runtime.UnwrapSession(path).unwrap(points)
    panel = np.full((PANEL, PANEL, 3), PAPER, np.float32)
    column, row = (found.uv * [1.0, -1.0] + [0.0, 1.0]).T * INNER + 0.5 * (PANEL - INNER)
    panel[row.astype(np.int64), column.astype(np.int64)] = colors[found.chart]
    return panel


def occlusion(atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
    """The map ao, small."""
    texture = flexpara.bake.bake(atlas, asset, ["ao"], size=INNER)["ao"]
    panel = np.full((PANEL, PANEL, 3), PAPER, np.float32)
    inside = slice((PANEL - INNER) // 2, (PANEL - INNER) // 2 + INNER)
    panel[inside, inside] = np.atleast_3d(texture.pixels)
    return panel


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

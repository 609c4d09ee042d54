"""Metrics of uv as they stand in written files: `-m benchmarks.corpus.judge RESULT.json EVALUATOR SOURCE FILE…`.

f faces.  Files are read by trimesh, each geometry once; vertices of equal position are one.  A .npz holds vertices,
faces and corner_uv (a peer's answer).  EVALUATOR is a Python file with `evaluate(vertices, faces, corner_uv)`, such as
the `uveval.py` that judges this project from outside, or `none`; what both it and the project's own metrics say is
kept side by side.  stretch: symmetric Dirichlet energy, 1 = isometric, each face trimmed at 100, surface and uv scaled
to equal total area.  seam: length of interior edges whose uv differ / √area.
objective: Σ area · (stretch − 1) + 0.003 · seam, areas as shares of the whole.
area: of the written surface over that of the SOURCE as trimesh reads it; none where it can't, or SOURCE is `none`.
"""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flexpara.runtime.errors import FlexparaError, InputError
from flexpara.runtime.geometry.metrics import face_distortion, measure, uv_charts
from flexpara.runtime.geometry.topology import components
from flexpara.runtime.geometry.triangles import triangle_areas
from flexpara.runtime.mesh import Surface

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Evaluator = Callable[[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]], dict[str, Any]]

SEAM_PRICE = 0.003
TOLERANCE = {"stretch": 1e-3, "seam": 1e-3, "overlap": 1e-9}
"""Differences above which two evaluators disagree, relative above 1; 0 for what is counted."""


def read_layout(path: Path) -> tuple[Surface, NDArray[np.float64]]:
    """The surface of a file, welded by position, and its corner_uv (f, 3, 2), v up.

    Raises:
        InputError: a part of the file has no uv, or there is no triangle.
    """
    if path.suffix == ".npz":
        with np.load(path, allow_pickle=False) as found:
            return Surface(found["vertices"], found["faces"]), found["corner_uv"]
    corners, corner_uv, done = list[Any](), list[Any](), set[str]()
    for name, mesh, triangles in parts_of(path):
        if name in done:  # an instance shares the uv of the first
            continue
        done.add(name)
        uv = getattr(mesh.visual, "uv", None)
        if uv is None:
            raise InputError(f"{path.name}: its part {name!r} has no uv, expected uv on all faces; unwrap it again")
        corners.append(triangles)
        corner_uv.append(np.asarray(uv, np.float64)[mesh.faces])
    if not corners:
        raise InputError(f"{path.name} holds no triangle, expected a mesh; unwrap it again")
    vertices, welded = np.unique(np.concatenate(corners).reshape(-1, 3), axis=0, return_inverse=True)
    return Surface(vertices, welded.reshape(-1, 3).astype(np.int64)), np.concatenate(corner_uv)


def parts_of(path: Path) -> list[tuple[str, Any, NDArray[np.float64]]]:
    """Name, trimesh's mesh and triangles (f, 3, 3) in the scene, of each node of a file that has faces."""
    import trimesh

    scene = trimesh.load_scene(path, process=False)
    found = []
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        mesh = scene.geometry[name]
        if len(getattr(mesh, "faces", ())):
            xyz = np.asarray(mesh.vertices, np.float64) @ transform[:3, :3].T + transform[:3, 3]
            found.append((str(name), mesh, xyz[np.asarray(mesh.faces)]))
    return found


def area_of(path: str) -> float | None:
    """Surface area of a file as trimesh reads it; None for "none", and where it reads no area."""
    if path == "none":
        return None
    try:
        total = sum(float(triangle_areas(triangles).sum()) for _, _, triangles in parts_of(Path(path)))
    except Exception as error:  # whatever a reader of forty formats may raise: then there is nothing to compare with
        print(f"{path}: trimesh can't read it: {error!r}", file=sys.stderr)
        return None
    return total if 0.0 < total < float("inf") else None


def judged(surface: Surface, corner_uv: NDArray[np.float64], evaluate: Evaluator | None = None) -> dict[str, Any]:
    """Everything the tables show of one layout.  Raises: as `measure` does.

    Faces that became a line or a point when written (equal corners) are counted as `collapsed` and left out.
    """
    lost = (surface.faces == np.roll(surface.faces, 1, axis=1)).any(axis=1)
    solid, uv = Surface(surface.vertices, surface.faces[~lost]), corner_uv[~lost]
    own = measure(solid, uv)
    chart = uv_charts(solid.faces, uv)[0]
    energy, area = face_distortion(solid, uv), solid.face_areas()
    worst = (np.bincount(chart, area * energy) / np.maximum(np.bincount(chart, area), np.finfo(float).tiny)).max()
    parts = int(components(solid.faces).max()) + 1
    row: dict[str, Any] = {
        "faces": len(surface.faces),
        "collapsed": int(lost.sum()),
        "parts": parts,
        "charts": own.charts,
        "stretch": own.symmetric_dirichlet_mean,
        "stretch_p95": weighted_quantile(energy, area, 0.95),
        "worst_chart": float(worst),
        "flips": own.flipped_faces,
        "degenerate": own.degenerate_uv_faces,
        "overlap": own.overlap_fraction,
        "seam": own.seam_length,
        "packing": own.packing_efficiency,
        "outside": int(((uv < 0.0) | (uv > 1.0)).any(axis=(1, 2)).sum()),
    }
    if evaluate is not None:
        try:
            row |= beside(row, evaluate(solid.vertices, solid.faces, uv))
        except Exception as error:  # what another's evaluator can't do is said; the project's own numbers stand
            row["evaluator_error"] = repr(error)
    row["charts_per_part"] = row["charts"] / parts
    row["objective"] = row["stretch"] - 1.0 + SEAM_PRICE * row["seam"]
    return row


def beside(own: dict[str, Any], other: dict[str, Any]) -> dict[str, Any]:
    """The columns that an evaluator from outside has, the worse of both for defects, and where the two disagree."""
    said = {"charts": other["charts"], "stretch": other["symdir"], "seam": other["seam_len"]}
    said |= {"flips": other["flips_n"], "degenerate": other["uv_degenerate_n"]}
    said["overlap"] = other.get("lag_overlap_area_frac", other.get("overlap", 0.0))
    differ = [
        f"{name} {own[name]:.6g} / {value:.6g}"
        for name, value in said.items()
        if abs(own[name] - value) > TOLERANCE.get(name, 0.0) * max(1.0, abs(own[name]))
    ]
    defects = {name: max(own[name], said[name]) for name in ("flips", "degenerate", "overlap")}
    return said | defects | {"disagreement": "; ".join(differ), "evaluator_error": other.get("lagrange_error", "")}


def weighted_quantile(value: NDArray[np.float64], weight: NDArray[np.float64], share: float) -> float:
    """The smallest of the values below or at which `share` of the weight lies."""
    order = np.argsort(value)
    total = np.cumsum(weight[order])
    return float(value[order][np.searchsorted(total, share * total[-1])])


def load_evaluator(path: str) -> Evaluator | None:
    """`evaluate` of a Python file, without its sampled overlap test where it has that option; None for "none".

    Raises:
        InputError: there is no such file.
    """
    if path == "none":
        return None
    spec = importlib.util.spec_from_file_location("evaluator", path)
    if spec is None or spec.loader is None or not Path(path).is_file():
        raise InputError(f"no evaluator at {path}, expected a Python file with evaluate(); pass --evaluator none")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return lambda vertices, faces, uv: module.evaluate(vertices, faces, uv, raster=False)


def main(result: str, evaluator: str, source: str, *paths: str) -> int:
    """Write {file name: metrics, or {"error": …}} as JSON."""
    evaluate, area, found = load_evaluator(evaluator), area_of(source), dict[str, Any]()
    for path in map(Path, paths):
        try:
            found[path.name] = judged(*read_layout(path), evaluate)
            found[path.name]["area"] = None if area is None else (area_of(str(path)) or 0.0) / area
        except FlexparaError as error:
            found[path.name] = {"error": str(error)}
    Path(result).write_text(json.dumps(found), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

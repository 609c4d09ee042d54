"""The whole way with real training: file → atlas → ONNX → query, by the API and by the command line.

Two small surfaces, an open tube and a closed torus.  What comes out is judged by `measure` on the files as written.
"""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import flexpara
from flexpara.runtime.geometry.metrics import Metrics, measure
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.mesh import Asset
from flexpara.runtime.samples import make_sample
from flexpara.runtime.sessions.session import UnwrapSession

ABSENT = [name for name in ("torch", "igl", "onnx") if find_spec(name) is None]
pytestmark = pytest.mark.skipif(bool(ABSENT), reason=f"{', '.join(ABSENT)} not installed")
SIZE, CHARTS, SEED = 256, 4, 5
STRETCH = {"tube": 1.02, "torus": 1.05}


@dataclass(frozen=True, eq=False)
class Run:
    """One unwrap: the source, the asset read from it, the result, and the folder of its files."""

    source: Path
    asset: Asset
    result: flexpara.UnwrapResult
    folder: Path

    @property
    def written(self) -> Asset:
        return load_asset(self.folder / f"{self.source.stem}.glb")

    def metrics(self) -> Metrics:
        """Of the uv in the GLB file, on the surface of the source."""
        uv = self.written.uv
        assert uv is not None
        return measure(self.asset.surface, uv[self.written.faces].astype(np.float64), size=SIZE)


@pytest.fixture(scope="module", params=[pytest.param(name, marks=pytest.mark.xdist_group(name)) for name in STRETCH])
def run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A surface unwrapped by the API, from a file, in units and at a place of its own."""
    vertices, faces = make_sample(request.param, resolution=20)
    folder = tmp_path_factory.mktemp(request.param)
    source = folder / f"{request.param}.obj"
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in (40.0 * vertices + [100.0, -30.0, 7.0]).tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
    source.write_text("\n".join(lines), encoding="utf-8")
    result = flexpara.unwrap(source, charts=CHARTS, size=SIZE, seed=SEED)
    result.save(folder / "api", maps=(), preview=False)
    return Run(source, load_asset(source), result, folder / "api")


def test_the_written_atlas_is_valid_and_hardly_stretched(run: Run) -> None:
    np.testing.assert_allclose(
        run.written.positions[run.written.faces], run.asset.positions[run.asset.faces], rtol=1e-6
    )
    found = run.metrics()
    assert (found.flipped_faces, found.degenerate_uv_faces, found.overlap_fraction) == (0, 0, 0.0)
    assert found.symmetric_dirichlet_mean < STRETCH[run.source.stem]
    assert 1 <= found.charts <= CHARTS
    assert found.packing_square == "unit"
    assert found.chart_gap_texels is None or found.chart_gap_texels >= 2 * run.result.atlas.padding - 1e-3


def test_the_report_says_what_the_files_hold(run: Run) -> None:
    report = json.loads((run.folder / f"{run.source.stem}.report.json").read_text(encoding="utf-8"))
    found = run.metrics()
    for name in ("charts", "flipped_faces", "seam_edges"):
        assert report["metrics"][name] == getattr(found, name)
    for name in ("symmetric_dirichlet_mean", "seam_length", "packing_efficiency"):
        assert report["metrics"][name] == pytest.approx(getattr(found, name), rel=1e-4)
    assert (report["settings"]["charts"], report["settings"]["seed"]) == (CHARTS, SEED)


def test_the_onnx_file_knows_chart_and_uv_of_any_point(run: Run) -> None:
    """Against the finished atlas, at points strewn over the surface by this test."""
    atlas, rng = run.result.atlas, np.random.default_rng(9)
    area = run.asset.surface.face_areas()
    face = rng.choice(len(area), size=4000, p=area / area.sum())
    weight = rng.dirichlet(np.ones(3), size=len(face))
    points = np.einsum("nc,ncx->nx", weight, atlas.positions[atlas.faces[face]])
    expected = np.einsum("nc,ncx->nx", weight, atlas.corner_uv[face])
    uv, chart, score = UnwrapSession(run.folder / f"{run.source.stem}.onnx").unwrap(points)
    right = chart == atlas.face_chart[face]
    assert right.mean() > 0.97
    assert score.min() >= 0.0
    assert score.max() <= 1.0 + 1e-6  # a softmax in float32
    away = np.linalg.norm(uv - expected, axis=1)[right] * SIZE
    assert np.median(away) < 0.5
    assert np.quantile(away, 0.95) < 2.0
    network = run.result.report["network"]
    assert network["chart_agreement"] == pytest.approx(right.mean(), abs=0.02)


def test_the_command_line_writes_the_same_bytes_and_answers_alike(run: Run, tmp_path: Path) -> None:
    """A process of its own: the same seed gives the same mesh and the same networks."""
    stem, out = run.source.stem, tmp_path / "out"
    asked = ["--charts", str(CHARTS), "--size", str(SIZE), "--seed", str(SEED)]
    flexpara_(["unwrap", str(run.source), "-o", str(out), "--maps", "none", "--no-preview", "--quiet", *asked])
    for name in (f"{stem}.glb", f"{stem}.onnx"):
        assert (out / name).read_bytes() == (run.folder / name).read_bytes(), name
    points = run.asset.surface.triangles.mean(axis=1)
    np.save(tmp_path / "points.npy", points)
    flexpara_(["query", str(out / f"{stem}.onnx"), str(tmp_path / "points.npy"), "-o", str(tmp_path / "uv.npz")])
    answer = UnwrapSession(run.folder / f"{stem}.onnx").unwrap(points)
    with np.load(tmp_path / "uv.npz") as found:
        np.testing.assert_array_equal(found["uv"], answer[0])
        np.testing.assert_array_equal(found["chart"], answer[1])


def flexpara_(arguments: list[str]) -> None:
    """The command line, as a user starts it."""
    done = subprocess.run([sys.executable, "-m", "flexpara", *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr

"""The gallery draws any system's uv: as it is, filling the square, with its seams where the system cut."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

pytest.importorskip("moderngl")

from benchmarks import gallery, paper
from benchmarks.contact_sheet import BAND, COLUMNS, PANEL
from benchmarks.systems import Answer, Job, Outcome
from flexpara.bake.files.images import read_image
from flexpara.bake.seams.seamcheck import chart_outlines, seam_edges
from flexpara.runtime.io.meshfile import asset_from_arrays
from flexpara.runtime.mesh import Asset, Surface

CORNERS = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0]], np.float64)
FACES = np.array([[0, 4, 5], [0, 5, 3], [4, 1, 2], [4, 2, 5]])


def sheet() -> Asset:
    """A rectangle of 2 × 1, in four faces."""
    return asset_from_arrays(CORNERS, FACES, stem="sheet")


def flat(asset: Asset, *, cut: bool, scale: float = 700.0) -> NDArray[np.float64]:
    """Its exact uv, in texels of some size; cut down the middle where asked."""
    uv = asset.surface.triangles[..., :2].copy()
    uv[2:, :, 0] += 0.5 if cut else 0.0
    return uv * scale - 40.0


def arguments(folder: Path, *more: str) -> list[str]:
    """A command line for one written mesh."""
    vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS.tolist())
    faces = "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in FACES.tolist())
    (folder / "sheet.obj").write_text(vertices + faces)
    return ["--models", str(folder / "sheet.obj"), "-o", str(folder / "out"), *more]


def test_an_atlas_of_any_uv_fills_the_square_without_stretching_it() -> None:
    asset = sheet()
    atlas = gallery.atlas_of(asset, flat(asset, cut=False))
    low, high = atlas.uv.min(axis=0), atlas.uv.max(axis=0)
    np.testing.assert_allclose(high - low, [0.98, 0.49], atol=1e-5)
    np.testing.assert_allclose(high + low, [1.0, 1.0], atol=1e-5)
    np.testing.assert_array_equal(atlas.positions[atlas.faces], asset.positions[asset.faces])


def test_only_the_systems_cuts_are_drawn_as_seams() -> None:
    asset = sheet()
    for cut, charts, seams, outlines in ((False, 1, 0, 6), (True, 2, 1, 8)):
        atlas = gallery.atlas_of(asset, flat(asset, cut=cut))
        assert atlas.face_chart.max() + 1 == charts
        assert len(seam_edges(atlas)) == seams
        assert len(chart_outlines(atlas)) == outlines


def test_corners_that_agree_but_for_rounding_are_one_vertex() -> None:
    asset = sheet()
    uv = flat(asset, cut=False)
    uv += np.random.default_rng(0).uniform(-1e-7, 1e-7, uv.shape)
    assert len(chart_outlines(gallery.atlas_of(asset, uv))) == 6


def test_the_title_has_the_figures_of_the_layout() -> None:
    asset = sheet()
    title = gallery.title_of(asset, "xatlas", flat(asset, cut=True))
    assert title == "sheet - xatlas: 2 charts, conformality 0.0000, seam 0.71"
    assert "1 chart, " in gallery.title_of(asset, "xatlas", flat(asset, cut=False))


def test_a_row_for_each_system_that_gave_a_layout(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(job: Job, surface: Surface, *_: object) -> Outcome:
        if job.system == "xatlas":
            return Outcome("incomplete", "the budget ran out")
        return Outcome("done", "", Answer(surface.triangles[..., :2], 1.0, {}))

    monkeypatch.setattr(paper, "run", run)
    assert gallery.main(arguments(tmp_path, "--systems", "flexpara,xatlas,uvunwrap")) == 0
    assert "xatlas multi-chart: incomplete: the budget ran out" in capsys.readouterr().err
    picture = read_image(tmp_path / "out" / "sheet.png")
    assert picture.shape == (BAND + 2 * (BAND + PANEL), len(COLUMNS) * PANEL, 3)
    assert not (tmp_path / "out" / "gallery.png").exists()


def test_nothing_to_draw_is_a_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(paper, "run", lambda *_: Outcome("not run", "it isn't there"))
    assert gallery.main(arguments(tmp_path)) == 1
    assert list((tmp_path / "out").iterdir()) == []

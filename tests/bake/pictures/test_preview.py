"""The preview shows checker, layout and distortion; its colours mean what the legend says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexpara.bake.color import chart_colors, srgb_bytes_from_linear
from flexpara.bake.files.images import read_image
from flexpara.bake.pictures import preview
from flexpara.runtime.errors import ShapeError
from flexpara.runtime.mesh import Asset, Atlas

Pair = tuple[Atlas, Asset]


def test_the_picture_has_three_panels(sphere: Pair, tmp_path: Path) -> None:
    atlas, _ = sphere
    preview.render_preview(atlas, np.ones(len(atlas.faces)), tmp_path / "a.png")
    picture = read_image(tmp_path / "a.png")
    assert picture.shape == (preview.PANEL + preview.FOOT, 3 * preview.PANEL, 3)
    paper = srgb_bytes_from_linear(np.array(preview.PAPER, np.float32))
    for panel in range(3):
        part = picture[: preview.PANEL, panel * preview.PANEL : (panel + 1) * preview.PANEL]
        assert (np.abs(part[2, 2].astype(int) - paper) <= 1).all()
        drawn = (np.abs(part.astype(int) - paper) > 3).any(axis=-1)
        assert 0.4 < drawn.mean() < 0.85


def test_the_layout_shows_charts_where_their_uv_are(two_charts: Pair) -> None:
    atlas, _ = two_charts
    picture = preview.preview_pixels(atlas, np.ones(4))[: preview.PANEL, preview.PANEL : 2 * preview.PANEL]
    for chart, u in ((0, 0.25), (1, 0.75)):
        column = round((0.5 + (u - 0.5) * 0.88) * preview.PANEL)
        np.testing.assert_allclose(picture[preview.PANEL // 2, column], chart_colors(2)[chart], atol=2e-3)
    np.testing.assert_allclose(picture[100, preview.PANEL // 2], preview.SHEET, atol=2e-3)


def test_red_is_larger_and_blue_is_smaller(two_charts: Pair) -> None:
    atlas, _ = two_charts
    uneven = atlas.uv.copy()
    uneven[4:] = (uneven[4:] - 0.5) * 0.5 + 0.5
    atlas = replace(atlas, uv=uneven)
    value = preview.signed_distortion(atlas, np.array([1.3, 1.1, 1.2, np.inf]), 1.2)
    np.testing.assert_allclose(value, [1.0, 0.5, -1.0, -1.0])
    colors = preview.heat_colors(value)
    assert colors[0, 0] > 2 * colors[0, 2]
    assert colors[2, 2] > 2 * colors[2, 0]


def test_no_distortion_is_near_white() -> None:
    white = preview.heat_colors(np.zeros(1))[0]
    assert white.min() > 0.8
    assert np.ptp(white) < 0.01


@pytest.mark.parametrize(("worst", "scale"), [(1.0, 1.02), (1.04, 1.05), (2.7, 3.0), (np.inf, 100.0)])
def test_the_scale_is_the_first_that_holds_the_faces(worst: float, scale: float) -> None:
    assert preview.distortion_scale(np.full(100, worst)) == scale


def test_seams_of_a_cut_sphere_are_its_borders(sphere: Pair) -> None:
    atlas, _ = sphere
    segments = preview.seam_segments(atlas, atlas.positions)
    assert segments.shape == (2 * 16 + 2 * 24, 2, 3)
    on_the_cut = (np.abs(segments[..., 0]) < 1e-9).all(axis=1) & (segments[..., 2] > 0).all(axis=1)
    assert on_the_cut.sum() == 2 * 16


def test_checks_have_the_size_they_should(quad: Pair) -> None:
    assert preview.checker_cells(quad[0]) == round(preview.CHECKS / np.sqrt(2))


def test_the_legend_spans_blue_to_red() -> None:
    foot = preview.legend(1.2)
    bar = foot[20, preview.PANEL // 4 : preview.PANEL * 3 // 4]
    np.testing.assert_allclose(bar[[0, -1]], preview.heat_colors(np.array([-1.0, 1.0])), atol=1e-6)


def test_a_value_for_every_face_is_needed(quad: Pair) -> None:
    with pytest.raises(ShapeError, match=r"\(3,\); expected one value for 2 faces"):
        preview.preview_pixels(quad[0], np.ones(3))


def test_a_point_like_face_does_not_stop_the_picture(quad: Pair) -> None:
    atlas, _ = quad
    flat = replace(atlas, positions=atlas.positions * [1.0, 0.0, 0.0], normals=np.zeros((4, 3), np.float32))
    assert np.isfinite(preview.preview_pixels(flat, np.full(2, np.inf))).all()

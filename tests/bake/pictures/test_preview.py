"""The preview shows checker, layout and distortion; its colours mean what the legend says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from flexpara.bake.colors.color import chart_colors, srgb_bytes_from_linear
from flexpara.bake.colors.heat import heat_colors
from flexpara.bake.files.images import read_image
from flexpara.bake.pictures import preview
from flexpara.runtime.mesh import Asset, Atlas, Surface

Pair = tuple[Atlas, Asset]


def test_the_picture_has_three_panels(sphere: Pair, tmp_path: Path) -> None:
    preview.render_preview(*sphere, tmp_path / "a.png")
    picture = read_image(tmp_path / "a.png")
    assert picture.shape == (preview.PANEL + preview.FOOT, 3 * preview.PANEL, 3)
    paper = srgb_bytes_from_linear(np.array(preview.PAPER, np.float32))
    for panel in range(3):
        part = picture[: preview.PANEL, panel * preview.PANEL : (panel + 1) * preview.PANEL]
        assert (np.abs(part[2, 2].astype(int) - paper) <= 1).all()
        drawn = (np.abs(part.astype(int) - paper) > 3).any(axis=-1)
        assert 0.4 < drawn.mean() < 0.85


def test_the_layout_shows_charts_where_their_uv_are(two_charts: Pair) -> None:
    picture = preview.preview_pixels(*two_charts)[: preview.PANEL, preview.PANEL : 2 * preview.PANEL]
    for chart, u in ((0, 0.25), (1, 0.75)):
        column = round((0.5 + (u - 0.5) * 0.88) * preview.PANEL)
        np.testing.assert_allclose(picture[preview.PANEL // 2, column], chart_colors(2)[chart], atol=2e-3)
    np.testing.assert_allclose(picture[100, preview.PANEL // 2], preview.SHEET, atol=2e-3)


def test_checks_have_the_size_they_should(quad: Pair) -> None:
    assert preview.checker_cells(quad[0]) == round(preview.CHECKS / np.sqrt(2))


def test_the_legend_spans_blue_to_red() -> None:
    foot = preview.legend(1.2)
    bar = foot[20, preview.PANEL // 4 : preview.PANEL * 3 // 4]
    np.testing.assert_allclose(bar[[0, -1]], heat_colors(np.array([-1.0, 1.0])), atol=1e-6)


def test_a_point_like_face_does_not_stop_the_picture(quad: Pair) -> None:
    atlas, asset = quad
    flat = atlas.positions * [1.0, 0.0, 0.0]
    atlas = replace(atlas, positions=flat, normals=np.zeros((4, 3), np.float32))
    asset = replace(asset, positions=flat, surface=Surface(flat, asset.faces))
    assert np.isfinite(preview.preview_pixels(atlas, asset)).all()


def cube(pair: Callable[..., Pair]) -> Pair:
    """The unit cube in twelve faces, four vertices a side, a square of uv for each side; no normals of its own."""
    positions, faces, uv = list[list[float]](), list[list[int]](), list[list[float]]()
    for axis in range(3):
        for side in (0, 1):
            first = len(positions)
            for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
                corner = [0.0, 0.0, 0.0]
                corner[axis], corner[(axis + 1) % 3], corner[(axis + 2) % 3] = side, a, b
                positions.append(corner)
                uv.append([(axis + 0.1 + 0.8 * a) / 3, (side + 0.1 + 0.8 * b) / 3])
            square = [[0, 1, 2], [0, 2, 3]] if side else [[0, 2, 1], [0, 3, 2]]
            faces += [[first + corner for corner in face] for face in square]
    xyz = np.array(positions)
    welded, weld = np.unique(xyz, axis=0, return_inverse=True)
    index = np.array(faces)
    return pair(xyz, index, uv, weld=weld.reshape(-1), surface=Surface(welded, weld.reshape(-1)[index]))


def test_a_cube_has_one_shade_a_side(pair: Callable[..., Pair]) -> None:
    """Smooth normals would show gradients and dark triangles; here the colours of the right panel are few."""
    atlas, asset = cube(pair)
    np.testing.assert_allclose(
        preview.shading_normals(asset), np.repeat(asset.surface.face_normals()[:, None], 3, axis=1), atol=1e-12
    )
    picture = preview.preview_pixels(atlas, asset)[: preview.PANEL, 2 * preview.PANEL :]
    shades, count = np.unique(np.round(picture.reshape(-1, 3), 3), axis=0, return_counts=True)
    assert (count > 5000).sum() == 4, shades[count > 5000]  # three sides and the paper


def test_the_source_s_own_normals_shade(quad: Pair) -> None:
    atlas, asset = quad
    leaning = np.tile([0.6, 0.0, 0.8], (4, 1))
    np.testing.assert_array_equal(preview.shading_normals(replace(asset, normals=leaning))[0, 0], leaning[0])
    del atlas

"""A contact sheet has a row for each unwrap and shows what its columns are called after."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexpara.bake.color import chart_colors, srgb_exact
from flexpara.bake.files.images import read_image
from flexpara.bake.pictures import gallery
from flexpara.bake.pictures.preview import PAPER
from flexpara.runtime.errors import InputError
from flexpara.runtime.mesh import Asset, Atlas

Pair = tuple[Atlas, Asset]
SMALL = gallery.SMALLEST_PANEL


def panel(picture: np.ndarray, column: str, *, row: int = 0) -> np.ndarray:
    """One panel of a sheet of small panels."""
    left = gallery.COLUMNS.index(column) * SMALL
    top = 2 * gallery.BAND + row * (gallery.BAND + SMALL)
    return picture[top : top + SMALL, left : left + SMALL]


def is_red(part: np.ndarray) -> np.ndarray:
    """(h, w) bool: as red as seams are."""
    return (part[..., 0] > 0.5) & (part[..., 1:].max(axis=-1) < 0.05)


def test_a_normals_colour_is_its_half_plus_a_half_in_srgb(quad: Pair) -> None:
    colors = gallery.normal_colors(quad[0])
    np.testing.assert_allclose(srgb_exact(colors), np.broadcast_to([0.5, 0.5, 1.0], (2, 3)), atol=1e-6)
    turned = replace(quad[0], normals=np.tile(np.array([-1.0, 0.0, 0.0], np.float32), (4, 1)))
    np.testing.assert_allclose(srgb_exact(gallery.normal_colors(turned))[0], [0.0, 0.5, 0.5], atol=1e-6)


def test_a_row_for_each_entry(quad: Pair, sphere: Pair, tmp_path: Path) -> None:
    path = tmp_path / "sheet.png"
    gallery.render_sheet([("quad", quad[0]), ("sphere", sphere[0])], path, pixels=SMALL)
    assert read_image(path).shape == (gallery.BAND + 2 * (gallery.BAND + SMALL), 6 * SMALL, 3)


def test_the_layouts_are_coloured_by_normal_and_by_chart(two_charts: Pair) -> None:
    picture = gallery.sheet_pixels([("two", two_charts[0])], pixels=SMALL)
    for chart, u in ((0, 0.25), (1, 0.75)):
        column = round((0.5 + (u - 0.5) * 0.88) * SMALL)
        by_chart = panel(picture, "UV BY CHART")[SMALL // 2, column]
        np.testing.assert_allclose(by_chart, chart_colors(2)[chart], atol=2e-3)
        by_normal = panel(picture, "UV BY NORMAL")[SMALL // 2, column]
        np.testing.assert_allclose(srgb_exact(by_normal), [0.5, 0.5, 1.0], atol=4e-3)


def test_only_the_seams_panel_is_red(sphere: Pair) -> None:
    picture = gallery.sheet_pixels([("sphere", sphere[0])], pixels=SMALL)
    red = {name: int(is_red(panel(picture, name)).sum()) for name in gallery.COLUMNS[:4]}
    assert red["SEAMS"] > 100
    assert {red[name] for name in red if name != "SEAMS"} == {0}


def test_the_back_panel_shows_what_the_front_hides(sphere: Pair) -> None:
    """Chart 0, in a warm colour, in front of z = 0, and chart 1, in a cold one, behind it."""
    atlas, _ = sphere
    behind = atlas.positions[atlas.faces].mean(axis=1)[:, 2] < 0.0
    picture = gallery.sheet_pixels([("sphere", replace(atlas, face_chart=behind.astype(np.int64)))], pixels=SMALL)
    warm = {name: float((panel(picture, name) @ np.array([1.0, 0.0, -1.0])).mean()) for name in gallery.COLUMNS[:2]}
    assert warm["CHECKER"] > 0.02
    assert warm["CHECKER, BACK"] < -0.02


def test_every_column_and_title_is_written(quad: Pair) -> None:
    picture = gallery.sheet_pixels([("a title", quad[0])], pixels=SMALL)
    dark = np.all(picture < 0.3, axis=-1)
    for number in range(len(gallery.COLUMNS)):
        assert dark[: gallery.BAND, number * SMALL : (number + 1) * SMALL].sum() > 100
        assert not dark[: gallery.BAND, [number * SMALL, (number + 1) * SMALL - 1]].any()
    assert dark[gallery.BAND : 2 * gallery.BAND].sum() > 100
    np.testing.assert_allclose(picture[0, 0], PAPER, atol=1e-6)


def test_a_title_too_long_ends_in_dots(quad: Pair) -> None:
    width = len(gallery.COLUMNS) * SMALL
    short = gallery.shortened("x" * 500, width)
    assert short.endswith("x...")
    gallery.sheet_pixels([(short, quad[0])], pixels=SMALL)
    assert gallery.shortened("short", width) == "short"


def test_a_sheet_without_rows_or_with_tiny_panels_is_refused(quad: Pair) -> None:
    with pytest.raises(InputError, match="0 rows, expected one or more"):
        gallery.sheet_pixels([])
    with pytest.raises(InputError, match="100 pixels, expected 240"):
        gallery.sheet_pixels([("quad", quad[0])], pixels=100)

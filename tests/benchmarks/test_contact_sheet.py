"""A contact sheet has a row for each unwrap and shows what its columns are called after."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("moderngl")

from benchmarks import contact_sheet
from flexpara.bake.colors.color import chart_colors, srgb_exact
from flexpara.bake.files.images import read_image
from flexpara.bake.pictures.preview import PAPER
from flexpara.runtime.errors import InputError
from flexpara.runtime.mesh import Asset, Atlas, Surface

Pair = tuple[Atlas, Asset]
SMALL = contact_sheet.SMALLEST_PANEL


def pair_of(positions: np.ndarray, faces: np.ndarray, uv: np.ndarray, normals: np.ndarray) -> Pair:
    """Atlas and asset of the same vertices, in one chart."""
    count = np.arange(len(positions))
    surface, chart = Surface(positions, faces), np.zeros(len(faces), np.int64)
    asset = Asset(positions, faces, count, surface, normals=normals)
    return Atlas(positions, faces, uv.astype(np.float32), normals.astype(np.float32), chart, count, 64, 4), asset


@pytest.fixture
def quad() -> Pair:
    """The unit square in the plane z = 0, facing +z, position = uv."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    return pair_of(corners, np.array([[0, 1, 2], [0, 2, 3]]), corners[:, :2], np.tile([0.0, 0.0, 1.0], (4, 1)))


@pytest.fixture
def two_charts() -> Pair:
    """Two squares of a quarter of the side, left and right; charts 0 and 1."""
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]) / 4.0
    uv = np.concatenate([square + np.array([0.125, 0.375]), square + np.array([0.625, 0.375])])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    up = np.tile([0.0, 0.0, 1.0], (8, 1))
    atlas, asset = pair_of(np.column_stack([uv, np.repeat([0.0, 1.0], 4)]), faces, uv, up)
    return replace(atlas, face_chart=np.array([0, 0, 1, 1])), asset


@pytest.fixture
def sphere() -> Pair:
    """The unit sphere by longitude and latitude, without its poles, cut along a meridian."""
    rows, columns = 16, 24
    u, v = (line.reshape(-1) for line in np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0.05, 0.95, rows + 1)))
    turn, lift = 2 * np.pi * u, np.pi * (v - 0.5)
    xyz = np.stack([np.cos(lift) * np.sin(turn), np.sin(lift), np.cos(lift) * np.cos(turn)], axis=-1)
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).reshape(-1)
    above = first + columns + 1
    faces = np.concatenate([np.stack([first, first + 1, above + 1], 1), np.stack([first, above + 1, above], 1)])
    return pair_of(xyz, faces, np.column_stack([u, v]) * 0.9 + 0.05, xyz)


def panel(picture: np.ndarray, column: str, *, row: int = 0) -> np.ndarray:
    """One panel of a sheet of small panels."""
    left = contact_sheet.COLUMNS.index(column) * SMALL
    top = 2 * contact_sheet.BAND + row * (contact_sheet.BAND + SMALL)
    return picture[top : top + SMALL, left : left + SMALL]


def is_red(part: np.ndarray) -> np.ndarray:
    """(h, w) bool: as red as seams are."""
    return (part[..., 0] > 0.5) & (part[..., 1:].max(axis=-1) < 0.05)


def test_a_normals_colour_is_its_half_plus_a_half_in_srgb(quad: Pair) -> None:
    colors = contact_sheet.normal_colors(quad[0])
    np.testing.assert_allclose(srgb_exact(colors), np.broadcast_to([0.5, 0.5, 1.0], (2, 3)), atol=1e-6)
    turned = replace(quad[0], normals=np.tile(np.array([-1.0, 0.0, 0.0], np.float32), (4, 1)))
    np.testing.assert_allclose(srgb_exact(contact_sheet.normal_colors(turned))[0], [0.0, 0.5, 0.5], atol=1e-6)


def test_a_row_for_each_entry(quad: Pair, sphere: Pair, tmp_path: Path) -> None:
    path = tmp_path / "sheet.png"
    contact_sheet.render_sheet([("quad", quad[1], quad[0]), ("sphere", sphere[1], sphere[0])], path, pixels=SMALL)
    assert read_image(path).shape == (contact_sheet.BAND + 2 * (contact_sheet.BAND + SMALL), 6 * SMALL, 3)


def test_the_layouts_are_coloured_by_normal_and_by_chart(two_charts: Pair) -> None:
    picture = contact_sheet.sheet_pixels([("two", two_charts[1], two_charts[0])], pixels=SMALL)
    for chart, u in ((0, 0.25), (1, 0.75)):
        column = round((0.5 + (u - 0.5) * 0.88) * SMALL)
        by_chart = panel(picture, "UV by chart")[SMALL // 2, column]
        np.testing.assert_allclose(by_chart, chart_colors(2)[chart], atol=2e-3)
        by_normal = panel(picture, "UV by normal")[SMALL // 2, column]
        np.testing.assert_allclose(srgb_exact(by_normal), [0.5, 0.5, 1.0], atol=4e-3)


def test_only_the_seams_panel_is_red(sphere: Pair) -> None:
    picture = contact_sheet.sheet_pixels([("sphere", sphere[1], sphere[0])], pixels=SMALL)
    red = {name: int(is_red(panel(picture, name)).sum()) for name in contact_sheet.COLUMNS[:4]}
    assert red["Seams"] > 100
    assert {red[name] for name in red if name != "Seams"} == {0}


def test_the_back_panel_shows_what_the_front_hides(sphere: Pair) -> None:
    """Chart 0, in a warm colour, in front of z = 0, and chart 1, in a cold one, behind it."""
    atlas, asset = sphere
    behind = atlas.positions[atlas.faces].mean(axis=1)[:, 2] < 0.0
    picture = contact_sheet.sheet_pixels(
        [("sphere", asset, replace(atlas, face_chart=behind.astype(np.int64)))], pixels=SMALL
    )
    warm = {
        name: float((panel(picture, name) @ np.array([1.0, 0.0, -1.0])).mean()) for name in contact_sheet.COLUMNS[:2]
    }
    assert warm["Checker"] > 0.02
    assert warm["Checker, back"] < -0.02


def test_every_column_and_title_is_written(quad: Pair) -> None:
    picture = contact_sheet.sheet_pixels([("a title", quad[1], quad[0])], pixels=SMALL)
    dark = np.all(picture < 0.3, axis=-1)
    for number in range(len(contact_sheet.COLUMNS)):
        assert dark[: contact_sheet.BAND, number * SMALL : (number + 1) * SMALL].sum() > 100
        assert not dark[: contact_sheet.BAND, [number * SMALL, (number + 1) * SMALL - 1]].any()
    assert dark[contact_sheet.BAND : 2 * contact_sheet.BAND].sum() > 100
    np.testing.assert_allclose(picture[0, 0], PAPER, atol=1e-6)


def test_a_title_too_long_ends_in_dots(quad: Pair) -> None:
    width = len(contact_sheet.COLUMNS) * SMALL
    short = contact_sheet.shortened("x" * 500, width)
    assert short.endswith("x...")
    contact_sheet.sheet_pixels([(short, quad[1], quad[0])], pixels=SMALL)
    assert contact_sheet.shortened("short", width) == "short"


def test_a_sheet_without_rows_or_with_tiny_panels_is_refused(quad: Pair) -> None:
    with pytest.raises(InputError, match="0 rows, expected one or more"):
        contact_sheet.sheet_pixels([])
    with pytest.raises(InputError, match="100 pixels, expected 240"):
        contact_sheet.sheet_pixels([("quad", quad[1], quad[0])], pixels=100)

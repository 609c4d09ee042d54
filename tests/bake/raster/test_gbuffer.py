"""The surface under each texel is the right point of the right face, and no touched texel is left out."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace

import moderngl
import numpy as np
import pytest

from flexpara.bake.raster.gbuffer import CHUNK, REACH, DeviceRasterizer, rasterize
from flexpara.bake.raster.layout import Layout, Planes, border_edges, windows
from flexpara.runtime.errors import InputError
from flexpara.runtime.mesh import Asset, Atlas

Pair = tuple[Atlas, Asset]


def centres(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Texel centres in uv: u (size,) by column, v (size,) by row."""
    place = (np.arange(size) + 0.5) / size
    return place, 1.0 - place


def touches(corners: np.ndarray, row: int, column: int) -> bool:
    """Whether a triangle (3, 2), in texels with y down, meets the closed texel: separating axes."""
    box = np.array([[column, row], [column + 1, row], [column + 1, row + 1], [column, row + 1]], np.float64)
    edges = np.roll(corners, -1, axis=0) - corners
    axes = np.concatenate([np.eye(2), np.stack([-edges[:, 1], edges[:, 0]], axis=1)])
    first, second = corners @ axes.T, box @ axes.T
    return bool(((first.max(axis=0) >= second.min(axis=0)) & (second.max(axis=0) >= first.min(axis=0))).all())


def distance(corners: np.ndarray, point: np.ndarray) -> float:
    """From a point to the border of a triangle (3, 2)."""
    along = np.roll(corners, -1, axis=0) - corners
    t = np.clip(((point - corners) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-30), 0, 1)
    return float(np.linalg.norm(corners + t[:, None] * along - point, axis=1).min())


@pytest.mark.parametrize("size", [1, 7, 64, 1000])
def test_a_quad_whose_position_is_its_uv_holds_the_texel_centres(
    quad: Pair, context: moderngl.Context, size: int
) -> None:
    buffer = rasterize(context, quad[0], size)
    u, v = centres(size)
    assert (buffer.face >= 0).all()
    assert np.abs(buffer.position[..., 0] - u).max() < 1e-5
    assert np.abs(buffer.position[..., 1] - v[:, None]).max() < 1e-5
    np.testing.assert_array_equal(buffer.normal, np.broadcast_to([0, 0, 1], (size, size, 3)))


@pytest.mark.parametrize("limit", [7, 16, 33, 100])
def test_tiles_change_no_bit(sphere: Pair, quad: Pair, context: moderngl.Context, limit: int) -> None:
    for atlas, _ in (sphere, quad):
        whole, tiled = rasterize(context, atlas, 100), rasterize(context, atlas, 100, limit=limit)
        for name in ("position", "normal", "second", "third", "face"):
            assert getattr(whole, name).tobytes() == getattr(tiled, name).tobytes()


def test_a_window_drawn_again_into_kept_planes_is_the_same(sphere: Pair, context: moderngl.Context) -> None:
    whole = rasterize(context, sphere[0], 50)
    with ExitStack() as stack:
        drawn = DeviceRasterizer(context, stack, sphere[0], Layout.of(sphere[0], 50), (20, 20))
        planes = Planes.of(20, 20)
        for window in windows(50, 20, 400):
            part = planes.part(slice(window.height), slice(window.width))
            buffer = drawn.draw(window, part)
            assert np.shares_memory(buffer.face, planes.face)
            np.testing.assert_array_equal(buffer.position, whole.position[window.rows, window.columns])
            np.testing.assert_array_equal(buffer.face, whole.face[window.rows, window.columns])
            assert (buffer.image_texels(np.array([0])) == window.row * 50 + window.column).all()
            again = drawn.draw(window, clear=False)
            covered = again.face >= 0
            np.testing.assert_array_equal(again.face, buffer.face)
            np.testing.assert_array_equal(again.position[covered], buffer.position[covered])
        with pytest.raises(InputError, match="window of 21"):
            drawn.draw(windows(50, 21, 1000)[0])


def test_inside_are_the_texels_whose_centres_a_chart_holds(two_charts: Pair, context: moderngl.Context) -> None:
    buffer = rasterize(context, two_charts[0], 64)  # squares of 16 texels whose borders lie between texels
    assert buffer.inside.sum() == 2 * 16 * 16
    assert (buffer.face >= 0).sum() == 2 * 18 * 18
    centred = replace(two_charts[0], uv=two_charts[0].uv + np.float32(0.5 / 64))
    assert rasterize(context, centred, 64).inside.sum() == 2 * 17 * 17


def test_row_0_is_the_top(quad: Pair, context: moderngl.Context) -> None:
    buffer = rasterize(context, quad[0], 8)
    assert buffer.position[0, 0, 1] > 0.9
    assert buffer.position[7, 0, 1] < 0.1


def test_one_triangle_by_hand(pair: Callable[..., Pair], context: moderngl.Context) -> None:
    atlas, _ = pair([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]], [[0, 0], [1, 0], [0, 1]])
    buffer = rasterize(context, atlas, 4)
    expected = [[0, -1, -1, -1], [0, 0, -1, -1], [0, 0, 0, -1], [0, 0, 0, 0]]
    inside = np.array(expected) == 0
    assert (buffer.face[inside] == 0).all()
    np.testing.assert_allclose(buffer.position[3, 0], [0.5, 0.5, 0.0], atol=1e-6)
    np.testing.assert_allclose(buffer.barycentric[3, 0], [0.75, 0.125, 0.125], atol=1e-6)
    np.testing.assert_allclose(buffer.position[0, 1], [0.5, 3.5, 0.0], atol=0.51)
    np.testing.assert_allclose(buffer.position[0, 1].sum(), 4.0, atol=1e-5)  # clamped onto the slanted edge


def test_every_touched_texel_is_written_and_none_far_away(pair: Callable[..., Pair], context: moderngl.Context) -> None:
    rng = np.random.default_rng(5)
    size = 24
    for _ in range(30):
        uv = rng.uniform(0.0, 1.0, 2) + rng.normal(0.0, rng.choice([0.01, 0.1, 0.4]), (3, 2))
        uv = np.clip(uv, 0.0, 1.0).astype(np.float32)
        atlas, _ = pair([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], uv)
        covered = rasterize(context, atlas, size).face >= 0
        texels = np.column_stack([uv[:, 0], 1.0 - uv[:, 1]]).astype(np.float64) * size
        for row, column in np.ndindex(size, size):
            if touches(texels, row, column):
                assert covered[row, column]
            elif covered[row, column]:
                assert distance(texels, np.array([column + 0.5, row + 0.5])) <= REACH + 1e-3


def test_a_sliver_thinner_than_a_texel_is_drawn_as_a_line(pair: Callable[..., Pair], context: moderngl.Context) -> None:
    atlas, _ = pair([[0, 0, 0], [1, 0, 0], [1, 1e-4, 0]], [[0, 1, 2]], [[0, 0.51], [1, 0.51], [1, 0.5101]])
    buffer = rasterize(context, atlas, 32)
    assert (buffer.face[15] == 0).all()
    assert np.abs(buffer.position[15, :, 0] - centres(32)[0]).max() < 1e-4


def test_a_face_without_uv_area_still_leaves_its_line(pair: Callable[..., Pair], context: moderngl.Context) -> None:
    atlas, _ = pair([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], [[0.1, 0.6], [0.9, 0.6], [0.5, 0.6]])
    covered = rasterize(context, atlas, 16).face >= 0
    assert covered[6, 2:14].all()
    assert np.isfinite(rasterize(context, atlas, 16).position).all()


def test_a_texel_inside_a_face_is_not_taken_by_a_border(two_charts: Pair, context: moderngl.Context) -> None:
    atlas, _ = two_charts
    close = atlas.uv.copy()
    close[4:, 0] -= 0.25  # the squares now share an edge of the image, but no vertex
    size = 40
    buffer = rasterize(context, replace(atlas, uv=close), size)
    column = np.flatnonzero((buffer.face[size // 2] >= 0) & (buffer.position[size // 2, :, 2] > 0.5))
    assert column.min() == round(0.375 * size)


def test_the_nearer_of_two_borders_wins(two_charts: Pair, context: moderngl.Context) -> None:
    atlas, _ = two_charts
    gap = atlas.uv.copy()
    gap[:4, 0] += 0.225  # ends at 0.6; the other starts at 0.625: at 16 texels both reach into column 9
    buffer = rasterize(context, replace(atlas, uv=gap), 16)
    assert (buffer.face[7:9, 9] < 2).all()
    assert (buffer.face[7:9, 10] >= 2).all()


def test_interpolated_vertex_positions_are_the_positions(fine_sphere: Pair, context: moderngl.Context) -> None:
    atlas, _ = fine_sphere
    buffer = rasterize(context, atlas, 200)
    again = buffer.interpolate(atlas.positions, atlas.faces, buffer.texels)
    assert np.abs(again - buffer.position.reshape(-1, 3)[buffer.texels]).max() < 1e-5
    assert np.abs(np.linalg.norm(buffer.normal.reshape(-1, 3)[buffer.texels], axis=1) - 1).max() < 1e-5
    assert np.abs(buffer.barycentric.sum(axis=-1) - 1).max() < 1e-5
    assert buffer.barycentric.min() > -1e-6


def test_the_chunks_are_the_covered_texels(sphere: Pair, context: moderngl.Context) -> None:
    buffer = rasterize(context, sphere[0], 600)
    assert len(buffer.chunks()) > 1
    assert max(len(chunk) for chunk in buffer.chunks()) <= CHUNK
    np.testing.assert_array_equal(np.concatenate(buffer.chunks()), np.flatnonzero(buffer.face >= 0))


def test_the_same_atlas_gives_the_same_bytes(sphere: Pair, context: moderngl.Context) -> None:
    first, second = rasterize(context, sphere[0], 100), rasterize(context, sphere[0], 100)
    for name in ("position", "normal", "second", "third", "face"):
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes()


def test_nothing_is_where_no_surface_lies(two_charts: Pair, context: moderngl.Context) -> None:
    buffer = rasterize(context, two_charts[0], 64)
    free = buffer.face < 0
    assert 0.8 < free.mean() < 0.9
    assert not buffer.position[free].any()
    assert not buffer.normal[free].any()


def test_border_edges_of_a_quad_are_its_outline(quad: Pair) -> None:
    atlas, _ = quad
    np.testing.assert_array_equal(border_edges(atlas.faces, atlas.uv), [[0, 0], [0, 1], [1, 1], [1, 2]])


def test_a_fold_in_uv_is_a_border(quad: Pair) -> None:
    atlas, _ = quad
    folded = atlas.uv.copy()
    folded[3] = folded[1]
    assert len(border_edges(atlas.faces, folded)) == 6


def test_a_sphere_cut_along_a_meridian_has_its_cut_as_border(sphere: Pair) -> None:
    atlas, _ = sphere
    assert len(border_edges(atlas.faces, atlas.uv)) == 2 * 16 + 2 * 24


@pytest.mark.parametrize(("value", "text"), [(1.5, "span 0 to 1.5"), (-0.2, "span -0.2"), (np.nan, "NaN")])
def test_uv_outside_the_square_are_refused(quad: Pair, context: moderngl.Context, value: float, text: str) -> None:
    atlas, _ = quad
    uv = atlas.uv.copy()
    uv[2, 0] = value
    with pytest.raises(InputError, match=text):
        rasterize(context, replace(atlas, uv=uv), 8)


def test_no_faces_are_refused(quad: Pair, context: moderngl.Context) -> None:
    with pytest.raises(InputError, match="0 faces"):
        rasterize(context, replace(quad[0], faces=np.zeros((0, 3), np.int64)), 8)

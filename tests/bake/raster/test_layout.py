"""Windows cover an image once, corners lie where uv says, borders are found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flexpara.bake.raster.layout import Layout, Planes, Window, check_size, windows
from flexpara.runtime.errors import InputError
from flexpara.runtime.mesh import Asset, Atlas
from flexpara.runtime.pagesize import LARGEST

Pair = tuple[Atlas, Asset]


@pytest.mark.parametrize(
    ("size", "side", "texels"), [(1, 1, 1), (10, 3, 100), (10, 10, 25), (64, 100, 1000), (7, 7, 1)]
)
def test_windows_cover_the_image_once_within_their_limits(size: int, side: int, texels: int) -> None:
    count = np.zeros((size, size), np.int64)
    for window in windows(size, side, texels):
        count[window.rows, window.columns] += 1
        assert max(window.height, window.width) <= side
        assert window.height * window.width <= max(texels, min(size, side))
    np.testing.assert_array_equal(count, 1)


def test_a_window_of_a_finer_image_is_scaled() -> None:
    assert Window(1, 2, 3, 4).scaled(4) == Window(4, 8, 12, 16)


def test_corners_lie_in_texels_with_v_turned_down(quad: Pair) -> None:
    layout = Layout.of(quad[0], 8)
    np.testing.assert_array_equal(layout.texel[0], [[0, 8], [8, 8], [8, 0]])
    np.testing.assert_array_equal(layout.face_bounds[:, 0], [0, 0, 8, 8])
    np.testing.assert_allclose(layout.radius, 64 / (16 + 8 * 2**0.5), rtol=1e-6)


def test_a_tile_is_the_square_moved_to_the_origin(quad: Pair) -> None:
    moved = replace(quad[0], uv=quad[0].uv + np.array([3, 2], np.float32))
    np.testing.assert_array_equal(Layout.of(moved, 8, (3, 2)).texel, Layout.of(quad[0], 8).texel)
    with pytest.raises(InputError, match="uv span 0 to 4"):
        Layout.of(moved, 8)


def test_only_faces_and_edges_near_a_window_are_drawn_in_it(two_charts: Pair) -> None:
    layout = Layout.of(two_charts[0], 64)
    np.testing.assert_array_equal(layout.faces_in(Window(0, 0, 64, 32)), [0, 1])
    np.testing.assert_array_equal(layout.edges_in(Window(0, 32, 64, 32), 1.0)[:, 0], [2, 2, 3, 3])
    assert len(layout.faces_in(Window(0, 0, 20, 64))) == 0


def test_planes_are_used_again_for_smaller_windows() -> None:
    planes = Planes.of(4, 5)
    small = planes.shaped(2, 3)
    assert [plane.shape for plane in small] == [(2, 3, 4), (2, 3, 4), (2, 3)]
    assert all(plane.flags.c_contiguous for plane in small)
    small.face[...] = 7
    assert (planes.face == 7).sum() == 6


def test_sizes_end_where_the_integers_do() -> None:
    check_size(1)
    check_size(LARGEST)
    for size in (0, LARGEST + 1):
        with pytest.raises(InputError, match=f"size {size}"):
            check_size(size)

"""Faces beyond the unit square are baked where the texture repeats, or said to be left out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from flexpara.bake.square import into_square
from flexpara.runtime.geometry.layout import layout_faults
from flexpara.runtime.mesh import Asset, Atlas

Pair = tuple[Atlas, Asset]


def test_an_atlas_in_the_square_stays_as_it_is(quad: Pair) -> None:
    atlas, left_out = into_square(quad[0])
    assert left_out == 0
    np.testing.assert_array_equal(atlas.uv, quad[0].uv)
    assert layout_faults(atlas.corner_uv) == []


def test_a_face_in_another_square_moves_by_whole_steps(quad: Pair) -> None:
    moved = replace(quad[0], uv=quad[0].uv + np.array([3, -2], np.float32))
    atlas, left_out = into_square(moved)
    assert left_out == 0
    np.testing.assert_allclose(atlas.corner_uv, quad[0].corner_uv, atol=1e-6)
    assert layout_faults(moved.corner_uv) == ["100 % of the faces have uv beyond the unit square"]
    assert layout_faults(moved.corner_uv, tiles=True) == []


def test_a_face_over_several_repeats_is_left_out(pair: Callable[..., Pair]) -> None:
    atlas, _ = pair(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 3, 2]], [[0, 0], [1, 0], [0, 1], [2, 2]]
    )
    found, left_out = into_square(atlas)
    assert left_out == 1
    np.testing.assert_array_equal(found.corner_uv, [[[0, 0], [1, 0], [0, 1]], [[0, 0]] * 3])


def test_overlaps_are_a_share_of_the_faces() -> None:
    uv = np.array([[[0, 0], [1, 0], [0, 1]], [[0, 0], [0.5, 0], [0, 0.5]], [[1, 1], [0.6, 1], [1, 0.6]]])
    assert layout_faults(uv) == ["66.7 % of the faces overlap others in uv"]

"""Point clouds in memory: what is refused, what is one point, which uv a point gets."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.errors import InputError, ShapeError
from flexpara.runtime.io.points.cloud import CloudMesh, cloud_from_arrays, distinct_points, point_uv, with_changes
from flexpara.runtime.mesh import Asset, Atlas, Surface

POINTS = np.random.default_rng(1).normal(size=(8, 3))


def test_a_cloud_keeps_points_and_their_order() -> None:
    cloud = cloud_from_arrays(POINTS.astype(np.float32), stem="scan")
    assert cloud.points.dtype == np.float64
    np.testing.assert_array_equal(cloud.points, POINTS.astype(np.float32))
    assert (cloud.normals, cloud.colors, cloud.changes, cloud.stem) == (None, None, {}, "scan")


def test_normals_become_unit_and_unknown_ones_are_counted() -> None:
    normals = 3.0 * POINTS
    normals[2], normals[5] = 0.0, np.nan
    cloud = cloud_from_arrays(POINTS, normals=normals)
    assert cloud.normals is not None
    assert cloud.changes == {"points_without_normal": 2}
    np.testing.assert_allclose(np.linalg.norm(cloud.normals, axis=1), [1, 1, 0, 1, 1, 0, 1, 1])
    np.testing.assert_allclose(cloud.normals[0], POINTS[0] / np.linalg.norm(POINTS[0]))


def test_normals_that_are_all_zero_are_none() -> None:
    assert cloud_from_arrays(POINTS, normals=np.zeros((8, 3))).normals is None


def test_colours_become_rgba() -> None:
    colors = cloud_from_arrays(POINTS, colors=np.full((8, 3), 0.5)).colors
    np.testing.assert_array_equal(colors, np.tile([128, 128, 128, 255], (8, 1)))


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (POINTS[:3], r"3 points, expected 4 or more"),
        (np.where(np.arange(24).reshape(8, 3) == 7, np.nan, POINTS), r"1 of 8 points .*first: point 2"),
        (np.zeros((8, 3)), r"diagonal 0, expected"),
        (POINTS * 1e200, r"check the points and their unit"),
        (POINTS.T, r"shape \(3, 8\).*expected \(n, 3\)"),
        (POINTS.astype(str), r"expected \(n, 3\) numbers"),
    ],
)
def test_what_is_no_cloud_says_so_in_one_line(points: np.ndarray, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        cloud_from_arrays(points)
    assert "\n" not in str(caught.value)


def test_attributes_of_another_length_are_refused() -> None:
    with pytest.raises(ShapeError, match=r"normals has shape \(7, 3\).*expected \(8, 3\)"):
        cloud_from_arrays(POINTS, normals=POINTS[:7])
    with pytest.raises(ShapeError, match="colors"):
        cloud_from_arrays(POINTS, colors=POINTS[:7])


def test_repeated_points_are_one_and_keep_the_first_known_normal() -> None:
    normals = np.tile([0.0, 0.0, 1.0], (8, 1))
    normals[0], normals[3] = 0.0, [1.0, 0.0, 0.0]
    points = POINTS.copy()
    points[3] = points[6] = points[0]
    distinct = distinct_points(cloud_from_arrays(points, normals=normals))
    np.testing.assert_array_equal(distinct.first, [0, 1, 2, 4, 5, 7])
    np.testing.assert_array_equal(distinct.points[distinct.weld], points)
    assert distinct.normals is not None
    np.testing.assert_array_equal(distinct.normals[0], [1.0, 0.0, 0.0])


def test_counts_of_zero_are_left_out_of_the_changes() -> None:
    cloud = with_changes(cloud_from_arrays(POINTS), components=0, repeated_points=2)
    assert with_changes(cloud, more=1).changes == {"repeated_points": 2, "more": 1}


def square_atlas() -> tuple[Asset, Atlas]:
    """A unit square of two triangles, each a chart of its own, beside each other."""
    corner = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    asset = Asset(corner, faces, np.arange(4), Surface(corner, faces))
    uv = np.array([[0.0, 0.0], [0.4, 0.0], [0.4, 0.4], [0.5, 0.0], [0.9, 0.4], [0.5, 0.4]], dtype=np.float32)
    normals = np.tile(np.array([0, 0, 1], dtype=np.float32), (6, 1))
    source = np.array([0, 1, 2, 0, 2, 3])
    return asset, Atlas(corner[source], np.arange(6).reshape(2, 3), uv, normals, np.arange(2), source, 64, 1)


def test_a_point_gets_the_uv_and_the_chart_of_its_face() -> None:
    asset, atlas = square_atlas()
    weight = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.25, 0.25, 0.5], [1.5, -0.5, 0.0]])
    uv, chart = point_uv(CloudMesh(asset, np.array([1, 0, 0, 0]), weight), atlas)
    assert uv.dtype == np.float32
    np.testing.assert_array_equal(chart, [1, 0, 0, 0])
    np.testing.assert_allclose(uv, [[0.5, 0.0], [0.4, 0.4], [0.3, 0.2], [0.0, 0.0]], atol=1e-6)  # the last one is held

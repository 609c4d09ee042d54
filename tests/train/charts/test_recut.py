"""Charts cut again where the numbers written made them invalid: by hand, two and three triangles."""

from __future__ import annotations

import numpy as np
import pytest

import flexpara
from flexpara.runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from flexpara.runtime.mesh import Charts, Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.charts.recut import drawn_again, enlarged, laid_flat, recut, smaller_of_each

QUAD = Surface(np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
STRIP = Surface(
    np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]]), np.array([[0, 2, 3], [0, 1, 2], [1, 4, 2]])
)


def one_chart(surface: Surface) -> Charts:
    count = len(surface.faces)
    none = np.zeros(count, dtype=np.int64)
    return Charts(none, surface.triangles[..., :2].copy(), none, np.zeros(1, dtype=np.int64), ("slim",))


def test_a_triangle_that_was_written_upside_down_becomes_a_chart_of_its_own() -> None:
    charts = one_chart(QUAD)
    written = charts.corner_uv.copy()
    written[1] = written[1, ::-1]
    found = recut(QUAD, charts, np.array([0]), written)
    assert found.face_chart.tolist() == [0, 1]
    assert found.method == ("slim", "triangle")
    assert np.array_equal(found.corner_uv[0], charts.corner_uv[0])
    assert not flipped_triangles(found.corner_uv).any()


def test_of_two_triangles_written_over_each_other_the_smaller_goes() -> None:
    charts = one_chart(QUAD)
    written = charts.corner_uv.copy()
    written[1] = written[0] * 0.5
    assert len(overlapping_pairs(written)) == 1
    assert smaller_of_each(written, np.array([[0, 1]])).tolist() == [1]
    assert recut(QUAD, charts, np.array([0]), written).method == ("slim", "triangle")


def test_what_a_lost_triangle_held_together_becomes_two_charts() -> None:
    charts = one_chart(STRIP)
    written = charts.corner_uv.copy()
    written[1] = written[1, ::-1]
    found = recut(STRIP, charts, np.array([0]), written)
    assert found.face_chart.tolist() == [0, 1, 2]
    assert found.method == ("slim", "triangle", "slim")


def test_charts_that_are_valid_stay_as_they_are() -> None:
    charts = one_chart(STRIP)
    found = recut(STRIP, charts, np.zeros(0, dtype=np.int64), charts.corner_uv)
    assert found.face_chart.tolist() == [0, 0, 0]
    assert np.array_equal(found.corner_uv, charts.corner_uv)


def test_a_chart_of_too_small_triangles_is_drawn_larger_up_to_the_length_that_can_be_told() -> None:
    charts = one_chart(QUAD)  # its edges: 1, 2 and √5, the median 2
    found, which = enlarged(charts, np.array([0]), 1e-8 * charts.corner_uv, least=1e-5)
    assert which.tolist() == [0]
    assert found.corner_uv == pytest.approx(500.0 * charts.corner_uv)
    assert found.method == charts.method


def test_larger_is_tried_before_cutting_and_large_charts_are_cut() -> None:
    charts = one_chart(QUAD)
    flipped = charts.corner_uv.copy()
    flipped[1] = flipped[1, ::-1]
    small, said = drawn_again(QUAD, charts, np.array([0]), 1e-8 * flipped, 1e-5)
    assert (small.method, said.split(":")[0]) == (("slim",), "1 charts are drawn larger")
    cut, said = drawn_again(QUAD, charts, np.array([0]), flipped, 1e-5)
    assert (cut.method, said.split(":")[0]) == (
        ("slim", "triangle"),
        "1 charts lost triangles too thin for the numbers of a file",
    )


def test_a_part_ten_million_times_smaller_beside_a_large_one_comes_out_valid() -> None:
    vertices, faces = make_sample("sphere", resolution=16)
    both = np.concatenate([vertices, 1e-7 * vertices + 3.0])
    result = flexpara.unwrap((both, np.concatenate([faces, faces + len(vertices)])), size=256)
    assert result.report["metrics"]["flipped_faces"] == 0
    assert result.report["metrics"]["overlap_fraction"] == 0.0
    assert any("drawn larger" in note for note in result.report["train"]["notes"])


def test_a_triangle_is_laid_flat_with_the_sides_it_has() -> None:
    triangle = np.array([[[1.0, 2, 3], [1, 2, 5], [1, 5, 4]]])
    flat = laid_flat(triangle)
    sides = [np.linalg.norm(np.roll(t, -1, axis=1) - t, axis=2) for t in (triangle, flat)]
    assert np.allclose(*sides, rtol=0.0, atol=1e-12)
    assert not flipped_triangles(flat).any()

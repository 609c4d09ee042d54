"""Agreement of a map with its atlas: a square that is its own uv, and maps that are off by a known amount."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from flexpara.runtime.mesh import Atlas
from flexpara.runtime.sessions.agreement import agreement, surface_points
from flexpara.runtime.sessions.session import Unwrapped

if TYPE_CHECKING:
    from numpy.typing import NDArray

CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
SQUARE = Atlas(
    positions=CORNERS,
    faces=np.array([[0, 1, 2], [0, 2, 3]]),
    uv=CORNERS[:, :2].astype(np.float32),
    normals=np.tile(np.array([0, 0, 1], np.float32), (4, 1)),
    face_chart=np.array([0, 1]),
    source_vertex=np.arange(4),
    size=2048,
    padding=0,
)


@dataclass
class ShiftedMap:
    """Answers with the point's own xy, shifted along u, and the chart by the diagonal."""

    shift: float = 0.0
    wrong_above: float = 2.0

    def unwrap(self, points: NDArray[np.float64]) -> Unwrapped:
        chart = (points[:, 1] > points[:, 0]).astype(np.int64)
        chart = np.where(points[:, 0] > self.wrong_above, 1 - chart, chart)
        uv = points[:, :2] + [self.shift, 0.0]
        return Unwrapped(uv.astype(np.float32), chart, np.ones(len(points), np.float32))


def test_points_lie_on_their_face_and_carry_its_uv_and_chart() -> None:
    xyz, uv, chart = surface_points(SQUARE, 1000, np.random.default_rng(0))
    np.testing.assert_allclose(xyz[:, :2], uv, atol=1e-12)
    np.testing.assert_array_equal(chart, xyz[:, 1] > xyz[:, 0])


def test_points_are_uniform_by_area() -> None:
    xyz, _, _ = surface_points(SQUARE, 40_000, np.random.default_rng(0))
    quadrants = np.histogram2d(xyz[:, 0], xyz[:, 1], bins=4, range=[[0, 1], [0, 1]])[0] / 40_000
    np.testing.assert_allclose(quadrants, 1.0 / 16.0, atol=0.006)


def test_the_map_itself_agrees() -> None:
    found = agreement(ShiftedMap(), SQUARE)
    assert found.rms_texels == pytest.approx(0.0, abs=1e-3)
    assert found.chart_agreement == 1.0


def test_a_shift_is_measured_in_texels_at_1024_whatever_the_atlas_size() -> None:
    found = agreement(ShiftedMap(shift=3.0 / 1024.0), SQUARE)
    assert found.rms_texels == pytest.approx(3.0, abs=1e-3)
    assert found.p99_texels == pytest.approx(3.0, abs=1e-3)


def test_a_wrong_chart_lowers_the_agreement_alone() -> None:
    found = agreement(ShiftedMap(wrong_above=0.75), SQUARE)
    assert found.chart_agreement == pytest.approx(0.75, abs=0.01)
    assert found.rms_texels == pytest.approx(0.0, abs=1e-3)


def test_with_no_right_chart_there_is_no_distance() -> None:
    class Elsewhere(ShiftedMap):
        def unwrap(self, points: NDArray[np.float64]) -> Unwrapped:
            return super().unwrap(points)._replace(chart=np.full(len(points), 2))

    found = agreement(Elsewhere(), SQUARE)
    assert found.chart_agreement == 0.0
    assert found.rms_texels is None


@dataclass
class SlitMap:
    """The square folded open along its diagonal inside one chart; points near the diagonal get the other side's uv."""

    near: float

    def unwrap(self, points: NDArray[np.float64]) -> Unwrapped:
        above = points[:, 1] > points[:, 0]
        side = np.where(np.abs(points[:, 1] - points[:, 0]) < self.near, ~above, above)
        uv = points[:, :2] * 0.4 + np.where(side, 0.5, 0.0)[:, None]
        return Unwrapped(uv.astype(np.float32), np.zeros(len(points), np.int64), np.ones(len(points), np.float32))


def slit_square() -> Atlas:
    """Two triangles of one chart whose uv lie apart: the diagonal is a slit."""
    corners = np.concatenate([CORNERS[[0, 1, 2]], CORNERS[[0, 2, 3]]])
    uv = corners[:, :2] * 0.4 + np.repeat([0.0, 0.5], 3)[:, None]
    return Atlas(
        positions=corners,
        faces=np.array([[0, 1, 2], [3, 4, 5]]),
        uv=uv.astype(np.float32),
        normals=np.tile(np.array([0, 0, 1], np.float32), (6, 1)),
        face_chart=np.array([0, 0]),
        source_vertex=np.array([0, 1, 2, 0, 2, 3]),
        size=2048,
        padding=0,
    )


def test_the_wrong_side_of_a_slit_lowers_the_seam_agreement_alone() -> None:
    found = agreement(SlitMap(near=0.003), slit_square())
    assert found.chart_agreement == 1.0
    assert found.seam_agreement == pytest.approx(1.0 - 0.006, abs=0.001)
    assert found.rms_texels == pytest.approx(0.0, abs=1e-3)


def test_a_wrong_answer_far_from_any_seam_stays_in_the_distance() -> None:
    found = agreement(SlitMap(near=0.1), slit_square())
    assert found.seam_agreement > 0.9
    assert found.rms_texels is not None
    assert found.rms_texels > 100.0


def test_of_two_sheets_at_one_place_either_answer_is_right() -> None:
    """A square with a back, beside it in the atlas; a map that always answers with the front."""
    both = Atlas(
        positions=np.concatenate([CORNERS, CORNERS]),
        faces=np.array([[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]]),
        uv=np.concatenate([CORNERS[:, :2] * 0.5, CORNERS[:, :2] * [-0.5, 0.5] + [1.0, 0.0]]).astype(np.float32),
        normals=np.tile(np.array([0, 0, 1], np.float32), (8, 1)),
        face_chart=np.array([0, 0, 1, 1]),
        source_vertex=np.arange(8),
        size=2048,
        padding=0,
    )

    @dataclass
    class Front:
        lift: float = 0.0
        chart: int = 0

        def unwrap(self, points: NDArray[np.float64]) -> Unwrapped:
            uv = points[:, :2] * 0.5 + [0.0, self.lift]
            chart = np.full(len(points), self.chart)
            return Unwrapped(uv.astype(np.float32), chart, np.ones(len(points), np.float32))

    found = agreement(Front(), both)
    assert (found.chart_agreement, found.seam_agreement) == (1.0, 1.0)
    assert found.rms_texels == pytest.approx(0.0, abs=1e-3)
    assert agreement(Front(lift=1.0 / 1024.0), both).rms_texels == pytest.approx(1.0, abs=1e-3)
    apart = replace(both, positions=np.concatenate([CORNERS, CORNERS + np.array([0.0, 0.0, 0.01])]))
    assert agreement(Front(), apart).chart_agreement == pytest.approx(0.5, abs=0.01)

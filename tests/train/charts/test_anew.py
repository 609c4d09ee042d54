"""Crumpled charts: a strip laid out a thousandth as wide becomes what it is charted as, alone; if that is better."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.mesh import Surface
from flexpara.train.charts.anew import uncrumpled
from flexpara.train.finish.pieces import Piece, measured
from flexpara.train.finish.slits import Flat

VERTICES = np.array([[x, y, 0.0] for y in (0.0, 1.0) for x in (0.0, 0.5, 1.0)])
SURFACE = Surface(VERTICES, np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]]))
"""A square of two strips, two triangles each."""


def laid(surface: Surface, ids: np.ndarray, width: float = 1.0) -> Piece:
    """Faces of a surface in its plane, so many times as wide as they are."""
    return measured(surface, ids, Flat.of(surface, ids, surface.triangles[ids][:, :, :2] * [width, 1.0]), 1.0)


CRUMPLED, PLAIN = laid(SURFACE, np.array([0, 1]), 1e-3), laid(SURFACE, np.array([2, 3]))


def test_a_crumpled_chart_is_charted_alone_at_area_one_and_put_back() -> None:
    seen: list[Surface] = []

    def chart(surface: Surface) -> list[Piece]:
        seen.append(surface)
        return [laid(surface, np.array([0])), laid(surface, np.array([1]))]

    found = uncrumpled(SURFACE, [CRUMPLED, PLAIN], 0.25, chart, lambda: False)
    assert [piece.ids.tolist() for piece in found] == [[0], [1], [2, 3]]
    assert [float(surface.face_areas().sum()) for surface in seen] == [pytest.approx(1.0)]
    for piece in found:
        assert piece.energy == pytest.approx(0.0, abs=1e-12)
        assert np.ptp(piece.flat.uv, axis=0) == pytest.approx([0.5, 1.0])


def test_it_stays_where_that_is_no_better_where_it_is_all_there_is_and_where_time_is_out() -> None:
    def worse(surface: Surface) -> list[Piece]:
        return [laid(surface, np.arange(2), 1e-3)]

    def none(_surface: Surface) -> list[Piece]:
        raise AssertionError

    assert uncrumpled(SURFACE, [CRUMPLED, PLAIN], 0.25, worse, lambda: False) == [CRUMPLED, PLAIN]
    assert uncrumpled(SURFACE, [CRUMPLED, PLAIN], 0.25, none, lambda: True) == [CRUMPLED, PLAIN]
    whole = laid(SURFACE, np.arange(4), 1e-3)
    assert uncrumpled(SURFACE, [whole], 0.25, none, lambda: False) == [whole]

"""Charts are proved, and what fails loses the faces in its way."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.errors import FinishError
from flexpara.runtime.mesh import Surface
from flexpara.train.charts.proof import is_valid, proven, verify
from flexpara.train.finish.pieces import Piece, measured
from flexpara.train.finish.slits import Flat

STRIP = Surface(
    np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0.5]]), np.array([[0, 1, 2], [0, 2, 3], [1, 4, 2]])
)


def piece_with(last: list[float]) -> Piece:
    uv = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], last])
    return measured(STRIP, np.arange(3), Flat(STRIP, uv, {}), 2.0)


def overlapping() -> Piece:
    """The third face, apart from the others, lies over the first."""
    points = np.concatenate([STRIP.vertices, STRIP.vertices[[1, 2]]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [5, 4, 6]])
    uv = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [1.2, 0.1], [0.5, 0.1], [0.9, 0.5]])
    return Piece(np.arange(3), Flat(Surface(points, faces), uv, {}), 0.0, 0.0)


def test_a_valid_piece_is_proved_as_it_is() -> None:
    piece = piece_with([2.0, 0.2])
    verify([piece])
    assert proven(STRIP, piece) == [piece]


def test_a_piece_that_overlaps_loses_the_faces_in_its_way_and_no_face_is_lost() -> None:
    piece = overlapping()
    with pytest.raises(FinishError, match="overlapping"):
        verify([piece])
    parts = proven(STRIP, piece)
    assert all(is_valid(part) for part in parts)
    assert sorted(np.concatenate([part.ids for part in parts]).tolist()) == [0, 1, 2]
    assert len(parts) == 2

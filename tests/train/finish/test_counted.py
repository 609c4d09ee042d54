"""Cuts inside a piece count in the objective as its borders do: by where they lie."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.cutgraph import SeamPrices
from flexpara.runtime.geometry.places import Places
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.charts.objective import objective
from flexpara.train.config import FinishConfig
from flexpara.train.finish.pieces import Piece, measured, try_piece


def test_a_piece_with_cuts_costs_more_where_places_are_dear_and_nothing_else_changes() -> None:
    surface = Surface(*make_sample("sphere", resolution=16))
    surface = Surface(surface.vertices / np.sqrt(surface.face_areas().sum()), surface.faces)
    thrice = SeamPrices(places=Places(surface.vertices[:1], np.array([3.0])))
    piece = try_piece(surface, np.arange(len(surface.faces)), 1.0, FinishConfig())
    assert isinstance(piece, Piece)
    assert piece.slit_length > 0.0
    dear = measured(surface, piece.ids, piece.flat, 1.0, piece.slits, thrice)
    assert dear.energy == pytest.approx(piece.energy)
    assert dear.slit_length == pytest.approx(3.0 * piece.slit_length)
    assert objective(surface, [dear], 0.1, thrice) == pytest.approx(piece.energy + 0.3 * piece.slit_length)

"""Scraps: a face cut off a sheet goes back where it was, one that has no room stays, and nothing else moves."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.overlap import overlapping_pairs
from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.mesh import Surface
from flexpara.train.carry.scraps import neighbours, scraps_given
from flexpara.train.config import FinishConfig
from flexpara.train.finish.flaps import restricted
from flexpara.train.finish.pieces import Piece, measured
from flexpara.train.finish.slits import Flat

CONFIG = FinishConfig()


def sheet() -> Surface:
    """A flat square of 32 faces, whose own coordinates are its uv."""
    x, y = np.meshgrid(np.arange(5.0), np.arange(5.0), indexing="ij")
    corner = np.arange(25).reshape(5, 5)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    faces = np.stack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)], axis=1).reshape(-1, 3)
    return Surface(np.stack([x.ravel(), y.ravel(), np.zeros(25)], axis=1), faces)


def part(surface: Surface, rows: np.ndarray) -> Piece:
    """Some of its faces where they lie."""
    flat = restricted(Flat(surface, surface.vertices[:, :2].copy(), {}), rows)
    return measured(surface, rows, flat, float(surface.face_areas().sum()))


def test_without_scraps_charts_come_back_as_they_are() -> None:
    surface = sheet()
    chart = part(surface, np.arange(len(surface.faces)))
    assert scraps_given(surface, [chart], [], CONFIG) == [chart]


@pytest.mark.parametrize("scrap", [[0], [5, 6, 7], [13]])
def test_what_was_cut_off_fits_in_again(scrap: list[int]) -> None:
    surface = sheet()
    rows = np.arange(len(surface.faces))
    chart, off = part(surface, np.setdiff1d(rows, scrap)), part(surface, np.array(scrap))
    (found,) = scraps_given(surface, [chart], [off], CONFIG)
    assert sorted(found.ids.tolist()) == rows.tolist()
    assert np.array_equal(found.flat.surface.vertices[found.flat.surface.faces], surface.triangles[found.ids])
    uv = found.flat.uv[found.flat.surface.faces]
    assert uv == pytest.approx(surface.triangles[found.ids][:, :, :2], abs=1e-12)
    assert len(overlapping_pairs(uv)) == 0
    assert found.energy == pytest.approx(0.0, abs=1e-12)


def test_a_scrap_without_room_stays_a_chart() -> None:
    surface = sheet()
    rows = np.arange(len(surface.faces))
    chart, off = part(surface, rows[1:]), part(surface, rows[:1])
    uv = chart.flat.uv.copy()
    squeezed = Piece(chart.ids, Flat(chart.flat.surface, np.zeros_like(uv), {}), 0.0, 0.0)
    found = scraps_given(surface, [squeezed], [off], CONFIG)
    assert len(found) == 2
    assert found[0] is squeezed
    assert found[1] is off


def test_the_longest_border_is_asked_first_and_nobody_once_it_is_late() -> None:
    surface = sheet()
    owner = np.zeros(len(surface.faces), dtype=np.int64)
    table = edge_table(surface.faces)
    inner = int(np.flatnonzero((table.edge_faces[table.face_edges] >= 0).all(axis=(1, 2)))[0])
    around = np.setdiff1d(table.edge_faces[table.face_edges[inner]], [inner])
    owner[around[0]] = 1
    owner[inner] = -1
    assert list(neighbours(surface, table, owner, np.array([inner]))) == [0, 1]
    rows = np.arange(len(surface.faces))
    chart, off = part(surface, rows[1:]), part(surface, rows[:1])
    assert scraps_given(surface, [chart], [off], CONFIG, lambda: True) == [chart, off]

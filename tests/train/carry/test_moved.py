"""Faces that changed sides: on a flat sheet they lie as if they had always been there, and nothing else moves."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.carry.moved import as_others_lead, rows_of
from flexpara.train.config import FinishConfig
from flexpara.train.finish.openings import slit_along
from flexpara.train.finish.pieces import Piece, extract, measured
from flexpara.train.finish.slits import Flat, Slit

CONFIG = FinishConfig()
TURN = np.array([[0.6, -0.8], [0.8, 0.6]])


def sheet() -> Surface:
    """A flat square, x and y from −1 to 1."""
    vertices, faces = make_sample("cloth", resolution=12)
    return Surface(vertices * [1.0, 1.0, 0.0], faces)


def turned(points: np.ndarray) -> np.ndarray:
    return points[:, :2] @ TURN.T


def part(whole: Surface, ids: np.ndarray) -> Piece:
    """Faces of the sheet, laid flat without stretch."""
    disk = extract(whole, ids)
    return measured(whole, ids, Flat(disk, turned(disk.vertices), {}), 4.0)


def test_faces_that_came_are_laid_beside_those_that_were_there() -> None:
    whole = sheet()
    x, y = whole.triangles.mean(axis=1)[:, :2].T
    source = part(whole, np.flatnonzero(x < 0.2 * np.sign(np.sin(9.0 * y))))
    straight = np.flatnonzero(x < 0.1)
    assert len(np.setdiff1d(straight, source.ids)) > 3
    disk = extract(whole, straight)
    found = as_others_lead(disk, straight, source, CONFIG.fine)
    assert found is not None
    assert found == pytest.approx(turned(disk.vertices), abs=1e-9)


def test_what_stays_stays_to_the_bit() -> None:
    whole = sheet()
    ids = np.flatnonzero(whole.triangles.mean(axis=1)[:, 0] < 0.2)
    source = part(whole, ids)
    backwards = ids[::-1].copy()
    disk = extract(whole, backwards)
    found = as_others_lead(disk, backwards, source, CONFIG.fine)
    assert found is not None
    assert np.array_equal(found[disk.faces][::-1], source.flat.uv[source.flat.surface.faces])


def test_a_slit_that_closed_leaves_no_place_for_its_sides() -> None:
    whole = sheet()
    slit = slit_along(whole, (Slit(np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])),), CONFIG.slit)
    uv = slit.vertices[:, :2].copy()
    upper = np.unique(slit.faces[slit.triangles.mean(axis=1)[:, 1] > 0.0])
    uv[upper, 1] += np.maximum(-uv[upper, 0], 0.0)
    ids = np.arange(len(whole.faces))
    source = measured(whole, ids, Flat(slit, uv, {}), 4.0)
    assert as_others_lead(extract(whole, ids), ids, source, CONFIG.fine) is None
    assert as_others_lead(slit, ids, source, CONFIG.fine) == pytest.approx(uv)


def test_rows_are_found_whatever_the_order() -> None:
    assert rows_of(np.array([4, 9, 7]), np.array([7, 4, 1])).tolist() == [1, -1, 0]

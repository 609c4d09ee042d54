"""Beside a slit, the face that answers lies on the right side of it."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.carry import sides
from flexpara.train.carry.layout import nearest_faces
from flexpara.train.carry.sides import CoarseMap, faces_beside, torn_apart
from flexpara.train.config import FinishConfig
from flexpara.train.finish.openings import slit_along
from flexpara.train.finish.slits import Flat, Slit

CONFIG = FinishConfig()
SLIT = Slit(np.array([[-1.0, 0.0, 0.0], [-0.5, 0.0, 0.0], [0.0, 0.0, 0.0]]))
OPENING = 0.4


def sheet(resolution: int, wiggle: float = 0.0) -> Surface:
    """A flat sheet slit from its left side to its middle; ``wiggle`` moves its vertices off the slit's line."""
    vertices, faces = make_sample("cloth", resolution=resolution)
    flat = vertices * [1.0, 1.0, 0.0]
    inside = np.abs(flat[:, 0]) < 0.9
    flat[:, 1] += wiggle * np.sin(9.0 * flat[:, 0]) * inside * (np.abs(flat[:, 1]) < 0.9)
    return slit_along(Surface(flat, faces), (SLIT,), CONFIG.slit)


def opened(surface: Surface) -> np.ndarray:
    """Uv (v, 2) in which the two sides of the slit lie apart, each as it was but for a turn around its tip."""
    uv = surface.vertices[:, :2].copy()
    upper = np.zeros(len(uv), dtype=bool)
    upper[surface.faces[surface.triangles.mean(axis=1)[:, 1] > 0.0]] = True
    left = uv[:, 0] < 0.0
    uv[:, 1] += np.where(left, np.where(upper, -OPENING, OPENING) * uv[:, 0], 0.0)
    return uv


def test_faces_go_on_from_their_own_side() -> None:
    coarse, fine = sheet(10), sheet(40, wiggle=0.03)
    chosen = faces_beside(fine, Flat(coarse, opened(coarse), {}), CONFIG)
    plain = nearest_faces(fine, coarse, CONFIG.carry)
    side = np.sign(sheet(40).triangles.mean(axis=1)[:, 1])
    theirs = np.sign(coarse.triangles.mean(axis=1)[:, 1])
    left = fine.triangles.mean(axis=1)[:, 0] < -0.2
    assert (theirs[plain] != side)[left].any()  # position alone can't tell
    assert not (theirs[chosen] != side)[left].any()


def test_without_a_slit_the_nearest_answers() -> None:
    coarse, fine = (Surface(*make_sample("cloth", resolution=n)) for n in (10, 40))
    chosen = faces_beside(fine, Flat(coarse, coarse.vertices[:, :2], {}), CONFIG)
    assert np.array_equal(chosen, nearest_faces(fine, coarse, CONFIG.carry))


def test_the_map_of_a_face_goes_on_beyond_it() -> None:
    surface = sheet(8)
    mapped = CoarseMap(Flat(surface, 2.0 * surface.vertices[:, :2], {}))
    points = np.array([[0.3, 0.2, 0.0], [5.0, 5.0, 0.0]])
    np.testing.assert_allclose(mapped(np.array([0, 1]), points), 2.0 * points[:, :2], atol=1e-9)


def test_faces_across_an_open_slit_are_torn_apart() -> None:
    surface = sheet(10)
    mapped = CoarseMap(Flat(surface, opened(surface), {}))
    place = surface.triangles.mean(axis=1)
    above = int(np.linalg.norm(place - [-0.8, 0.1, 0.0], axis=1).argmin())
    below = int(np.linalg.norm(place - [-0.8, -0.1, 0.0], axis=1).argmin())
    right = [int(np.linalg.norm(place - [0.5, y, 0.0], axis=1).argmin()) for y in (0.1, -0.1)]
    assert torn_apart(mapped, np.array([[above, below], right]), 1.5).tolist() == [True, False]


def test_what_is_known_of_near_faces_is_not_looked_for_again_and_changes_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    coarse, fine = sheet(10), sheet(40)
    source = Flat(coarse, coarse.vertices[:, :2], {})
    expected = faces_beside(fine, source, CONFIG)
    near = nearest_faces(fine, coarse, CONFIG.carry)
    near[::7] = -1
    asked = []
    monkeypatch.setattr(sides, "nearest_faces", lambda part, *rest: asked.append(part) or nearest_faces(part, *rest))
    assert np.array_equal(faces_beside(fine, source, CONFIG, near), expected)
    assert [len(part.faces) for part in asked] == [len(near[::7])]

"""Ribbons: which parts are strips, in which order their rungs come, and that a bent one is laid straight, whole."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.geometry.triangles import signed_areas
from flexpara.runtime.mesh import Surface
from flexpara.train.charts.planar import flat_regions
from flexpara.train.charts.ribbons import ribbon, rungs, straight
from flexpara.train.config import PlanarConfig

CONFIG = PlanarConfig()


def arc(width: float, squares: int = 24, turn: float = 3.0, rise: float = 0.0) -> Surface:
    """A strip of so many squares around an arc of radius 1, that turns so far, radians."""
    angle = np.linspace(0.0, turn, squares + 1)
    rails = [
        np.column_stack([radius * np.cos(angle), radius * np.sin(angle), rise * angle**2])
        for radius in (1.0 + width / 2.0, 1.0 - width / 2.0)
    ]
    n, far = np.arange(squares), squares + 1
    faces = np.concatenate([np.stack([n, n + 1, n + far], 1), np.stack([n + 1, n + far + 1, n + far], 1)])
    return Surface(np.concatenate(rails), faces)


def found(surface: Surface, side: float) -> list[np.ndarray]:
    table = edge_table(surface.faces)
    return [each.uv for each in ribbon(surface, table, flat_regions(surface, table, CONFIG), CONFIG, side)]


def test_the_rungs_of_a_strip_come_in_order_left_ends_first() -> None:
    square = Surface(
        np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 1, 0]]), np.array([[1, 2, 0], [2, 3, 0], [1, 4, 2]])
    )
    walk = rungs(square, edge_table(square.faces))
    assert walk is not None
    assert walk.tolist() in ([[2, 0], [2, 1]], [[1, 2], [0, 2]])


@pytest.mark.parametrize("name", ["ring", "fan with a branch", "one triangle"])
def test_what_is_no_strip_has_no_rungs(name: str) -> None:
    ring = arc(0.2, turn=2.0 * np.pi)
    faces = {
        "ring": np.where(ring.faces % 25 == 24, ring.faces - 24, ring.faces),
        "fan with a branch": np.array([[0, 1, 2], [1, 0, 3], [2, 1, 4], [0, 2, 5]]),
        "one triangle": np.array([[0, 1, 2]]),
    }[name]
    surface = Surface(ring.vertices, faces)
    assert rungs(surface, edge_table(faces)) is None


@pytest.mark.parametrize("rise", [0.0, 0.2])
def test_a_thin_arc_is_laid_straight_in_one_piece(rise: float) -> None:
    (uv,) = found(arc(0.02, rise=rise), side=10.0)
    assert (signed_areas(uv) > 0.0).all()
    width = np.sort(np.ptp(uv.reshape(-1, 2), axis=0))
    assert width[0] == pytest.approx(0.02, abs=0.0025)  # middles of diagonals lie a little beside the arc
    assert width[1] >= 0.99 * 3.0


def test_an_arc_bent_straight_keeps_the_widths_of_its_rungs_and_the_length_of_its_middle() -> None:
    surface = arc(0.1)
    walk = rungs(surface, edge_table(surface.faces))
    assert walk is not None
    uv = straight(surface.faces, surface.triangles[:, :, :2], walk)
    sides = np.ptp(uv.reshape(-1, 2), axis=0)
    assert sides == pytest.approx([48 * np.sin(3.0 / 48), 0.1], rel=0.02)


def test_a_wide_arc_and_one_too_long_for_its_page_are_left_to_others() -> None:
    assert found(arc(0.5, turn=5.5), side=10.0) == []
    assert found(arc(0.02), side=1.0) == []

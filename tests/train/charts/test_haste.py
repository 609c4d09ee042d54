"""Strict budgets: what is begun, what ends, and what comes of a surface for which there is no time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from flexpara.runtime.mesh import Surface
from flexpara.runtime.process.deadline import Deadline
from flexpara.runtime.process.progress import Stages
from flexpara.train.carry.config import HasteConfig
from flexpara.train.charts.charts import chart_surface
from flexpara.train.charts.haste import Haste
from flexpara.train.charts.proof import verify
from flexpara.train.config import FinishConfig

STRICT = HasteConfig(strict=True)


def knot() -> Surface:
    mesh = trimesh.creation.torus(1.0, 0.4, major_sections=40, minor_sections=20)
    return Surface(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64))


def test_without_a_deadline_it_is_never_late() -> None:
    haste = Haste(faces=10**9, config=STRICT)
    assert (haste.late(), haste.last(), haste.is_hopeless(10**9)) == (False, False, False)


def test_searches_end_before_layouts_do() -> None:
    faces = 100_000
    reserve = Haste(Deadline(0.0), faces, STRICT, cores=1).reserve()
    found = [
        Haste(Deadline(seconds), faces, STRICT, cores=1) for seconds in (0.9 * reserve, 1.5 * reserve, 9.0 * reserve)
    ]
    assert [haste.last() for haste in found] == [True, False, False]
    assert [haste.late() for haste in found] == [True, True, False]


def test_a_part_is_not_begun_where_half_of_it_would_have_no_layout() -> None:
    haste = Haste(Deadline(5.0), 100_000, STRICT, cores=1)
    assert [haste.is_hopeless(100_000, handles) for handles in (0, 1000)] == [False, True]
    assert haste.is_hopeless(300_000)
    assert not haste.is_hopeless(100_000, 10, thinned=False)


def test_more_cores_need_a_smaller_reserve() -> None:
    one, four = (Haste(Deadline(1.0), 10**6, STRICT, cores).reserve() for cores in (1, 4))
    assert four < one


def test_whoever_asks_for_the_best_so_far_gets_layouts() -> None:
    deadline = Deadline()
    deadline.ask()
    haste = Haste(deadline, 10**6, STRICT)
    assert (haste.late(), haste.last(), haste.is_hopeless(10**6)) == (True, False, False)


def test_a_budget_that_is_not_strict_ends_searches_alone() -> None:
    haste = Haste(Deadline(0.0), 10**6)
    assert (haste.late(), haste.last(), haste.is_hopeless(10**6)) == (True, False, False)


def test_a_slow_machine_needs_a_larger_reserve() -> None:
    slow = STRICT.at_pace(3.0)
    assert slow.strict
    assert slow.projecting == pytest.approx(3.0 * STRICT.projecting)
    assert Haste(Deadline(1.0), 1000, slow).reserve() == pytest.approx(
        3.0 * Haste(Deadline(1.0), 1000, STRICT).reserve()
    )


@pytest.mark.parametrize("seconds", [0.0, 0.35])
def test_a_surface_without_time_gets_valid_charts_without_a_search(seconds: float) -> None:
    config = replace(FinishConfig(), haste=STRICT)
    found = chart_surface(knot(), 4, config, 0, Stages(deadline=Deadline(seconds)))
    verify(found.pieces)
    np.testing.assert_array_equal(np.sort(np.concatenate([piece.ids for piece in found.pieces])), np.arange(1600))
    if seconds == 0.0:
        assert len(found.pieces) < 100
        assert any("time budget of 0 s" in note for note in found.notes)

"""Budgets of `flexpara.xatlas`: how slow a machine is, rows where charts are many, and what is said."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh

import flexpara.xatlas as xatlas  # pyright: ignore[reportMissingImports]  # runtime/aliases.py finds it
from flexpara.export.dropin.budget import BudgetConfig
from flexpara.runtime.geometry.metrics import measure
from flexpara.runtime.io.meshfile import asset_from_arrays

if TYPE_CHECKING:
    from collections.abc import Iterator

BALL = trimesh.creation.icosphere(subdivisions=3)


@pytest.fixture(autouse=True)
def fresh() -> Iterator[None]:
    yield
    xatlas.settings.__init__()


def test_the_pace_is_that_of_cleaning_within_bounds() -> None:
    budget = BudgetConfig()
    usual = budget.begun + 10**5 * budget.cleaning
    assert budget.pace(10**5, usual) == pytest.approx(1.0)
    assert budget.pace(10**5, 0.1 * usual) == 1.0
    assert budget.pace(10**5, 3.0 * usual) == pytest.approx(3.0)
    assert budget.pace(10**5, 1e9) == budget.slowest


def test_thousands_of_charts_take_seconds_to_lay_close() -> None:
    budget = BudgetConfig()
    assert budget.packs(10**5, 4000) - budget.packs(10**5, 0) == pytest.approx(10.0)


def test_a_budget_that_is_spent_gives_a_valid_atlas_in_rows_and_says_so(caplog: pytest.LogCaptureFixture) -> None:
    xatlas.settings.time_budget = 1e-3
    atlas = xatlas.Atlas()
    atlas.add_mesh(BALL.vertices, BALL.faces)
    with caplog.at_level(logging.WARNING, logger="flexpara.xatlas"):
        atlas.generate()
    assert "longer than the 0.001 s asked for" in caplog.text
    mapping, indices, uv = atlas[0]
    np.testing.assert_array_equal(mapping[indices], BALL.faces)
    found = measure(asset_from_arrays(BALL.vertices, BALL.faces).surface, uv[indices].astype(np.float64), size=1024)
    assert (found.flipped_faces, found.overlap_fraction) == (0, 0.0)
    assert atlas.utilization > 0.4


def test_a_budget_that_is_kept_is_not_spoken_of(caplog: pytest.LogCaptureFixture) -> None:
    xatlas.settings.time_budget = 600.0
    xatlas.parametrize(*(getattr(trimesh.creation.box(), name) for name in ("vertices", "faces")))
    assert "longer than" not in caplog.text

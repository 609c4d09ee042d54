"""What goes into the file besides weights, and what is refused."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import flexpara
from flexpara.export.graph.metadata import PlacedCharts, Provenance, bundle_metadata
from flexpara.runtime.errors import InputError, ShapeError
from flexpara.runtime.mesh import Frame


def test_metadata_say_what_was_exported(make_map: Callable[..., Any]) -> None:
    made = make_map((0, 1, 1, 2))
    facts = bundle_metadata(
        PlacedCharts(made.frame, made.atlas, made.charts), Provenance("ab12", {"seed": 3}, {"sd": 1.5})
    )
    assert (facts.chart_count, facts.patch_count, facts.patch_chart) == (3, 4, (0, 1, 1, 2))
    assert (facts.size, facts.padding, facts.frame) == (1024, 4, made.frame)
    assert np.array_equal(facts.placement_array(), made.atlas.placement)
    assert (facts.source_sha256, facts.settings, facts.metrics) == ("ab12", {"seed": 3}, {"sd": 1.5})
    assert (facts.producer_name, facts.producer_version) == ("flexpara", flexpara.__version__)


@pytest.mark.parametrize("centre", [(np.nan, 0.0, 0.0), (0.0, np.inf, 0.0)])
def test_a_frame_that_is_not_finite_is_refused(make_map: Callable[..., Any], centre: tuple[float, ...]) -> None:
    made = make_map()
    with pytest.raises(InputError, match="expected finite numbers"):
        bundle_metadata(PlacedCharts(Frame(centre, 1.0), made.atlas, made.charts), Provenance())  # type: ignore[arg-type]


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, 1e-42, 1e39])
def test_a_scale_outside_float32_is_refused(make_map: Callable[..., Any], scale: float) -> None:
    made = make_map()
    with pytest.raises(InputError, match="float32 scale"):
        bundle_metadata(PlacedCharts(Frame((0.0, 0.0, 0.0), scale), made.atlas, made.charts), Provenance())


def test_an_atlas_without_placement_is_refused(make_map: Callable[..., Any]) -> None:
    made = make_map()
    with pytest.raises(InputError, match="pack them first"):
        bundle_metadata(
            PlacedCharts(made.frame, dataclasses.replace(made.atlas, placement=None), made.charts), Provenance()
        )


@pytest.mark.parametrize("placement", [np.zeros((3, 2)), np.zeros((0, 2, 3)), np.zeros((3, 3, 3))])
def test_a_placement_of_another_shape_is_refused(make_map: Callable[..., Any], placement: np.ndarray) -> None:
    made = make_map()
    with pytest.raises(ShapeError, match="expected \\(k, 2, 3\\)"):
        bundle_metadata(
            PlacedCharts(made.frame, dataclasses.replace(made.atlas, placement=placement), made.charts), Provenance()
        )


def test_a_patch_of_a_chart_that_was_not_placed_is_refused(make_map: Callable[..., Any]) -> None:
    made = make_map((0, 1, 1, 2))
    atlas = dataclasses.replace(made.atlas, placement=made.atlas.placement[:2])
    with pytest.raises(ShapeError, match="indices in \\[0, 2\\)"):
        bundle_metadata(PlacedCharts(made.frame, atlas, made.charts), Provenance())

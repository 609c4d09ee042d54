"""The paper's tables are whole, say what the paper says, and know which of their figures a run has measured."""

from __future__ import annotations

from collections import Counter
from typing import Any

import pytest

from benchmarks.tables import Figure, coverage, figures_of, load_figures, load_tables, same_model, why_not_run

SIZES = {"Table 1": 64, "Table 2": 64, "Table 3": 6, "Table 4": 176, "Table 5": 96, "Table 6": 25, "Table 7": 60}
BY_HAND = [
    ("Table 1", "Bunny", "ours", "conformality", 0.0634),
    ("Table 1", "Torus-knot", "optcuts", "conformality", 0.7320),
    ("Table 1", "Trefoil-torus", "nuvo", "conformality", 0.8251),
    ("Table 2", "Rocker-arm", "slim", "seconds", 4.0),
    ("Table 3", "Spiral-pts (#Pts=28K)", "fbcp-pc", "conformality", 0.023),
    ("Table 4", "Bunny", "xatlas", "isometric", 5.6e-4),
    ("Table 4", "Armadillo", "smart-uv", "charts", 1235.0),
    ("Table 4", "Hand", "nuvo", "seam_length", 35.39),
    ("Table 4", "Dolphin", "smart-uv", "seconds", 0.16),
    ("Table 5", "HexBowl", "nuvo", "isometric", 8021e-4),
    ("Table 5", "PantonChair", "ours", "seam_length", 646.1),
    ("Table 6", "Fixture", "without-upper-branch", "conformality", 0.083),
    ("Table 7", "Box", "with-ddl", "equiareal", 4.33e-6),
    ("Table 7", "Human", "with-bi-directional", "seconds", 1.51 * 3600),
    ("Table 7", "Fish", "ours", "conformality", 33.6e-3),
]


def figure(**changes: Any) -> Figure:
    """Bunny's conformality by the paper's method, but for the changes."""
    base = {"table": "Table 1", "label": "x", "mode": "global", "kind": "mesh", "model": "Bunny", "system": "ours"}
    return Figure(**{**base, "quantity": "conformality", "unit": "radians", "value": 0.0634, **changes})


def ran(**changes: Any) -> dict[str, Any]:
    """The row of a run that is done, but for the changes."""
    row = {"mesh": "bunny", "mode": "global", "system": "flexpara", "ablation": "", "status": "done", "why": ""}
    return {**row, **changes}


def test_every_table_is_whole() -> None:
    assert Counter(item.table for item in load_figures()) == SIZES
    models = {table["name"]: len({entry[0] for entry in table["figures"]}) for table in load_tables()}
    assert list(models.values()) == [16, 16, 3, 11, 6, 5, 5]


def test_every_row_of_a_table_has_all_its_cells_once() -> None:
    for table in load_tables():
        cells = Counter((model, system, quantity) for model, system, quantity, _ in table["figures"])
        models, systems, quantities = (len(set(part)) for part in zip(*cells, strict=True))
        assert len(cells) == models * systems * quantities
        assert set(cells.values()) == {1}
        assert set(table["columns"]) == {quantity for _, _, quantity in cells}


def test_every_table_has_the_papers_label_and_caption() -> None:
    tables = load_tables()
    assert len({table["label"] for table in tables}) == 7
    assert all("quantitative" in table["label"] and table["caption"].endswith(".") for table in tables)
    assert {table["name"]: table["mode"] for table in tables if table["mode"] == "multi-chart"}.keys() == {
        "Table 4", "Table 5", "Table 7",
    }  # fmt: skip


@pytest.mark.parametrize(("table", "model", "system", "quantity", "value"), BY_HAND)
def test_figures_read_off_the_page_agree(table: str, model: str, system: str, quantity: str, value: float) -> None:
    key = (table, model, system, quantity)
    found = [item.value for item in load_figures() if (item.table, item.model, item.system, item.quantity) == key]
    assert found == [pytest.approx(value, rel=1e-12)]


def test_the_best_conformality_of_table_1_is_always_ours_as_the_paper_prints_in_bold() -> None:
    best: dict[str, Figure] = {}
    for item in (item for item in load_figures() if item.table == "Table 1"):
        best[item.model] = min(best.get(item.model, item), item, key=lambda each: each.value)
    assert {item.system for item in best.values()} == {"ours"}


@pytest.mark.parametrize(
    ("one", "other"), [("Rocker-arm", "rocker-arm"), ("Beetle-alt", "beetle alt"), ("Bunny", "BUNNY")]
)
def test_names_that_differ_by_case_and_dashes_mean_one_model(one: str, other: str) -> None:
    assert same_model(one, other)
    assert not same_model(one, other + "2")


def test_a_models_figures_are_those_of_its_mode() -> None:
    found = figures_of(load_figures(), "bird", "global")
    assert Counter(item.table for item in found) == {"Table 1": 4, "Table 2": 4, "Table 6": 5}
    assert {item.mode for item in figures_of(load_figures(), "bird", "multi-chart")} == {"multi-chart"}


@pytest.mark.parametrize(("model", "count"), [("bunny", 24), ("beetle-alt", 8), ("rocker-arm", 8), ("homer", 0)])
def test_the_figures_of_the_models_at_hand_are_found(model: str, count: int) -> None:
    figures = load_figures()
    assert len(figures_of(figures, model, "global") + figures_of(figures, model, "multi-chart")) == count


def test_a_figure_is_measured_by_a_run_of_the_same_model_mode_and_system() -> None:
    assert why_not_run(figure(), [ran()]) == ""
    assert why_not_run(figure(), [ran(mesh="cow")]) == "no mesh of that name was given"
    assert why_not_run(figure(), [ran(mode="multi-chart")]) == "flexpara, global, was not asked for"
    assert why_not_run(figure(), [ran(status="incomplete", why="late")]) == "flexpara, global, incomplete: late"


def test_an_ablations_figure_is_measured_by_that_ablation_alone() -> None:
    ablated = figure(system="without-upper-branch")
    assert why_not_run(ablated, [ran()]) == "flexpara no-upper, global, was not asked for"
    assert why_not_run(ablated, [ran(ablation="no-upper")]) == ""
    assert why_not_run(figure(), [ran(ablation="no-upper")]) == "flexpara, global, was not asked for"


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"system": "nuvo"}, "Nuvo is no system"),
        ({"system": "optcuts"}, "OptCuts is"),
        ({"kind": "points"}, "point clouds"),
    ],
)
def test_what_the_harness_cannot_run_is_said(changes: dict[str, Any], why: str) -> None:
    assert why in why_not_run(figure(**changes), [ran()])


def test_every_figure_is_counted_once() -> None:
    counts = coverage(load_figures(), [ran()])
    assert {table: reasons.total() for table, reasons in counts.items()} == SIZES
    assert {table: reasons[""] for table, reasons in counts.items() if reasons[""]} == {"Table 1": 1, "Table 2": 1}

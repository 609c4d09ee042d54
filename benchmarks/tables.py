"""The paper's tables as data (`paper_tables.json`), and what of them a run of the harness has measured.

A figure is one number of one table: model, system, quantity and the value in the column's unit.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable

TABLES = Path(__file__).with_name("paper_tables.json")
COUNTERPART = {
    "ours": ("flexpara", ""),
    "xatlas": ("xatlas", ""),
    "smart-uv": ("smart-uv", ""),
    "slim": ("slim", ""),
    "without-tdl": ("flexpara", "no-triangle"),
    "without-ddl": ("flexpara", "no-differential"),
    "without-upper-branch": ("flexpara", "no-upper"),
    "without-lower-branch": ("flexpara", "no-lower"),
    "with-bi-directional": ("flexpara", "bidirectional"),
    "with-ddl": ("flexpara", "chart-differential"),
}
"""Systems of the paper → (system, ablation) of this harness."""
NOT_HERE = {
    "optcuts": "OptCuts is a C++ program, no system of this harness",
    "nuvo": "Nuvo is no system of this harness",
    "fbcp-pc": "FBCP-PC wants boundary points named by hand",
}


@dataclass(frozen=True)
class Figure:
    """One number of the paper.  table: "Table 1" …  mode: "global" or "multi-chart".  kind: "mesh" or "points".

    value: in `unit`, the column's power of ten multiplied in.
    """

    table: str
    label: str
    mode: str
    kind: str
    model: str
    system: str
    quantity: str
    unit: str
    value: float


def load_tables(path: Path = TABLES) -> list[dict[str, Any]]:
    """The tables as they stand in the file: name, label, caption, mode, kind, columns, remarks, figures."""
    return json.loads(path.read_text(encoding="utf-8"))["tables"]


def load_figures(path: Path = TABLES) -> list[Figure]:
    """Every number of the paper's tables, in their order."""
    found = []
    for table in load_tables(path):
        heading = (table["name"], table["label"], table["mode"], table["kind"])
        for model, system, quantity, printed in table["figures"]:
            column = table["columns"][quantity]
            found.append(Figure(*heading, model, system, quantity, column["unit"], printed * column["times"]))
    return found


def same_model(one: str, other: str) -> bool:
    """Whether two names mean the same model: case, spaces and dashes apart."""
    first, second = (re.sub(r"[^a-z0-9]", "", name.lower()) for name in (one, other))
    return first == second


def figures_of(figures: Iterable[Figure], model: str, mode: str) -> list[Figure]:
    """The paper's figures of a model in a mode."""
    return [item for item in figures if same_model(item.model, model) and item.mode == mode]


def measures(row: dict[str, Any], figure: Figure) -> bool:
    """Whether the row of a run is of the figure's model, mode, system and ablation."""
    same = same_model(row["mesh"], figure.model) and row["mode"] == figure.mode
    return same and (row["system"], row["ablation"]) == COUNTERPART.get(figure.system)


def why_not_run(figure: Figure, runs: list[dict[str, Any]]) -> str:
    """Why no run of the harness has measured what this figure says; "" where one has.

    Args:
        figure: one of the paper's.
        runs: rows with mesh, mode, system, ablation, status and why, as the harness makes them.
    """
    if figure.kind == "points":
        return "point clouds are not part of this harness"
    if figure.system in NOT_HERE:
        return NOT_HERE[figure.system]
    if not any(same_model(row["mesh"], figure.model) for row in runs):
        return "no mesh of that name was given"
    name = " ".join(word for word in COUNTERPART[figure.system] if word)
    row = next((row for row in runs if measures(row, figure)), None)
    if row is None:
        return f"{name}, {figure.mode}, was not asked for"
    return "" if row["status"] == "done" else f"{name}, {figure.mode}, {row['status']}: {row['why']}"


def coverage(figures: Iterable[Figure], runs: list[dict[str, Any]]) -> dict[str, Counter[str]]:
    """Table name → why not run → number of figures; those that were measured are under ""."""
    counts: dict[str, Counter[str]] = {}
    for figure in figures:
        counts.setdefault(figure.table, Counter())[why_not_run(figure, runs)] += 1
    return counts

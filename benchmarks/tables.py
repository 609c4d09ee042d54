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
COUNTERPART = {"ours": "flexpara", "xatlas": "xatlas", "smart-uv": "smart-uv", "slim": "slim"}
"""Systems of the paper → systems of this harness."""
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
    """The paper's figures of a model in a mode, ablations left out."""
    chosen = (item for item in figures if same_model(item.model, model) and item.mode == mode)
    return [item for item in chosen if not is_ablation(item)]


def is_ablation(figure: Figure) -> bool:
    """Whether the figure belongs to an ablation study."""
    return "ablation" in figure.label


def why_not_run(figure: Figure, runs: Iterable[dict[str, Any]]) -> str:
    """Why no run of the harness has measured what this figure says; "" where one has.

    Args:
        figure: one of the paper's.
        runs: rows with mesh, mode, system, status and why, as the harness makes them.
    """
    if is_ablation(figure):
        return "ablations are not part of this harness"
    if figure.kind == "points":
        return "point clouds are not part of this harness"
    if figure.system in NOT_HERE:
        return NOT_HERE[figure.system]
    here = [row for row in runs if same_model(row["mesh"], figure.model)]
    if not here:
        return "no mesh of that name was given"
    system = COUNTERPART[figure.system]
    row = next((row for row in here if row["system"] == system and row["mode"] == figure.mode), None)
    if row is None:
        return f"{system}, {figure.mode}, was not asked for"
    return "" if row["status"] == "done" else f"{system}, {figure.mode}, {row['status']}: {row['why']}"


def coverage(figures: Iterable[Figure], runs: list[dict[str, Any]]) -> dict[str, Counter[str]]:
    """Table name → why not run → number of figures; those that were measured are under ""."""
    counts: dict[str, Counter[str]] = {}
    for figure in figures:
        counts.setdefault(figure.table, Counter())[why_not_run(figure, runs)] += 1
    return counts

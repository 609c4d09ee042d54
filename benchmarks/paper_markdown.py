"""The harness' report as Markdown: one table a mode, the paper's rows beneath ours, and what every column means.

A quantity is a column of the paper's tables together with our metric for it.  † marks columns whose normalisation the
paper doesn't state: those figures stand in the same column and must not be compared.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from .systems import MODES
from .tables import coverage, figures_of, load_figures, load_tables, measures

if TYPE_CHECKING:
    from .tables import Figure

Row = dict[str, Any]


class Quantity(NamedTuple):
    """A column: our metric ("seconds" is no metric), its heading, how it is printed, and what both sides mean by it.

    times: the printed number × times is the value.  comparable: the paper's definition fits ours.
    """

    metric: str
    heading: str
    form: str
    times: float
    comparable: bool
    definition: str

    def of(self, row: Row) -> float:
        """The value of a row that is done."""
        return row["seconds"] if self.metric == "seconds" else row["metrics"][self.metric]

    def text(self, value: float | None) -> str:
        """A cell; empty for None."""
        return "" if value is None else self.form.format(value / self.times)


UNSTATED = "the paper states neither a formula nor a normalisation, so its figures must not be compared with ours"
QUANTITIES = {
    "conformality": Quantity(
        "conformal_mean", "conformality", "{:.4f}", 1.0, True,
        "`conformal_mean`: mean over faces of the mean |angle − uv angle| of the three corners, radians. Paper: “the "
        "average absolute angular difference between corresponding triangles”, unit not stated, radians assumed. Ours "
        "counts every face of the finished atlas; rows marked raw are the network's own map before it is finished, as "
        "the paper measures it: in global mode over all faces, and over those that don't cross the learned seam; in "
        "multi-chart mode over the faces whose corners are in one chart.",
    ),
    "isometric": Quantity(
        "isometric_mean", "isometric ×10⁻⁴ †", "{:.1f}", 1e-4, False,
        "`isometric_mean`: mean over faces and edges of |length − uv length|, mesh in the unit ball, uv scaled to the "
        f"same total area. Paper: “isometric distortion”; {UNSTATED}. “÷ xatlas” divides by xatlas' figure in the same "
        "table: a common factor falls out, and that column can be compared.",
    ),
    "equiareal": Quantity(
        "equiareal_mean", "equiareal ×10⁻⁶ †", "{:.2f}", 1e-6, False,
        f"`equiareal_mean`: mean over faces of |area − uv area|, normalised alike. Paper: ablation only; {UNSTATED}.",
    ),
    "charts": Quantity("charts", "charts", "{:.0f}", 1.0, True, "number of charts, connected in uv."),
    "seam_length": Quantity(
        "seam_length", "seam †", "{:.2f}", 1.0, False,
        "`seam_length`: 3D length of the interior edges whose uv differ / √area; borders of the surface are no seams. "
        f"Paper: “total seam length”; {UNSTATED}.",
    ),
    "seconds": Quantity(
        "seconds", "seconds", "{:.2f}", 1.0, True,
        "the system's own call on the hardware named above, flexpara with its imports, training and export, slim "
        "without the seams it was given. Paper: “optimization time” on one RTX 3090, slim without the seams made by "
        "hand.",
    ),
}  # fmt: skip
COLUMNS = ("conformality", "isometric", "equiareal", "charts", "seam_length", "seconds")
PAPER_NAMES = {
    "ours": "FlexPara", "optcuts": "OptCuts", "slim": "SLIM, seams by hand", "nuvo": "Nuvo", "xatlas": "xatlas",
    "smart-uv": "Smart UV", "fbcp-pc": "FBCP-PC", "without-tdl": "FlexPara, no TDL", "without-ddl": "FlexPara, no DDL",
    "without-upper-branch": "FlexPara, no upper branch", "without-lower-branch": "FlexPara, no lower branch",
    "with-bi-directional": "FlexPara, bi-directional", "with-ddl": "FlexPara, with DDL",
}  # fmt: skip
READINGS = {"all": "the network's own map", "off_seam": "the same, faces across the seam left out"}
"""Readings of a map that is not finished, as flexpara reports them: the paper doesn't say which of them it takes."""


def markdown(facts: Row, rows: list[Row]) -> str:
    """The whole report.  facts, rows: as `benchmarks.paper` makes them."""
    parts = ["# FlexPara's tables beside flexpara", heading(facts)]
    modes = [mode for mode in MODES if any(row["mode"] == mode for row in rows)]
    parts += [
        f"## {mode.capitalize()}\n\n{table(mode, [row for row in rows if row['mode'] == mode])}" for mode in modes
    ]
    return "\n\n".join([*parts, beside(rows), notes(), not_run(rows)]) + "\n"


def heading(facts: Row) -> str:
    """Date, hardware, versions, commit, settings."""
    packages = ", ".join(f"{name} {number}" for name, number in facts["versions"].items())
    settings = ", ".join(f"{name} {plain(value)}" for name, value in facts["settings"].items() if value is not None)
    where = f"{facts['date']} · {facts['cpu']}, {facts['cores']} cores · torch on {facts['device']}"
    where += f" · {facts['conditions']}"
    return f"{where} · Python {facts['python']} · {packages} · commit {facts['commit']}\n\nSettings: {settings}."


def plain(value: Any) -> str:
    """A setting in words."""
    if isinstance(value, tuple | list):
        return "+".join(value) or "none"
    return f"{value:g}" if isinstance(value, float) else str(value)


def table(mode: str, rows: list[Row]) -> str:
    """The Markdown table of a mode: each mesh's systems, then the paper's."""
    titles = [QUANTITIES[name].heading for name in COLUMNS]
    titles.insert(2, "÷ xatlas")
    lines = [joined(["mesh", "system", *titles, "flips", "overlap", "note"]), "|---" * (len(titles) + 5) + "|"]
    figures = load_figures()
    for mesh in dict.fromkeys(row["mesh"] for row in rows):
        for row in (row for row in rows if row["mesh"] == mesh):
            lines += [joined(cells) for cells in measured_cells(row)]
        theirs = figures_of(figures, mesh, mode)
        for group in paper_groups(theirs):
            lines.append(joined(paper_cells(mesh, group, theirs)))
        lines += (
            [] if theirs else [joined([mesh, "paper", *[""] * (len(titles) + 2), "has no such model in this mode"])]
        )
    return "\n".join(lines)


def name_of(row: Row) -> str:
    """System of a row, for flexpara with preset and ablation."""
    words = [row["system"], *([row["preset"]] if row["system"] == "flexpara" else []), row["ablation"]]
    return " ".join(word for word in words if word)


def measured_cells(row: Row) -> list[list[str]]:
    """The line of a run, and one for each raw reading it gives."""
    name = name_of(row).replace("flexpara", "**flexpara**")
    if row["status"] != "done":
        return [[row["mesh"], name, *[""] * (len(COLUMNS) + 3), f"{row['status']}: {row['why']}"]]
    values = [QUANTITIES[column].text(QUANTITIES[column].of(row)) for column in COLUMNS]
    ratio = row.get("isometric_ratio")
    values.insert(2, "" if ratio is None else f"{ratio:.2f}")
    metrics = row["metrics"]
    note = "on flexpara's seams" if row["system"] == "slim" else "finished atlas" if row["raw"] else ""
    note = f"Blender {row['report']['blender']}" if row["system"] == "smart-uv" else note
    flips = [str(metrics["flipped_faces"]), f"{metrics['overlap_fraction']:.1e}"]
    lines = [[row["mesh"], name, *values, *flips, note]]
    for reading, figures in row["raw"].items():
        raw = [QUANTITIES[column].text(figures.get(QUANTITIES[column].metric)) for column in COLUMNS]
        raw.insert(2, "")
        lines.append([row["mesh"], f"{name}, raw", *raw, "", "", READINGS[reading]])
    return lines


def paper_groups(figures: list[Figure]) -> list[list[Figure]]:
    """One group a line: a system of the paper, its ablation studies apart (they give the full method other figures)."""
    groups: dict[tuple[str, bool], list[Figure]] = {}
    for item in figures:
        groups.setdefault((item.system, "ablation" in item.label), []).append(item)
    return list(groups.values())


def paper_cells(mesh: str, group: list[Figure], figures: list[Figure]) -> list[str]:
    """The line of a system of the paper; figures: all of that mesh and mode, for xatlas' isometric."""
    value = {item.quantity: item.value for item in group}
    values = [QUANTITIES[column].text(value.get(column)) for column in COLUMNS]
    xatlas = {item.table: item.value for item in figures if (item.system, item.quantity) == ("xatlas", "isometric")}
    ours = next((item for item in group if item.quantity == "isometric" and item.table in xatlas), None)
    values.insert(2, "" if ours is None else f"{ours.value / xatlas[ours.table]:.2f}")
    tables = ", ".join(dict.fromkeys(item.table for item in group))
    return [mesh, f"paper: {PAPER_NAMES[group[0].system]}", *values, "", "", tables]


def comparisons(rows: list[Row]) -> list[Row]:
    """Each figure of the paper whose model, mode, system and ablation were measured here, with what was measured.

    paper, measured: in the unit of the figure.  raw: reading → the network's own map, where the run says so.
    comparable: whether the paper's definition fits ours; ratios of the others mean nothing.
    """
    found, figures = list[Row](), load_figures()
    for row in (row for row in rows if row["status"] == "done"):
        for item in (item for item in figures_of(figures, row["mesh"], row["mode"]) if measures(row, item)):
            quantity = QUANTITIES[item.quantity]
            same = {"table": item.table, "label": item.label, "model": item.model, "mode": item.mode}
            same |= {"paper_system": item.system, "system": row["system"], "ablation": row["ablation"]}
            same |= {"quantity": item.quantity, "paper": item.value, "measured": quantity.of(row)}
            raw = {name: figures.get(quantity.metric) for name, figures in row["raw"].items()}
            raw = {name: value for name, value in raw.items() if value is not None}
            found.append(same | {"raw": raw, "comparable": quantity.comparable})
    return found


def beside(rows: list[Row]) -> str:
    """The comparable figures one by one: the paper's, ours, and ours over the paper's."""
    titles = ["paper", "model", "mode", "system", "quantity", "paper's", "measured", "÷ paper's", "raw"]
    lines = [joined(titles), "|---" * len(titles) + "|"]
    for item in (item for item in comparisons(rows) if item["comparable"]):
        quantity = QUANTITIES[item["quantity"]]
        names = [item["table"], item["model"], item["mode"], f"{item['system']} {item['ablation']}".strip()]
        numbers = [quantity.text(item["paper"]), quantity.text(item["measured"])]
        ratio = f"{item['measured'] / item['paper']:.2f}"
        raw = ", ".join(f"{quantity.text(value)} {reading}".replace("_", " ") for reading, value in item["raw"].items())
        lines.append(joined([*names, quantity.heading, *numbers, ratio, raw]))
    whole = "\n".join(lines) if len(lines) > 2 else "None: no run that is done has a figure in the paper's tables."
    return f"## Figure by figure, where definitions agree\n\n{whole}"


def notes() -> str:
    """What every column means, on both sides, and what is odd in the paper's tables."""
    lines = [f"- **{QUANTITIES[name].heading}** {QUANTITIES[name].definition}" for name in COLUMNS]
    lines.append("- The paper's meshes may differ from those of the same name here: it gives no number of faces.")
    lines += [f"- {entry['name']}: {remark}" for entry in load_tables() for remark in entry["remarks"]]
    return "## What the columns mean\n\n" + "\n".join(lines)


def not_run(rows: list[Row]) -> str:
    """How many figures of each of the paper's tables have one beside them, and why the others have none."""
    lines = [joined(["table", "figures", "measured here", "not run"]), "|---|---|---|---|"]
    for name, reasons in coverage(load_figures(), rows).items():
        why = "; ".join(f"{count}: {reason}" for reason, count in reasons.items() if reason)
        lines.append(joined([name, str(reasons.total()), str(reasons[""]), why]))
    return "## The paper's figures: which were run\n\n" + "\n".join(lines)


def joined(cells: list[str]) -> str:
    """One line of a Markdown table."""
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"

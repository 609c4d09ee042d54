"""Rows of a corpus run as Markdown: the table, the summary, missed bars, and before beside after.

A row is what `__main__` writes as one line of JSON: file, tool ("flexpara" or a peer), status, seconds, peak_mb, and,
where something was written, the metrics of `judge`.  status: "ok" · "refused" (exit code 2) · "exit N" · "timeout" ·
"unjudged" (files were written that cannot be measured).
A bar is a text such as "stretch<=1.1"; a row misses it where the column is absent or the comparison is false.
"""

from __future__ import annotations

import json
import math
import operator
import re
from fnmatch import fnmatch
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

Row = dict[str, Any]

COLUMNS = {
    "file": "{}", "tool": "{}", "status": "{}", "seconds": "{:.1f}", "cpu_seconds": "{:.1f}", "peak_mb": "{:.0f}",
    "faces": "{}", "area": "{:.4f}", "parts": "{}", "charts": "{}", "charts_per_part": "{:.2f}", "stretch": "{:.4f}",
    "stretch_p95": "{:.4f}", "worst_chart": "{:.4f}", "flips": "{}", "degenerate": "{}", "overlap": "{:.1e}",
    "seam": "{:.2f}", "objective": "{:.4f}", "packing": "{:.3f}", "rms_texels": "{:.2f}", "agreement": "{:.4f}",
    "said": "{}",
}  # fmt: skip
VALID = ("collapsed<=0", "flips<=0", "degenerate<=0", "overlap<=0", "outside<=0")
"""What makes a written layout valid; `outside` is not asked of peers, whose uv are in texels."""
COMPARE = {"<=": operator.le, ">=": operator.ge, "<": operator.lt, ">": operator.gt, "==": operator.eq}
BAR = re.compile(r"([a-z_0-9]+)(<=|>=|==|<|>)([-+.e0-9]+)")


def missed(row: Row, bars: Iterable[str]) -> list[str]:
    """The bars that a row misses, with the value found.  Raises: ValueError for a bar that cannot be read."""
    found = []
    for bar in bars:
        match = BAR.fullmatch(bar)
        if match is None:
            raise ValueError(f"bar {bar!r} cannot be read, expected for instance stretch<=1.1")
        name, comparison, number = match.groups()
        value = row.get(name)
        if value is None or not COMPARE[comparison](value, float(number)):
            found.append(f"{bar} (is {'absent' if value is None else f'{value:.6g}'})")
    return found


def is_valid(row: Row) -> bool:
    """Whether the row ended with files that are a valid layout in every format written."""
    return row["status"] == "ok" and not missed(row, VALID[:-1] if row["tool"] != "flexpara" else VALID)


def violations(rows: Iterable[Row], bars: Iterable[str], own: dict[str, list[str]] | None = None) -> list[str]:
    """One line for each of flexpara's rows that is not valid or misses a bar; refusals are left to the reader.

    bars: asked of every file.  own: pattern of a file's path → further bars for it.
    """
    lines, bars = [], list(bars)
    for row in rows:
        if row["tool"] != "flexpara":
            continue
        asked = [bar for pattern, more in (own or {}).items() if fnmatch(row["file"], f"*{pattern}") for bar in more]
        if row["status"] == "refused" and not asked:
            continue
        if row["status"] != "ok":
            lines.append(f"{row['file']}: {row['status']} {row['said']}".rstrip())
        elif fails := missed(row, [*VALID, *bars, *asked]):
            lines.append(f"{row['file']}: {', '.join(fails)}")
    return lines


def line(row: Row) -> str:
    """One line of the table; a column that a row has not is empty."""
    cells = (form.format(row[name]) if row.get(name) is not None else "" for name, form in COLUMNS.items())
    return "| " + " | ".join(cell.replace("|", "/") for cell in cells) + " |"


def header() -> str:
    """The first two lines of the table."""
    return f"| {' | '.join(COLUMNS)} |\n|{'---|' * len(COLUMNS)}"


def summary(rows: Iterable[Row], usable_stretch: float = 1.1) -> list[str]:
    """One line a tool: how many files ended well, are valid and usable, and their means and worst."""
    tools: dict[str, list[Row]] = {}
    for row in rows:
        tools.setdefault(row["tool"], []).append(row)
    return [_summary(tool, found, usable_stretch) for tool, found in tools.items()]


def _summary(tool: str, rows: list[Row], usable_stretch: float) -> str:
    done, valid = [row for row in rows if row["status"] == "ok"], [row for row in rows if is_valid(row)]
    refused, late = (sum(row["status"] == status for row in rows) for status in ("refused", "timeout"))
    usable = sum(row["stretch"] <= usable_stretch for row in valid)
    text = f"{tool}: {len(rows)} files · exit 0 {len(done)} · refused {refused} · out of time {late} · "
    text += f"valid {len(valid)} · usable (valid, stretch ≤ {usable_stretch}) {usable}"
    if done:
        worst = max(done, key=lambda row: row["stretch"])
        slow = max(rows, key=lambda row: row["seconds"])
        text += f" · stretch mean {_mean(done, 'stretch'):.4f} worst {worst['stretch']:.4f} ({worst['file']})"
        text += f" · objective mean {_mean(done, 'objective'):.4f}"
        text += f" · seconds mean {_mean(rows, 'seconds'):.1f} worst {slow['seconds']:.1f} ({slow['file']})"
    return text


def _mean(rows: list[Row], name: str) -> float:
    return sum(row[name] for row in rows) / len(rows)


def compare(before: Iterable[Row], after: Iterable[Row]) -> list[str]:
    """Markdown lines: each file of both runs, before → after, ratios after / before; then a line of totals.

    The objective's ratio is of objective + 1e-4, so that an exact result does not divide by zero.
    """
    old = {(row["file"], row["tool"]): row for row in before}
    pairs = [(old[key], row) for row in after if (key := (row["file"], row["tool"])) in old]
    lines = ["| file | tool | status | charts | stretch | seam | objective | ratio | seconds |", f"|{'---|' * 9}"]
    ratios = []
    for was, now in pairs:
        ratio = None
        if was["status"] == now["status"] == "ok":
            ratio = (now["objective"] + 1e-4) / (was["objective"] + 1e-4)
            ratios.append(ratio)
        cells = [now["file"], now["tool"], _change(was, now, "status", "{}"), _change(was, now, "charts", "{}")]
        cells += [_change(was, now, name, "{:.4f}") for name in ("stretch", "seam", "objective")]
        cells += ["" if ratio is None else f"{ratio:.3f}", _change(was, now, "seconds", "{:.1f}")]
        lines.append(f"| {' | '.join(cells)} |")
    gained, lost = (
        sum(is_valid(b) and not is_valid(a) for a, b in (pair if forward else pair[::-1] for pair in pairs))
        for forward in (True, False)
    )
    mean = math.exp(sum(map(math.log, ratios)) / len(ratios)) if ratios else math.nan
    lines.append(
        f"\n{len(pairs)} rows in both · objective ratio {mean:.4f} (geometric mean of {len(ratios)}) · "
        f"better {sum(ratio < 0.999 for ratio in ratios)}, worse {sum(ratio > 1.001 for ratio in ratios)} · "
        f"newly valid {gained}, no longer valid {lost}"
    )
    return lines


def _change(was: Row, now: Row, name: str, form: str) -> str:
    old, new = ("" if row.get(name) is None else form.format(row[name]) for row in (was, now))
    return new if old == new else f"{old} → {new}"


def read_rows(path: Path) -> list[Row]:
    """Rows of `results.jsonl`, the last of each file and tool; a line cut short by an interruption is left out."""
    rows: dict[tuple[str, str], Row] = {}
    if path.is_file():
        for text in path.read_text(encoding="utf-8").splitlines(keepends=True):
            if text.endswith("\n"):
                row = json.loads(text)
                rows[row["file"], row["tool"]] = row
    return list(rows.values())

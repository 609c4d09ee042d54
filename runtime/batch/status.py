"""How far a batch is: counts, rate, time left, the worst by distortion and by time; and a page of thumbnails."""

from __future__ import annotations

import json
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING
from urllib.parse import quote

from ..errors import InputError, MissingFileError
from ..files import replace_file
from .manifest import Entry, all_entries

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from .jobs import Job

PLAN = "batch.json"
PAGE = "index.html"
WORST = 10
DISTORTION = "symmetric_dirichlet_mean"


@dataclass(frozen=True)
class Status:
    """total: assets of the batch, all shards together where each has begun.  entries: of those that ended."""

    total: int
    entries: list[Entry]

    @property
    def done(self) -> list[Entry]:
        """Those that gave an atlas."""
        return [entry for entry in self.entries if entry.status == "done"]

    @property
    def rate(self) -> float:
        """Assets an hour, over the longest run so far; 0 where nothing ended yet."""
        longest = max((entry.elapsed for entry in self.entries), default=0.0)
        in_it = [entry for entry in self.entries if entry.elapsed > 0.0]
        return 3600.0 * len(in_it) / longest if longest > 0.0 else 0.0

    def worst(self, of: str) -> list[Entry]:
        """The ten of most "seconds", or of most distortion."""

        def size(entry: Entry) -> float:
            return entry.seconds if of == "seconds" else float(entry.metrics.get(of) or 0.0)

        return sorted(self.done, key=size, reverse=True)[:WORST]

    def lines(self) -> list[str]:
        """What a person reads."""
        failed = [entry for entry in self.entries if entry.status == "failed"]
        left = max(self.total - len(self.entries), 0)
        counts = {"assets": self.total, "done": len(self.done), "failed": len(failed), "left": left}
        found = [f"{name:<9} {count}" for name, count in counts.items()]
        if self.rate:
            found += [f"rate      {self.rate:.0f} an hour", f"time left {left / self.rate:.2f} h"]
        for title, of in (("most stretched", DISTORTION), ("slowest", "seconds")):
            found.append(f"{title}:")
            found += [
                f"  {entry.metrics.get(DISTORTION) or 0.0:.4f}  {entry.seconds:7.1f} s  {entry.asset}"
                for entry in self.worst(of)
            ]
        return [*found, *(["failed:"] if failed else []), *(f"  {entry.asset}: {entry.error}" for entry in failed)]


def write_plan(output: Path, mark: str, jobs: Sequence[Job]) -> None:
    """Write down which assets a batch, or a share of it, has."""
    plan = {"assets": len(jobs), "names": [job.name for job in jobs]}
    replace_file(output / f"{mark.lstrip('-')}{PLAN}", json.dumps(plan, ensure_ascii=False).encode())


def status_of(output: Path) -> Status:
    """The status of a batch's folder, all shards together: of what is an asset by now.

    Raises: MissingFileError where there is none.
    """
    plans = sorted(output.glob(f"*{PLAN}"))
    if not plans:
        raise MissingFileError(f"{output} holds no {PLAN}, expected the -o of flexpara batch; correct the path")
    read, entries = [_plan(path) for path in plans], all_entries(output)
    if any(names is None for _, names in read):  # written by 0.1.0 as it began
        return Status(sum(total for total, _ in read), [entries[name] for name in sorted(entries)])
    known = {name for _, names in read for name in names or ()}
    return Status(len(known), [entries[name] for name in sorted(known & set(entries))])


def _plan(path: Path) -> tuple[int, list[str] | None]:
    """How many assets, and which; None where the plan does not say."""
    try:
        plan = json.loads(path.read_bytes())
        names = plan.get("names")
        return int(plan["assets"]), None if names is None else [str(name) for name in names]
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise InputError(f"{path} is damaged ({error}), expected what flexpara wrote; run the batch again") from error


def write_page(output: Path, status: Status) -> Path:
    """The page of thumbnails, sortable by its heads, whole or not at all; it needs no network."""
    replace_file(output / PAGE, page_of(output, status).encode())
    return output / PAGE


def page_of(output: Path, status: Status) -> str:
    """The text of the page."""
    heads = ("", "asset", "status", "charts", "stretch", "seam", "packing", "seconds", "MB", "error")
    head = "".join(f'<th scope="col"><button>{name}</button></th>' if name else "<th></th>" for name in heads)
    rows = "\n".join(_row(output, entry) for entry in status.entries)
    counted = f"{len(status.done)} of {status.total} done"
    return TEMPLATE.replace("@COUNTED@", counted).replace("@HEAD@", head).replace("@ROWS@", rows)


def _row(output: Path, entry: Entry) -> str:
    picture = next((name for name in entry.files if name.endswith(".preview.png")), None)
    shown = picture is not None and (output / entry.folder / picture).exists()
    image = f'<img src="{quote(f"{entry.folder}/{picture}")}" alt="" loading="lazy">' if shown else ""
    link = f'<a href="{quote(entry.folder)}/">{escape(entry.asset)}</a>'
    named = link if entry.status == "done" else escape(entry.asset)
    numbers: Sequence[tuple[object, str]] = [
        (entry.metrics.get("charts"), "{}"),
        (entry.metrics.get(DISTORTION), "{:.4f}"),
        (entry.metrics.get("seam_length"), "{:.2f}"),
        (entry.metrics.get("packing_efficiency"), "{:.1%}"),
        (entry.seconds, "{:.1f}"),
        (entry.memory / 1e6, "{:.0f}"),
    ]
    cells = "".join(
        f'<td data-value="{value if value is not None else -1}">{form.format(value) if value is not None else ""}</td>'
        for value, form in numbers
    )
    return (
        f"<tr><td>{image}</td><td>{named}</td><td>{escape(entry.status)}</td>{cells}<td>{escape(entry.error)}</td></tr>"
    )


TEMPLATE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="generator" content="flexpara batch">
<title>flexpara batch: @COUNTED@</title>
<style>
:root{color-scheme:light dark}
body{font:14px system-ui,sans-serif;margin:1.5em}
table{border-collapse:collapse}
td,th{padding:.3em .7em;text-align:left;border-bottom:1px solid #8884;vertical-align:middle}
td:nth-child(2){max-width:28em;overflow-wrap:anywhere}
td:last-child{max-width:36em;overflow-wrap:anywhere}
td[data-value]{text-align:right;font-variant-numeric:tabular-nums}
th button{font:inherit;font-weight:bold;background:none;border:0;padding:0;cursor:pointer;color:inherit}
th:nth-child(n+4):nth-child(-n+9){text-align:right}
th[aria-sort=ascending] button::after{content:" ▲"}
th[aria-sort=descending] button::after{content:" ▼"}
img{height:72px;display:block}
</style></head><body>
<h1>@COUNTED@</h1>
<table><thead><tr>@HEAD@</tr></thead><tbody>
@ROWS@
</tbody></table>
<script>
const body = document.querySelector("tbody");
const key = (row, at) => {
  const cell = row.cells[at];
  return cell.dataset.value === undefined ? cell.textContent : Number(cell.dataset.value);
};
document.querySelectorAll("th").forEach((head, at) => head.querySelector("button")?.addEventListener("click", () => {
  const down = head.getAttribute("aria-sort") !== "descending";
  document.querySelectorAll("th").forEach(other => other.removeAttribute("aria-sort"));
  head.setAttribute("aria-sort", down ? "descending" : "ascending");
  const sorted = [...body.rows].sort((a, b) => key(a, at) < key(b, at) ? -1 : key(a, at) > key(b, at) ? 1 : 0);
  body.replaceChildren(...(down ? sorted.reverse() : sorted));
}));
</script></body></html>
"""

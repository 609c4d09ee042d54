"""What became of each asset: a line of JSON for each as it ends, the last line of an asset being what holds.

A line is one write that reaches the disk before the next asset counts as done.  A process that is killed leaves at most
one broken line, the last, which is read over.
"""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass, field
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from ..files import disk_full_is_said

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from .jobs import Job

FORMAT = "flexpara-batch-1"
LARGEST_LINE = 1 << 20


LARGEST_NUMBER = 1e300
KINDS = dict.fromkeys(("asset", "status", "content", "asked", "folder", "error"), "text")
KINDS |= dict.fromkeys(("seconds", "memory", "elapsed"), "number")
KINDS |= {"stages": "table of number", "metrics": "table of measure"}
KINDS |= {"files": "table of text", "notes": "list of text", "again": "flag"}
"""What each field holds."""


@dataclass(frozen=True)
class Entry:
    """One asset that ended.

    status: "done" or "failed".  content, asked: fingerprints of its file and its options.  seconds: of the whole asset;
    stages: of each.  memory: peak of the process, bytes.  metrics: from its report.  files: sha256 of each, by name.
    elapsed: seconds since its run of the batch began.
    again: what it failed by may pass, the death of a worker or a full disk.
    """

    asset: str
    status: str
    content: str
    asked: str
    folder: str
    seconds: float = 0.0
    stages: dict[str, float] = field(default_factory=dict)
    memory: int = 0
    metrics: dict[str, Any] = field(default_factory=dict)
    files: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    error: str = ""
    elapsed: float = 0.0
    again: bool = False
    format: str = FORMAT


def read_entries(path: Path) -> dict[str, Entry]:
    """The last entry of each asset, by name; none where there is no file.

    Raises: InputError for a line, other than a broken last one, that flexpara did not write.
    """
    found: dict[str, Entry] = {}
    if not path.is_file():
        return found
    lines = path.read_bytes().split(b"\n")
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            entry = entry_of(json.loads(line))
        except (ValueError, TypeError, RecursionError) as error:
            if number == len(lines):  # cut short by a kill
                continue
            raise InputError(
                f"{path}, line {number}: {error}, expected a line of flexpara batch; choose another -o, or move it away"
            ) from error
        found[entry.asset] = entry
    return found


def all_entries(output: Path, own: Path | None = None) -> dict[str, Entry]:
    """The entries of all manifests of a batch's folder, as shards leave them; where they differ, those of ``own`` hold.

    Raises: InputError as `read_entries`.
    """
    paths = sorted(output.glob("manifest*.jsonl"), key=lambda path: (path == own, path.name))
    return {name: entry for path in paths for name, entry in read_entries(path).items()}


def entry_of(facts: dict[str, Any]) -> Entry:
    """The entry of a line: it may come from anyone.  Raises: ValueError, TypeError where flexpara did not write it."""
    entry = Entry(**facts)
    if entry.format != FORMAT:
        raise ValueError(f"format {str(entry.format)[:60]!r}")
    for name, kind in KINDS.items():
        if not fits(getattr(entry, name), kind):
            raise ValueError(f"{name} is {str(getattr(entry, name))[:60]!r}")
    if any(part in ("..", "/") for part in (*PurePath(entry.folder).parts, *entry.files)):
        raise ValueError(f"folder {entry.folder[:60]!r} leads elsewhere")
    return entry


def fits(value: object, kind: str) -> bool:
    """Whether a value of JSON is a "number", a "measure" (null for none), a "text", a "flag", or several of those."""
    if kind.startswith("table of "):
        return isinstance(value, dict) and all(fits(each, kind[9:]) for each in value.values())
    if kind.startswith("list of "):
        return isinstance(value, list) and all(fits(each, kind[8:]) for each in value)
    if kind in ("number", "measure"):
        if isinstance(value, int | float) and not isinstance(value, bool):
            return abs(value) < LARGEST_NUMBER
        return value is None and kind == "measure"
    if kind == "text":
        return isinstance(value, str) and value == value.encode("utf-8", "replace").decode()
    return isinstance(value, bool)


def append(path: Path, entry: Entry) -> None:
    """Add a line, on the disk when this returns; what a kill left of a last line is ended first.

    Raises: DiskFullError; OSError for what else keeps it from being written.
    """
    line = json.dumps(asdict(entry), ensure_ascii=False, allow_nan=False).encode() + b"\n"
    with disk_full_is_said(path.parent), path.open("ab+") as file:
        if file.tell() and not _ends_whole(file.fileno(), file.tell()):
            _cut_last_line(file.fileno(), file.tell())
        file.seek(0, os.SEEK_END)
        file.write(line)
        file.flush()
        os.fsync(file.fileno())


def _ends_whole(number: int, size: int) -> bool:
    return os.pread(number, 1, size - 1) == b"\n"


def _cut_last_line(number: int, size: int) -> None:
    start = max(size - LARGEST_LINE, 0)
    kept = os.pread(number, size - start, start).rfind(b"\n")
    os.ftruncate(number, start + kept + 1)


def _is_there(job: Job, entry: Entry) -> bool:
    return all((job.run.output / name).is_file() for name in entry.files)


def left_to_do(jobs: Iterable[Job], entries: dict[str, Entry], version: str, *, retry: bool) -> list[Job]:
    """Jobs that have no entry, that failed (by a death, or if ``retry``), that changed, or whose files are gone."""
    left = []
    for job in jobs:
        entry = entries.get(job.name)
        same = entry is not None and entry.asked == job.asked(version) and entry.content == job.content()
        failed = entry is not None and (entry.again or (entry.status == "failed" and retry))
        if entry is None or not same or failed or not _is_there(job, entry):
            left.append(job)
    return left

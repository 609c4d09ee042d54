"""The assets of a batch: found in folders or listed, each with its options and an output folder of its own."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..cli.inputs import ENDINGS
from ..cli.runfile import Run
from ..errors import InputError, MissingFileError
from ..files import written_in
from ..options.keywords import from_keywords
from ..options.unwrap import Options, Outputs
from .beside import Beside, folders_of, rebased

if TYPE_CHECKING:
    from collections.abc import Iterable

LISTS = (".jsonl",)
LARGEST_LINE = 1 << 16
"""Bytes of a line of a list."""


@dataclass(frozen=True)
class Job:
    """One asset.  name: its path below the batch, by which its line in the manifest is found.

    beside: the files that its options name.  problem: why it can't be begun, where it can't.
    """

    name: str
    run: Run
    beside: tuple[Path, ...] = ()
    problem: str = ""

    def asked(self, version: str) -> str:
        """A fingerprint of the options and the version: what is done again where they change."""
        run, facts = self.run, {"version": version}
        facts |= {"options": asdict(run.options), "outputs": asdict(run.outputs)}
        facts |= ({"strict": True} if run.strict else {}) | ({"problem": self.problem} if self.problem else {})
        return hashlib.sha256(json.dumps(facts, sort_keys=True, default=_named).encode()).hexdigest()[:16]

    def content(self) -> str:
        """A fingerprint of the file, and of those that its options name; empty where it can't be read."""
        prints = [_content(path) for path in (self.run.mesh, *self.beside)]
        return prints[0] if len(prints) == 1 else hashlib.sha256("".join(prints).encode()).hexdigest()


def _content(path: Path) -> str:
    """A fingerprint of a file; empty where it can't be read, or is a device that has no end."""
    try:
        if not path.is_file():
            return ""
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except (OSError, ValueError):  # a name that no file can have
        return ""


def _named(path: Path) -> str:
    """A file that an option names, wherever it lies."""
    return path.name


Noted = Callable[[str], object]


def find_jobs(
    assets: Iterable[Path], output: Path, options: Options, outputs: Outputs, note: Noted = lambda _line: None
) -> list[Job]:
    """The assets of folders (and those in them), lists and single files, in the order of their names.

    Results of flexpara in the folders that are searched are no assets: those in the output folder, and those that a
    report beside them lists.  Nor are files that options name for others, as --high does.

    Args:
        assets: folders, meshes, or .jsonl lists of a JSON object a line: {"file": …, "options": {…}}, files relative to
            the list.
        output: the folder for all; each asset gets one of its own in it.
        options: of each, where a list says nothing else; files in them by name or pattern, see beside.py.
        outputs: likewise.
        note: called with a line where results were passed over.

    Raises: MissingFileError for what is not there or holds no mesh; InputError for a damaged list.
    """
    found: dict[Path, tuple[str, Options, Outputs]] = {}
    searched = [path.absolute() for path in assets if path.is_dir()]
    for path in assets:
        if path.suffix in LISTS:
            found |= _listed(path, options, outputs)
        else:
            found |= {mesh: (name, options, outputs) for mesh, name in _found(path, output.absolute(), note).items()}
    named = [
        folder for folder in folders_of((options, outputs)) if not any(_holds(folder, place) for place in searched)
    ]
    beside, jobs = Beside(), list[Job]()
    for path, (name, own_options, own_outputs) in found.items():
        run = Run(path, output.absolute(), own_options, own_outputs)
        jobs.append(_with_files(Job(printable(name), run), beside, name))
    jobs = _without_taken(jobs, searched, named, note)
    stems = Counter(_stem(job) for job in jobs)
    placed = [_placed(job, several=stems[_stem(job)] > 1) for job in jobs]
    return sorted(placed, key=lambda job: job.name)


def _stem(job: Job) -> str:
    return str(Path(job.name).with_suffix(""))


def _placed(job: Job, *, several: bool) -> Job:
    """The job with a folder of its own below the output; several: assets differ by their endings alone."""
    return replace(job, run=replace(job.run, output=job.run.output / (job.name if several else _stem(job))))


def _with_files(job: Job, beside: Beside, name: str) -> Job:
    """The job with the files that its options name, or the reason why it has none."""
    run = job.run
    try:
        options, some = beside.chosen(run.options, run.mesh, name)
        outputs, more = beside.chosen(run.outputs, run.mesh, name)
    except (MissingFileError, InputError) as error:
        return replace(job, problem=str(error))
    return replace(job, run=replace(run, options=options, outputs=outputs), beside=(*some, *more))


def _without_taken(jobs: list[Job], searched: list[Path], named: list[Path], note: Noted) -> list[Job]:
    """Without what lies in the folders searched for others: taken by their options, or in folders that those name."""
    taken = {path for job in jobs for path in job.beside}

    def is_asset(path: Path) -> bool:
        for_others = path in taken or any(_holds(folder, path) for folder in named)
        return not (for_others and any(_holds(folder, path) for folder in searched))

    left = [job for job in jobs if is_asset(job.run.mesh)]
    if len(left) < len(jobs):
        note(f"{len(jobs) - len(left)} meshes are there for others, by the options given, and passed over")
    return left


def _holds(folder: Path, path: Path) -> bool:
    return folder == path or folder in path.parents


def printable(name: str) -> str:
    """A name as a terminal, a page and the manifest can show it: what controls those, or is no text, is spelled out."""
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in name)


def _found(path: Path, output: Path, note: Noted) -> dict[Path, str]:
    """The meshes of a folder, or a single one, each with its name below the batch."""
    if not path.exists():
        raise MissingFileError(f"{path} is not there, expected a folder, a mesh or a .jsonl list; correct the path")
    if path.is_file():
        return {path.absolute(): path.name}
    files = [file for file in path.rglob("*") if file.suffix.lower() in ENDINGS and file.is_file()]
    files = sorted(file for file in files if output not in file.absolute().parents)
    results = {folder: written_in(folder) for folder in {file.parent for file in files}}
    sources = [file for file in files if file.name not in results[file.parent]]
    if len(sources) < len(files):
        count = len(files) - len(sources)
        note(f"{path}: {count} meshes are results of flexpara by the reports beside them, and passed over")
    if not sources:
        found = "no mesh but results of flexpara" if files else "no mesh"
        raise MissingFileError(f"{path} holds {found}, expected files such as {', '.join(ENDINGS)}; name a folder")
    return {file.absolute(): file.relative_to(path).as_posix() for file in sources}


def _listed(path: Path, options: Options, outputs: Outputs) -> dict[Path, tuple[str, Options, Outputs]]:
    if not path.is_file():
        raise MissingFileError(f"{path} is not there, expected a list of assets; correct the path")
    found = {}
    with path.open("rb") as file:
        for number, line in enumerate(iter(lambda: file.readline(LARGEST_LINE), b""), 1):
            if line.strip():
                name, own = _entry(line, f"{path}, line {number}")
                mesh = (path.parent / name).absolute()
                below = Path(name).is_absolute() or ".." in Path(name).parts
                chosen = _with(own, options, outputs, path.parent)
                found[mesh] = (mesh.name if below else Path(name).as_posix(), *chosen)
    return found


def _entry(line: bytes, place: str) -> tuple[str, dict[str, Any]]:
    expected = 'expected {"file": NAME, "options": {…}}; correct the line'
    try:
        entry = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{place} is no JSON ({error}), {expected}") from error
    if not isinstance(entry, dict) or not isinstance(entry.get("file"), str) or not entry["file"]:
        raise InputError(f"{place} names no file, {expected}")
    own = entry.get("options", {})
    if not isinstance(own, dict):
        raise InputError(f"{place} has options that are no object, {expected}")
    return entry["file"], own


def _with(own: dict[str, Any], options: Options, outputs: Outputs, folder: Path) -> tuple[Options, Outputs]:
    """The options of a line; files in them count from the folder of the list."""
    of_outputs = {field.name for field in fields(Outputs)}
    files = {name: value for name, value in own.items() if name in of_outputs}
    rest = {name: value for name, value in own.items() if name not in of_outputs}
    options, outputs = from_keywords(Options, options, rest), from_keywords(Outputs, outputs, files)
    return rebased(options, rest, folder), rebased(outputs, files, folder)


def shard(jobs: list[Job], share: tuple[int, int]) -> list[Job]:
    """Every M-th job from the N-th on, for share (N, M)."""
    return jobs[share[0] - 1 :: share[1]]

"""The assets of a batch: found in folders or listed, each with its options and an output folder of its own."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..cli.inputs import ENDINGS
from ..cli.runfile import Run
from ..errors import InputError, MissingFileError
from ..files import results_in
from ..options.keywords import from_keywords
from ..options.unwrap import Options, Outputs

if TYPE_CHECKING:
    from collections.abc import Iterable

LISTS = (".jsonl",)
LARGEST_LINE = 1 << 16
"""Bytes of a line of a list."""


@dataclass(frozen=True)
class Job:
    """One asset.  name: its path below the batch, by which its line in the manifest is found."""

    name: str
    run: Run

    def asked(self, version: str) -> str:
        """A fingerprint of the options and the version: what is done again where they change."""
        facts = {"version": version, "options": asdict(self.run.options), "outputs": asdict(self.run.outputs)}
        return hashlib.sha256(json.dumps(facts, sort_keys=True, default=str).encode()).hexdigest()[:16]

    def content(self) -> str:
        """A fingerprint of the file; empty where it can't be read, or is a device that has no end."""
        try:
            if not self.run.mesh.is_file():
                return ""
            with self.run.mesh.open("rb") as file:
                return hashlib.file_digest(file, "sha256").hexdigest()
        except (OSError, ValueError):  # a name that no file can have
            return ""


Noted = Callable[[str], object]


def find_jobs(
    assets: Iterable[Path], output: Path, options: Options, outputs: Outputs, note: Noted = lambda _line: None
) -> list[Job]:
    """The assets of folders (and those in them), lists and single files, in the order of their names.

    Results of flexpara in the folders that are searched are no assets: those in the output folder, and those that a
    report beside them lists.

    Args:
        assets: folders, meshes, or .jsonl lists of a JSON object a line: {"file": …, "options": {…}}, files relative to
            the list.
        output: the folder for all; each asset gets one of its own in it.
        options: of each, where a list says nothing else.
        outputs: likewise.
        note: called with a line where results were passed over.

    Raises: MissingFileError for what is not there or holds no mesh; InputError for a damaged list.
    """
    found: dict[Path, tuple[str, Options, Outputs]] = {}
    for path in assets:
        if path.suffix in LISTS:
            found |= _listed(path, options, outputs)
        else:
            found |= {mesh: (name, options, outputs) for mesh, name in _found(path, output.absolute(), note).items()}
    found = {path: (printable(entry[0]), entry[1], entry[2]) for path, entry in found.items()}
    stems = Counter(str(Path(name).with_suffix("")) for name, _, _ in found.values())
    jobs = []
    for path, (name, own_options, own_outputs) in found.items():
        stem = str(Path(name).with_suffix(""))
        folder = output.absolute() / (stem if stems[stem] == 1 else name)
        jobs.append(Job(name, Run(path, folder, own_options, own_outputs)))
    return sorted(jobs, key=lambda job: job.name)


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
    results = {folder: results_in(folder) for folder in {file.parent for file in files}}
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
                found[mesh] = (mesh.name if below else Path(name).as_posix(), *_with(own, options, outputs))
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


def _with(own: dict[str, Any], options: Options, outputs: Outputs) -> tuple[Options, Outputs]:
    of_outputs = {field.name for field in fields(Outputs)}
    files = {name: value for name, value in own.items() if name in of_outputs}
    rest = {name: value for name, value in own.items() if name not in of_outputs}
    return from_keywords(Options, options, rest), from_keywords(Outputs, outputs, files)


def shard(jobs: list[Job], share: tuple[int, int]) -> list[Job]:
    """Every M-th job from the N-th on, for share (N, M)."""
    return jobs[share[0] - 1 :: share[1]]

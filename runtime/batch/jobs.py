"""The jobs of a batch: each asset with its options, the files that those name, and an output folder of its own."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from ..cli.runfile import Run
from ..errors import InputError, MissingFileError
from ..io.companions import companions
from ..options.unwrap import Options, Outputs
from .assets import assets_of
from .beside import Beside, folders_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .assets import Noted


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

    @property
    def size(self) -> int:
        """Bytes of the file, by which it is guessed how long it takes; 0 where it can't be read."""
        try:
            return self.run.mesh.stat().st_size
        except (OSError, ValueError):
            return 0

    def content(self) -> str:
        """A fingerprint of the file, of those it names, and of those that its options name; empty for one not read."""
        mesh = self.run.mesh
        prints = [_content(path) for path in (mesh, *companions(mesh))]
        prints += [_content_once(file) for path in self.beside for file in (path, *companions(path))]
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


def _content_once(path: Path) -> str:
    """The same of a file that many assets may share: read again where its size or its time has changed."""
    try:
        facts = path.stat()
    except (OSError, ValueError):
        return ""
    return _known_content(path, facts.st_size, facts.st_mtime_ns)


@lru_cache(maxsize=1024)
def _known_content(path: Path, _size: int, _time: int) -> str:
    return _content(path)


def _named(path: Path) -> str:
    """A file that an option names, wherever it lies."""
    return path.name


def find_jobs(
    assets: Sequence[Path], output: Path, options: Options, outputs: Outputs, note: Noted = lambda _line: None
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
    searched = [path.absolute() for path in assets if path.is_dir()]
    named = [
        folder for folder in folders_of((options, outputs)) if not any(_holds(folder, place) for place in searched)
    ]
    beside, jobs = Beside(), list[Job]()
    for asset in assets_of(assets, output, options, outputs, note):
        run = Run(asset.mesh, output.absolute(), asset.options, asset.outputs)
        jobs.append(_with_files(Job(printable(asset.name), run), beside, asset.name))
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


def shard(jobs: list[Job], share: tuple[int, int]) -> list[Job]:
    """Every M-th job from the N-th on, for share (N, M)."""
    return jobs[share[0] - 1 :: share[1]]

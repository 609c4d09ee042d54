"""Whole files or none, and never over a foreign file.

Files are written into a hidden folder beside their destination and moved there together at the end; an error or Ctrl-C
leaves the destination as it was.  A report `<stem>.report.json` lists the files that flexpara wrote: those, and no
others, may be replaced without `force`.
"""

from __future__ import annotations

import errno
import json
import os
import shutil
import tempfile
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Self

from .errors import DiskFullError, ForeignFileError, InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from .mesh import Report

PRODUCER = "flexpara"
STAGING = ".flexpara-"
"""Beginning of the names of hidden folders."""
LARGEST_REPORT = 64 << 20
"""Bytes beyond which a JSON file is no report."""
LONGEST = 220
"""Bytes of a stem: names of files have 255 on most disks, and those of results are longer than it."""
JOURNAL = ".flexpara.json"
"""Ending of the name of a hidden file that lists what is being moved."""


class OutputFolder:
    """Collects the files of one run; `commit` makes them appear, leaving the block without it discards them.

    A context manager::

        with OutputFolder(folder, "bunny") as output:
            output.check(["bunny.glb", "bunny.onnx"])   # early: before hours of work
            ...
            output.write("bunny.glb", write_glb)
            output.write_report(report)
            output.commit()
    """

    def __init__(
        self,
        folder: Path,
        stem: str,
        *,
        force: bool = False,
        source: Path | None = None,
        report: str | None = None,
    ) -> None:
        """Prepare; nothing is created or tried yet.

        Args:
            folder: where files go; made when absent.
            stem: base name; the report is `<stem>.report.json`, and reports of this stem list what may be replaced.
            force: replace foreign files too.
            source: the input file, which is never replaced, even with force.
            report: another name for the report (must be `<stem>.<something>.json`).

        Raises:
            InputError: the folder is a file, or a name is too long or no plain file name.
        """
        self.folder, self.stem, self.force, self.source = folder, stem, force, source
        self.report_name = report or f"{stem}.report.json"
        _plain(self.report_name)
        if len(os.fsencode(stem)) > LONGEST:
            found = f"{stem[:20]}… has a name of {len(os.fsencode(stem))} bytes"
            raise InputError(f"{found}, expected at most {LONGEST}, as names of results are longer; rename the input")
        for part in (folder, *folder.parents):
            if part.exists() and not part.is_dir():
                raise InputError(f"{part} is a file, expected a folder for the output; choose another -o")
        self._own = _owned(folder, stem)
        self._staging: Path | None = None
        self._made = tuple(part for part in (folder, *folder.parents) if not part.exists())
        self._entered = False

    def __enter__(self) -> Self:
        """Try the folder, so that what can't be written to is known before the work.

        Raises: InputError.
        """
        self._entered = True
        self._stage()
        self._empty()
        return self

    def __exit__(self, *_: object) -> None:
        self._discard()

    @property
    def names(self) -> tuple[str, ...]:
        """The files written so far, sorted."""
        return () if self._staging is None else tuple(sorted(entry.name for entry in self._staging.iterdir()))

    @property
    def kept(self) -> tuple[str, ...]:
        """Files of earlier runs that this one doesn't write, sorted."""
        return tuple(sorted(name for name in self._own if name not in self.names and (self.folder / name).is_file()))

    def check(self, names: Iterable[str]) -> None:
        """Refuse names that may not be written.

        Raises:
            ForeignFileError: a file is there that no report of this stem lists (without force), or it is the input.
            InputError: no plain file name, or a folder has that name.
        """
        for name in names:
            target = self.folder / _plain(name)
            if target.is_dir():
                raise InputError(
                    f"{target} is a folder, expected a file or nothing; choose another -o or move the folder"
                )
            if not target.exists() and not target.is_symlink():
                continue
            if self._is_source(target):
                raise ForeignFileError(f"{target} is the input itself, which is never overwritten; choose another -o")
            if not self.force and name not in self._own:
                raise ForeignFileError(
                    f"{target} is there, and no report says that flexpara wrote it; choose another -o, or add "
                    "--force to replace it"
                )

    def write(self, name: str, writer: Callable[[Path], object]) -> None:
        """Write one file, unseen until `commit`.

        Args:
            name: a plain file name.
            writer: called with a path of this name in the hidden folder; other files it makes beside it are taken too.

        Raises:
            ForeignFileError, InputError: as `check`, also for those other files; InputError: the disk is full.
        """
        self.check([name])
        staging = self._stage()
        before = set(self.names)
        with disk_full_is_said(self.folder):
            writer(staging / name)
        if not (staging / name).is_file():
            raise InputError(f"nothing was written as {name}; this is a defect worth reporting")
        self.check(set(self.names) - before)

    def write_several(self, writer: Callable[[Path], object]) -> None:
        """Write files into the hidden folder that the writer is called with, unseen until `commit`.

        Raises:
            ForeignFileError, InputError: as `check`, for each of them.
        """
        staging = self._stage()
        before = set(self.names)
        with disk_full_is_said(self.folder):
            writer(staging)
        self.check(set(self.names) - before)

    def write_report(self, report: Report) -> None:
        """Write the report: JSON, with `producer`, and the `files` of this run and of earlier ones still there."""
        files = sorted({*self.names, *self.kept, self.report_name})
        whole = {"producer": PRODUCER, **report, "files": files}
        if not str(whole["producer"]).startswith(PRODUCER):
            raise InputError(f"producer is {whole['producer']!r}, expected it to start with {PRODUCER!r}")
        text = json.dumps(whole, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
        self.write(self.report_name, lambda path: path.write_text(text, encoding="utf-8"))

    def commit(self) -> tuple[Path, ...]:
        """Move all files to their place, the report last; returns their paths.

        Raises: ForeignFileError where a foreign file has appeared meanwhile.
        """
        names = sorted(self.names, key=lambda name: (name == self.report_name, name))
        self.check(names)
        staging = self._stage()
        with disk_full_is_said(self.folder):
            for name in names:
                _reach_disk(staging / name)
        journal = self.folder / f".{self.stem}{JOURNAL}"
        # killed between two moves, the next run knows by it whose files these are
        with disk_full_is_said(self.folder):
            replace_file(journal, json.dumps({"producer": PRODUCER, "files": names}).encode())
        for name in names:
            (staging / name).replace(self.folder / name)
        journal.unlink(missing_ok=True)  # another attempt at the same, on a machine thought lost, may have been here
        self._made = ()
        self._discard()
        return tuple(self.folder / name for name in names)

    def _is_source(self, target: Path) -> bool:
        return self.source is not None and self.source.exists() and target.exists() and target.samefile(self.source)

    def _stage(self) -> Path:
        if not self._entered:
            raise InputError(
                "the output folder was used outside its with block; write `with OutputFolder(…) as output:`"
            )
        if self._staging is None:
            try:
                self.folder.mkdir(parents=True, exist_ok=True)
                self._staging = Path(tempfile.mkdtemp(prefix=STAGING, dir=self.folder))
            except OSError as error:
                self._discard()
                raise InputError(f"can't write to {self.folder} ({error.strerror}); choose another -o") from error
        return self._staging

    def _empty(self) -> None:
        if self._staging is not None:
            shutil.rmtree(self._staging)
            self._staging = None

    def _discard(self) -> None:
        """Leave nothing behind but what was committed: no hidden folder, and no empty one that was made here."""
        self._empty()
        for part in self._made:
            if part.is_dir() and not any(part.iterdir()):
                part.rmdir()


def replace_file(path: Path, content: bytes) -> None:
    """Put the content in the place of a file of ours, in a folder that exists: whole or not at all.

    Written beside its place, on the disk before it is renamed: a process killed at any moment leaves the old content
    or the new one.

    Raises: DiskFullError; OSError where that can't be done for another reason.  Nothing is left behind.
    """
    partial = path.with_name(f".{path.name}.partial")
    try:
        with disk_full_is_said(path.parent):
            partial.write_bytes(content)
            _reach_disk(partial)
            partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _reach_disk(path: Path) -> None:
    with path.open("rb") as file:
        os.fsync(file.fileno())


def sweep(folder: Path) -> None:
    """Remove the hidden folders that killed runs left in an output folder, which nothing writes to now."""
    for path in folder.glob(f"{STAGING}*") if folder.is_dir() else ():
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)


def check_whole(path: Path, *, force: bool = False) -> None:
    """Refuse, before the work, what `write_whole` would refuse after it.  Raises: as that."""
    OutputFolder(path.parent, path.stem, force=force).check([path.name])


def write_whole(path: Path, writer: Callable[[Path], object], *, force: bool = False) -> Path:
    """Write one file that has no report: whole or not at all, and over an existing one only with force.

    Args:
        path: the destination; its folder is made when absent.
        writer: called with a path of the same name elsewhere.
        force: replace an existing file, as where it is known to be ours.

    Raises:
        ForeignFileError, InputError: as OutputFolder.check.
    """
    with OutputFolder(path.parent, path.stem, force=force) as output:
        output.write(path.name, writer)
        return output.commit()[-1]


@contextmanager
def disk_full_is_said(folder: Path) -> Iterator[None]:
    """Within this, writing to a folder raises DiskFullError where its disk is full."""
    try:
        yield
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            raise
        raise DiskFullError(
            f"the disk of {folder} is full ({error.strerror}), expected room for the output; free some, or choose "
            "another -o"
        ) from error


def _plain(name: str) -> str:
    """The name, or InputError where it is no plain, visible file name."""
    if not name or name != Path(name).name or name.startswith(".") or "\\" in name or not name.isprintable():
        raise InputError(
            f"{name!r} is no plain file name, expected one without folders; rename the input or choose another stem"
        )
    return name


def _owned(folder: Path, stem: str) -> frozenset[str]:
    """Names listed in reports of this stem, `<stem>.<something>.json`, and in the journal of a run that was killed.

    A file of anyone else lists nothing.
    """
    names: set[str] = set()
    for path in sorted(folder.iterdir()) if folder.is_dir() else ():
        of_stem = path.name.startswith(f"{stem}.") and path.name.endswith(".json")
        if (of_stem or path.name == f".{stem}{JOURNAL}") and path.is_file():
            names |= _listed(path)
    return frozenset(names)


def written_in(folder: Path) -> frozenset[str]:
    """Names of files that reports in the same folder list: what flexpara wrote there."""
    return frozenset(name for path in folder.glob("*.json") if path.is_file() for name in _listed(path))


def _listed(path: Path) -> set[str]:
    try:
        if path.stat().st_size > LARGEST_REPORT:
            return set()
        report = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, OSError, RecursionError):
        return set()
    if not isinstance(report, dict) or not str(report.get("producer", "")).startswith(PRODUCER):
        return set()
    files = report.get("files")
    return {name for name in files if isinstance(name, str)} if isinstance(files, list) else set()

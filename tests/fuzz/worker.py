"""A process that reads one case after another under limits, and says what came of each.

It is watched from outside: a case that ends the process, or takes too long, is one too.  Python's audit events tell
which files are opened: those beside a case that lie outside of its folder, devices and sockets are findings.
"""

from __future__ import annotations

import os
import resource
import shutil
import signal
import sys
import traceback
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from .controls import CONTROLS
from .readers import READERS, Reader

SEEDS_FIRST = 1
"""Times that each seed is read as it is, before it is damaged."""
FORBIDDEN = ("/etc/passwd", "/etc/hostname", "/dev/zero", "/dev/random")


def reader_of(name: str) -> Reader:
    """A reader of flexpara, or a control."""
    return READERS[name] if name in READERS else CONTROLS[name]


@dataclass(frozen=True)
class Limits:
    """Of each case.  seconds: of the processor.  memory: bytes beyond those of the process before its first case."""

    seconds: float = 5.0
    memory: int = 1 << 30


@dataclass(frozen=True)
class Case:
    """One case, which its three numbers decide."""

    reader: str
    number: int
    seed: int

    def data(self, seeds: Mapping[str, list[bytes]]) -> bytes:
        """The damaged bytes; the first cases are the seeds as they are."""
        own = seeds[self.reader]
        if self.number < SEEDS_FIRST * len(own):
            return own[self.number % len(own)]
        rng = np.random.default_rng([self.seed, self.number, *self.reader.encode()])
        return reader_of(self.reader).mutate(rng, own)


def lay_out(case: Case, seeds: Mapping[str, list[bytes]], root: Path) -> Path:
    """The case as files in `root/case`, a secret and links to it beside them; returns the file to read."""
    reader, folder, outside = reader_of(case.reader), root / "case", root / "outside"
    shutil.rmtree(root, ignore_errors=True)
    for place in (folder, outside):
        place.mkdir(parents=True)
    (outside / "secret.bin").write_bytes(bytes(64))
    (folder / "link.bin").symlink_to(outside / "secret.bin")
    (folder / "up").symlink_to(outside)
    for name, content in reader.files(case.data(seeds), seeds).items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(content)
    return folder / reader.name


def serve(pipe: Connection, root: Path, seeds: Mapping[str, list[bytes]], limits: Limits) -> None:
    """Read the cases that come in until None does."""
    from flexpara.runtime.errors import FlexparaError

    opened: list[str] = []
    warm_up()
    warnings.simplefilter("error")  # a user would see them on stderr
    sys.addaudithook(lambda event, found: _watch(event, found, opened, root))
    (root.parent / "here").mkdir(exist_ok=True)
    os.chdir(root.parent / "here")
    most = _size() + limits.memory
    while (case := pipe.recv()) is not None:
        path = lay_out(case, seeds, root)
        before, known = _listing(root.parent), len(opened)
        resource.setrlimit(resource.RLIMIT_AS, (most, resource.RLIM_INFINITY))
        signal.setitimer(signal.ITIMER_PROF, limits.seconds)
        try:
            reader_of(case.reader).read(path)
            said = "read"
        except FlexparaError as error:
            said = "refused" if _names(error) else f"a message without its parts: {error}"
        except BaseException:
            said = traceback.format_exc()
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        said = f"opened {opened[known:]}" if len(opened) > known else said
        said = said if _listing(root.parent) == before else "a file was made or changed outside the target"
        pipe.send(said)


def _names(error: BaseException) -> bool:
    """Whether a message is one line that says something."""
    return 10 < len(str(error)) < 2000 and "\n" not in str(error)


def warm_up() -> None:
    """Import what readers import, so that a case pays for itself alone."""
    import trimesh

    from flexpara.bake.report import gather
    from flexpara.runtime.io import anyfile
    from flexpara.runtime.io.formats import others
    from flexpara.runtime.sessions import session, wrapsession
    from flexpara.train import saved
    from flexpara.train.paper import checkpoint

    assert all((trimesh, gather, anyfile, others, session, wrapsession, saved, checkpoint))
    for name in ("DracoPy", "meshoptimizer", "opengl_basisu", "lxml.etree", "collada", "networkx"):
        __import__(name)


def _watch(event: str, found: tuple[Any, ...], opened: list[str], root: Path) -> None:
    if event in ("socket.connect", "subprocess.Popen", "os.system"):
        opened.append(f"{event} {found}")
    if event != "open" or not isinstance(found[0], str | bytes | os.PathLike):
        return
    path = os.path.realpath(os.fsdecode(found[0]))
    if path in FORBIDDEN or path.startswith(str(root / "outside")):
        opened.append(path)


def _listing(folder: Path) -> set[tuple[str, int]]:
    return {(str(path), path.lstat().st_mtime_ns) for path in folder.rglob("*") if not path.is_dir()}


def _size() -> int:
    """Bytes of address space."""
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()

# SPDX-License-Identifier: GPL-3.0-or-later
"""flexpara as a process beside Blender: found, started, watched, asked to come to an end.  Knows nothing of Blender."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import NamedTuple

PROGRESS = re.compile(r"flexpara: progress: (.+) (\d+)/(\d+)$")
SPANS = {
    "parts": (0.0, 0.05),
    "charts": (0.05, 0.75),
    "exact check": (0.75, 0.8),
    "pack": (0.8, 0.9),
    "measure": (0.9, 0.92),
    "fit": (0.92, 0.97),
    "export": (0.97, 0.98),
    "write": (0.98, 1.0),
}
"""Where the stages of unwrap begin and end on the bar, as they take time on a mesh of some 10,000 faces."""
WINDOWS = sys.platform == "win32"
EXTRAS = "[unwrap,bake]"
"""Of flexpara: charts, textures, files; no torch."""


class FlexparaError(Exception):
    """flexpara is absent, or ended with an error; the message is its own."""


class Stage(NamedTuple):
    """What is being done, and which share of the whole is done; of the stage, where it is not one of unwrap's."""

    name: str
    share: float


def stage_of(name: str, done: int, of: int) -> Stage:
    """A stage of which so many steps are done."""
    begin, end = SPANS.get(name, (0.0, 1.0))
    return Stage(name, begin + (end - begin) * done / max(of, 1))


def find(preferred: str = "") -> str:
    """The program named in the preferences, else the one on PATH.

    Raises: FlexparaError with a remedy where there is none.
    """
    found = preferred or shutil.which("flexpara") or ""
    if not found or not Path(found).is_file():
        named = f"{found} is no file" if found else "flexpara was not found on PATH"
        raise FlexparaError(f"{named}: install it (Preferences > Add-ons > flexpara), or name it there")
    return found


def install_commands(folder: Path, python: str, source: str) -> list[list[str]]:
    """What makes an environment with flexpara in a folder: shown before it is run.

    Args:
        folder: where it will be.
        python: the program that makes it.
        source: what pip takes: a checkout or wheel on this machine, or an address.

    Raises: FlexparaError where no source is named: flexpara is not on the registry yet.
    """
    if not source:
        raise FlexparaError("no source is named: choose a checkout or a wheel of flexpara under Install from")
    inside = folder / ("Scripts" if WINDOWS else "bin")
    package = f"flexpara{EXTRAS} @ {source}" if "://" in source else f"{source.rstrip('/')}{EXTRAS}"
    return [[python, "-m", "venv", str(folder)], [str(inside / "python"), "-m", "pip", "install", package]]


def installed(folder: Path) -> str:
    """The program in an environment that was made so."""
    return str(folder / ("Scripts/flexpara.exe" if WINDOWS else "bin/flexpara"))


class Run:
    """One run of the program, in a process group of its own.

    stage: where it is.  notes: what it said besides.
    """

    def __init__(self, program: str, words: list[str]) -> None:
        """Start; words: what stands behind the program's name."""
        group = {"creationflags": getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)} if WINDOWS else {}
        self.stage, self.notes = Stage("starting", 0.0), list[str]()
        self._process = subprocess.Popen(
            [program, *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            encoding="utf-8",
            errors="replace",
            env=clean_environment(),
            start_new_session=not WINDOWS,
            **group,
        )
        self._out: list[str] = []
        self._readers = [
            threading.Thread(target=self._listen, daemon=True),
            threading.Thread(target=self._take, daemon=True),
        ]
        for reader in self._readers:
            reader.start()

    @property
    def running(self) -> bool:
        """Whether it has not ended yet."""
        return self._process.poll() is None

    def ask(self) -> None:
        """Ask for the best so far."""
        if self.running:
            self._process.send_signal(getattr(signal, "CTRL_BREAK_EVENT", signal.SIGINT) if WINDOWS else signal.SIGINT)

    def stop(self) -> None:
        """End it at once."""
        if self.running:
            self._process.kill()

    def result(self) -> str:
        """What it wrote to standard output, once it has ended.  Raises: FlexparaError with its own words."""
        code = self._process.wait()
        for reader in self._readers:
            reader.join()
        if code:
            said = [line for line in self.notes if "error:" in line] or self.notes[-3:]
            raise FlexparaError(" ".join(said).replace("flexpara: error: ", "") or f"flexpara ended with code {code}")
        return "".join(self._out)

    def _listen(self) -> None:
        assert self._process.stderr is not None
        with self._process.stderr as stream:
            for line in stream:
                found = PROGRESS.match(line.strip())
                if found:
                    self.stage = stage_of(found[1], int(found[2]), int(found[3]))
                elif line.strip():
                    self.notes.append(line.strip())

    def _take(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as stream:
            self._out.extend(stream)


def clean_environment() -> dict[str, str]:
    """The environment without what Blender sets for its own Python."""
    return {name: value for name, value in os.environ.items() if name not in ("PYTHONHOME", "PYTHONPATH")}

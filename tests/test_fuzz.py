"""Damaged files, a few of each kind; `python -m tests.fuzz --files 20000` makes many."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("DracoPy")
pytest.importorskip("meshoptimizer")
pytest.importorskip("igl")
ROOT = Path(__file__).resolve().parents[1]


def fuzz(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "tests.fuzz", "--keep", str(folder), *words]
    paths = os.pathsep.join([str(ROOT.parent), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": paths})


def test_every_reader_reads_or_refuses_500_damaged_files(tmp_path: Path) -> None:
    done = fuzz(tmp_path / "found", "--files", "500", "--seconds", "300")
    assert done.returncode == 0, done.stderr + done.stdout
    assert int(done.stdout.split()[-1]) >= 500


@pytest.mark.parametrize(
    ("reader", "message"),
    [
        ("raises", "ZeroDivisionError"),
        ("dies", "the process ended with -6"),
        ("hangs", "out of time"),
        ("fills", "MemoryError"),
        ("leaves", "outside the target"),
        ("follows", "secret.bin"),
    ],
)
def test_the_harness_sees_what_it_looks_for(tmp_path: Path, reader: str, message: str) -> None:
    done = fuzz(tmp_path / "found", "--files", "1", "--control", reader)
    assert done.returncode == 1, done.stderr
    assert message in done.stderr
    assert list((tmp_path / "found").glob(f"{reader}-0-0*"))

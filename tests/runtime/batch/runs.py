"""Batches as processes, and what they leave: for tests that disturb them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

KEPT = ("manifest.jsonl", "index.html", ".batch.lock")
"""What every run leaves beside its results."""
KINDS = ("sphere", "bracket", "torus")


def begun(meshes: Path, output: Path, *more: str, environment: dict[str, str] | None = None) -> subprocess.Popen[str]:
    """A batch at work."""
    words = ["batch", str(meshes), "-o", str(output), "--maps", "none", "--size", "256", *more]
    command = [sys.executable, "-m", "flexpara", *words]
    environment = {**os.environ, **(environment or {})}
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)


def ended(run: subprocess.Popen[str]) -> tuple[int, str]:
    """Exit code and what it said."""
    _, said = run.communicate(timeout=120)
    return run.returncode, said


def content(output: Path) -> dict[str, object]:
    """All files of an output folder but the ledger, and the page with its times; reports without their seconds."""
    found: dict[str, object] = {}
    for path in sorted(output.rglob("*")):
        name = path.relative_to(output).as_posix()
        if path.is_file() and name not in KEPT:
            found[name] = path.read_bytes()
        if name.endswith("report.json"):
            found[name] = {key: value for key, value in json.loads(path.read_bytes()).items() if key != "seconds"}
    return found


def workers_of(driver: int) -> list[int]:
    """The workers of a driver; none once it has ended."""
    try:
        children = Path(f"/proc/{driver}/task/{driver}/children").read_text(encoding="ascii").split()
    except OSError:
        return []
    return [int(child) for child in children if b"batch.worker" in Path(f"/proc/{child}/cmdline").read_bytes()]

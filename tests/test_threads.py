"""However many threads there are, and whatever was done before in the same process: the same bytes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from flexpara.runtime.process.cores import LIMIT

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

LIBRARIES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENIMAGEIO_THREADS", "LP_NUM_THREADS")
KINDS = ("torus", "bracket")


def written(meshes: Path, output: Path, order: tuple[str, ...], threads: int) -> dict[str, object]:
    """All files of one process that unwraps and bakes these meshes in this order; reports without their seconds."""
    names = [str(meshes / f"{kind}.obj") for kind in order]
    words = ["unwrap", *names, "-o", str(output), "--size", "64", "--maps", "normal,ao", "--rays", "4", "--quiet"]
    environment = {**os.environ, **dict.fromkeys((*LIBRARIES, LIMIT), str(threads))}
    subprocess.run([sys.executable, "-m", "flexpara", *words], check=True, env=environment, timeout=300)
    found: dict[str, object] = {path.name: path.read_bytes() for path in sorted(output.iterdir())}
    for kind in order:
        report = json.loads((output / f"{kind}.report.json").read_bytes())
        found[f"{kind}.report.json"] = {name: value for name, value in report.items() if name != "seconds"}
    return found


@pytest.fixture(scope="module")
def meshes(tmp_path_factory: pytest.TempPathFactory, write_samples: Callable[[Path, Sequence[str]], Path]) -> Path:
    return write_samples(tmp_path_factory.mktemp("meshes"), KINDS)


def test_threads_and_order_change_no_byte(meshes: Path, tmp_path: Path) -> None:
    pytest.importorskip("moderngl")
    one = written(meshes, tmp_path / "1", KINDS, 1)
    assert written(meshes, tmp_path / "2", KINDS[::-1], 2) == one
    assert written(meshes, tmp_path / "4", KINDS, 4) == one

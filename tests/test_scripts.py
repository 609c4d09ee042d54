"""The scripts and the benchmark: pins for every dependency, shell that parses, bars that catch."""

from __future__ import annotations

import argparse
import importlib.util
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from types import ModuleType

ROOT = Path(__file__).resolve().parent.parent
SHELL = ("scripts/demo", "scripts/test", "scripts/environment.sh", "scripts/onnx-headers")


def normalized(requirement: str) -> str:
    """The canonical name of a requirement."""
    return re.sub(r"[-_.]+", "-", re.split(r"[^\w.-]", requirement)[0]).lower()


def test_every_dependency_is_pinned_once() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    asked = {*project["dependencies"], *(name for extra in project["optional-dependencies"].values() for name in extra)}
    lines = (ROOT / "scripts" / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pinned = [normalized(line) for line in lines if not line.startswith("#")]
    assert all("==" in line and "+" not in line for line in lines if not line.startswith("#"))
    assert len(pinned) == len(set(pinned))
    assert {normalized(name) for name in asked} - {"flexpara"} <= set(pinned)


@pytest.mark.parametrize("name", SHELL)
def test_scripts_parse_as_posix_shell(name: str) -> None:
    subprocess.run(["sh", "-n", str(ROOT / name)], check=True)


@pytest.mark.parametrize("name", ["scripts/demo", "scripts/test", "scripts/onnx-headers", ".ci/run"])
def test_scripts_can_be_run(name: str) -> None:
    assert (ROOT / name).stat().st_mode & 0o111


@pytest.fixture(scope="module")
def benchmark() -> ModuleType:
    """benchmarks/unwrap.py, which is no part of the package."""
    spec = importlib.util.spec_from_file_location("benchmarks_unwrap", ROOT / "benchmarks" / "unwrap.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


GOOD: dict[str, Any] = {
    "mesh": "bunny",
    "tool": "flexpara",
    "faces": 56_000,
    "components": 1,
    "charts": 8,
    "flips": 0,
    "overlap": 0.0,
    "iso_ratio": 0.9,
    "seam_ratio": 0.6,
    "seconds": 25.0,
    "seconds_ratio": 2.0,
    "peak_mb": 1500.0,
    "rms_texels": 1.2,
    "agreement": 0.995,
}


@pytest.mark.parametrize(
    ("change", "missed"),
    [
        ({}, []),
        ({"flips": 1}, ["flips"]),
        ({"overlap": 1e-12}, ["overlap"]),
        ({"charts": 9}, ["charts"]),
        ({"charts": 9, "components": 2}, []),
        ({"iso_ratio": 1.1}, ["iso"]),
        ({"iso_ratio": 1.1, "mesh": "spot"}, []),
        ({"iso_ratio": 1.8, "mesh": "spot"}, ["iso"]),
        ({"seam_ratio": 0.8}, ["seam"]),
        ({"seam_ratio": 0.8, "mesh": "fandisk"}, []),
        ({"seconds_ratio": 3.0}, ["seconds"]),
        ({"seconds_ratio": 3.0, "mesh": "homer"}, []),
        ({"seconds": 21.0, "mesh": "spot", "faces": 5856}, ["seconds"]),
        ({"peak_mb": 2100.0}, ["memory"]),
        ({"rms_texels": 1.6}, ["rms"]),
        ({"rms_texels": float("inf"), "agreement": 0.0}, ["rms", "agreement"]),
    ],
)
def test_the_benchmark_names_each_bar_that_is_missed(
    change: dict[str, Any], missed: list[str], benchmark: ModuleType
) -> None:
    assert benchmark.judge({**GOOD, **change}, argparse.Namespace(charts=8)) == missed


def test_the_benchmark_measures_time_and_memory_of_another_process(benchmark: ModuleType) -> None:
    seconds, peak = benchmark.timed([sys.executable, "-c", "import time; x = bytearray(80_000_000); time.sleep(0.2)"])
    assert seconds >= 0.2
    assert 80.0 < peak < 110.0
    with pytest.raises(RuntimeError, match="ended with 3: no mesh"):
        benchmark.timed([sys.executable, "-c", "import sys; sys.stderr.write('no mesh'); sys.exit(3)"])

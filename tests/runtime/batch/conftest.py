"""What the tests of batches share: meshes, what an undisturbed run makes of them, and the helpers in runs.py."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

FIRST, _, LAST = os.environ.get("FLEXPARA_KILLS", "1").rpartition(":")
MOMENTS = range(int(FIRST or 0), int(LAST))
"""Moments at which a worker, a driver, and a machine is killed; each moment is another."""


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """As many of a test that kills as are asked for."""
    if "moment" in metafunc.fixturenames:
        metafunc.parametrize("moment", MOMENTS)


@pytest.fixture(scope="session")
def runs() -> Any:
    """The module runs.py: tests are no package."""
    spec = importlib.util.spec_from_file_location("runs", Path(__file__).with_name("runs.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def meshes(
    tmp_path_factory: pytest.TempPathFactory, write_samples: Callable[[Path, Sequence[str]], Path], runs: Any
) -> Path:
    return write_samples(tmp_path_factory.mktemp("meshes"), runs.KINDS)


@pytest.fixture(scope="session")
def undisturbed(meshes: Path, tmp_path_factory: pytest.TempPathFactory, runs: Any) -> dict[str, object]:
    output = tmp_path_factory.mktemp("undisturbed")
    code, said = runs.ended(runs.begun(meshes, output))
    assert code == 0, said
    return runs.content(output)

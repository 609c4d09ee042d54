"""Which of the two does the work, and that an installation takes all of the kernel's files."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from flexpara.runtime.errors import MissingDependencyError
from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.kernel import choice
from flexpara.runtime.kernel.choice import SWITCH, kernel, twins_only

ROOT = Path(__file__).resolve().parents[3]


def test_within_twins_only_nothing_compiled_is_used() -> None:
    before = kernel()
    with twins_only():
        assert kernel() is None
        with twins_only():
            assert len(edge_table(np.array([[0, 1, 2]])).edges) == 3
        assert kernel() is None
    assert kernel() is before


def test_the_switch_turns_the_kernel_off() -> None:
    code = "from flexpara.runtime.kernel.choice import kernel; print(kernel())"
    off = {**os.environ, SWITCH: "off"}
    done = subprocess.run([sys.executable, "-c", code], env=off, capture_output=True, check=True)
    assert done.stdout.split() == [b"None"]


def test_where_nothing_was_compiled_the_doctor_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "flexpara.runtime.kernel.compiled", None)
    assert choice.compiled() is None
    with pytest.raises(ImportError, match="not compiled"):
        choice.describe()


def test_the_doctor_says_which_is_in_use() -> None:
    if choice.compiled() is None:
        pytest.skip("nothing was compiled")
    assert choice.describe().startswith("compiled")
    with twins_only():
        assert SWITCH in choice.describe()


def test_every_file_of_the_kernel_is_listed() -> None:
    tools = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    (extension,) = tools["ext-modules"]
    found = {path.relative_to(ROOT).as_posix() for path in (ROOT / "runtime" / "kernel").glob("*.?pp")}
    assert found == {*extension["sources"], *extension["depends"]}


def test_a_kernel_of_other_sources_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(choice, "import_module", lambda *_: SimpleNamespace(edition=-1))
    with pytest.raises(MissingDependencyError, match=r"edition -1, expected .*build_kernel"):
        choice.compiled()

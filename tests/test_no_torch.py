"""The runtime works where neither torch nor OpenGL is installed, and nothing heavy is loaded before it is used.

Each check runs in a fresh interpreter: with those packages made unimportable, or with a look at what was loaded.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
NOT_FOR_RUNTIME = (
    "torch",
    "moderngl",
    "glcontext",
    "OpenGL",
    "onnx",
    "OpenImageIO",
    "igl",
    "safetensors",
)
HEAVY = (*NOT_FOR_RUNTIME, "onnxruntime", "scipy", "trimesh", "xatlas", "PIL", "rich", "cyclopts", "numpy")
RUNTIME = ["flexpara.runtime"] + [
    "flexpara." + ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for path in sorted((ROOT / "runtime").rglob("*.py"))
    if path.stem != "__init__"
]
BLOCK = """
import importlib.abc, sys
class Blocked(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {names!r}:
            raise ModuleNotFoundError(f"{{name}} is not installed here", name=name)
sys.meta_path.insert(0, Blocked())
"""
LIST_LOADED = """
import sys
print(*sorted({names!r} & {{name.partition(".")[0] for name in sys.modules}}))
"""


def interpret(code: str) -> subprocess.CompletedProcess[str]:
    """Run code in a fresh interpreter, outside the repository."""
    command = [sys.executable, "-c", code]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, cwd=ROOT / "tests")


def imports(modules: list[str]) -> str:
    return "".join(f"import {name}\n" for name in modules)


def blocked(modules: list[str], names: tuple[str, ...] = NOT_FOR_RUNTIME) -> subprocess.CompletedProcess[str]:
    """Import modules where ``names`` can't be imported."""
    return interpret(BLOCK.format(names=set(names)) + imports(modules))


def loaded(code: str, names: tuple[str, ...]) -> list[str]:
    """Which of ``names`` are loaded after running code."""
    done = interpret(code + LIST_LOADED.format(names=set(names)))
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_every_runtime_module_imports_without_torch_and_opengl() -> None:
    done = blocked(RUNTIME)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_no_runtime_module_loads_torch_or_opengl() -> None:
    assert loaded(imports(RUNTIME), NOT_FOR_RUNTIME) == []


def test_importing_the_package_loads_nothing_heavy() -> None:
    assert loaded("import flexpara\n", HEAVY) == []
    assert loaded("import flexpara.runtime\n", HEAVY) == []


@pytest.mark.parametrize("access", ["flexpara.runtime.UnwrapSession", "flexpara.UnwrapSession"])
def test_the_session_is_reached_lazily_and_without_torch(access: str) -> None:
    done = interpret(BLOCK.format(names=set(NOT_FOR_RUNTIME)) + f"import flexpara\nprint({access}.__name__)")
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, "UnwrapSession", "")


@pytest.mark.parametrize("module", ["torch", "onnx"])
def test_the_checks_can_fail(module: str) -> None:
    done = blocked(["flexpara.runtime.sessions.session", module])
    assert done.returncode != 0
    assert f"{module} is not installed here" in done.stderr
    assert module in loaded(imports([module]), NOT_FOR_RUNTIME)


def test_the_whole_runtime_is_looked_at() -> None:
    assert {"flexpara.runtime", "flexpara.runtime.sessions.session", "flexpara.runtime.mesh"} <= set(RUNTIME)


def test_export_without_onnx_says_how_to_get_it() -> None:
    done = blocked(["flexpara.export.graph.builder"], ("onnx",))
    assert "MissingDependencyError: onnx is missing, export needs it; pip install" in done.stderr


UNWRAP = """
import flexpara
from flexpara.runtime.samples import make_sample
flexpara.unwrap(make_sample("cube", resolution=4))
"""
NOT_FOR_UNWRAP = ("torch", "moderngl", "glcontext", "OpenGL", "OpenImageIO", "trimesh", "rich", "safetensors")
AFTER_CHARTS = ("onnx", "onnxruntime", "scipy.optimize", "flexpara.export.assemble", "flexpara.runtime.pack.packing")


def test_an_unwrap_loads_no_package_that_it_does_not_use() -> None:
    pytest.importorskip("igl")
    assert loaded(UNWRAP, NOT_FOR_UNWRAP) == []
    assert loaded(UNWRAP, ("igl", "onnxruntime")) == ["igl", "onnxruntime"]


def test_what_follows_the_charts_is_not_loaded_before_they_are_looked_for() -> None:
    pytest.importorskip("igl")
    begin = "import sys, flexpara.export.whole\n"
    done = interpret(f"{begin}print(*sorted({set(AFTER_CHARTS)!r} & set(sys.modules)))")
    assert (done.returncode, done.stdout) == (0, "\n"), done.stderr


def test_modules_are_loaded_one_at_a_time_while_there_is_nothing_else_to_do() -> None:
    pytest.importorskip("igl")
    code = """
import sys
from flexpara.export.whole import load_what_follows
from flexpara.runtime.process.meanwhile import load_next
assert not load_next()
load_what_follows()
print("scipy.optimize" in sys.modules, load_next(), "scipy.optimize" in sys.modules, "onnx" in sys.modules)
while load_next():
    pass
print(*sorted({names!r} & set(sys.modules)))
"""
    done = interpret(code.format(names=set(AFTER_CHARTS)))
    assert done.stdout.splitlines() == ["False True True False", " ".join(sorted(AFTER_CHARTS))], done.stderr


def test_a_package_that_is_needed_after_the_charts_is_missed_before_them() -> None:
    pytest.importorskip("igl")
    done = interpret(BLOCK.format(names={"onnxruntime"}) + UNWRAP)
    assert 'pip install "flexpara[unwrap]"' in done.stderr.splitlines()[-1]
    assert "chart_surface" not in done.stderr

"""The ONNX file in other languages: the page's blocks are built and run, and say the uv that flexpara says.

What a language needs is looked for and never fetched here: node or Chromium and npm's onnxruntime-web; g++, the library
of Python's onnxruntime and its headers (scripts/onnx-headers); cargo with the crate ort in its cache.
"""

from __future__ import annotations

import functools
import os
import re
import shutil
import subprocess
import threading
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import TYPE_CHECKING

import browser
import numpy as np
import onnxruntime
import pytest

pytest.importorskip("onnx")
pytest.importorskip("igl")

import flexpara
from flexpara.runtime.samples import make_sample

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).resolve().parent.parent
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
BLOCKS = dict(BLOCK.findall((ROOT / "docs" / "tasks" / "onnx.md").read_text(encoding="utf-8")))
MODULES = ROOT / "node_modules"
HEADERS = ROOT / ".venv" / "include" / "onnxruntime"
CARGO = '[package]\nname = "ask"\nversion = "0.1.0"\nedition = "2021"\n[dependencies]\nort = "=2.0.0-rc.12"\n'
WEB = pytest.mark.skipif(
    not (MODULES / "onnxruntime-web").is_dir(), reason="npm package onnxruntime-web is not installed: scripts/test"
)


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, np.ndarray]:
    """A folder with bunny.onnx, which is a ball's, and the uv (2,) of the point that all blocks ask for."""
    folder = tmp_path_factory.mktemp("languages")
    written = flexpara.unwrap(make_sample("sphere", resolution=8), size=64).save(folder, maps=())
    next(path for path in written if path.suffix == ".onnx").rename(folder / "bunny.onnx")
    session = flexpara.runtime.UnwrapSession(folder / "bunny.onnx")
    return folder, session.unwrap(np.array([[0.0, 1.0, 0.3]], np.float32)).uv[0]


@pytest.fixture
def place(known: tuple[Path, np.ndarray], tmp_path: Path) -> Path:
    """A folder of its own with that file."""
    shutil.copy(known[0] / "bunny.onnx", tmp_path)
    return tmp_path


def said(words: list[str], folder: Path, **variables: str) -> str:
    """What a program prints; its complaints where it fails."""
    environment = {**os.environ, **variables}
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=300, env=environment)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def numbers(text: str) -> list[float]:
    """All decimal fractions in a text."""
    return [float(found) for found in re.findall(r"-?\d+\.\d+(?:e-?\d+)?", text)]


@WEB
@pytest.mark.skipif(shutil.which("node") is None, reason="no node")
def test_javascript_in_node(known: tuple[Path, np.ndarray], place: Path) -> None:
    (place / "ask.mjs").write_text(BLOCKS["js"], encoding="utf-8")
    (place / "node_modules").symlink_to(MODULES.resolve())
    np.testing.assert_allclose(numbers(said(["node", "ask.mjs"], place))[:2], known[1], atol=1e-5)


@pytest.fixture
def address(place: Path) -> Iterator[str]:
    """Where a server hands out the folder, to this machine alone."""
    handler = functools.partial(SimpleHTTPRequestHandler, directory=str(place))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@WEB
@pytest.mark.xdist_group("browser")
@pytest.mark.skipif(browser.find_browser() is None, reason="no Chromium")
def test_javascript_in_a_page(known: tuple[Path, np.ndarray], place: Path, address: str) -> None:
    (place / "ask.html").write_text(BLOCKS["html"], encoding="utf-8")
    (place / "node_modules").symlink_to(MODULES.resolve())
    with browser.started(browser.find_browser() or "", place / "profile") as page:
        page.open(f"{address}/ask.html")
        page.wait("!document.querySelector('output').value.startsWith('asking')")
        np.testing.assert_allclose(numbers(page.run("document.querySelector('output').value")), known[1], atol=1e-5)
        assert {re.sub(r"(//[^/]+).*", r"\1", asked) for asked in page.requests if asked.startswith("http")} == {
            address
        }


@pytest.mark.skipif(shutil.which("g++") is None, reason="no g++")
@pytest.mark.skipif(not HEADERS.is_dir(), reason="no headers of ONNX Runtime: scripts/onnx-headers")
def test_cpp(known: tuple[Path, np.ndarray], place: Path) -> None:
    library = next((Path(onnxruntime.__file__).parent / "capi").glob("libonnxruntime.so.*"))
    for name in ("libonnxruntime.so", "libonnxruntime.so.1"):
        (place / name).symlink_to(library)
    (place / "ask.cpp").write_text(BLOCKS["cpp"], encoding="utf-8")
    said(["g++", "-std=c++17", f"-I{HEADERS}", "ask.cpp", "-L.", "-lonnxruntime", "-o", "ask"], place)
    np.testing.assert_allclose(numbers(said(["./ask"], place, LD_LIBRARY_PATH=".")), known[1], atol=1e-5)


def test_rust(known: tuple[Path, np.ndarray], place: Path) -> None:
    if shutil.which("cargo") is None:
        pytest.skip("no cargo")
    (place / "Cargo.toml").write_text(CARGO, encoding="utf-8")
    (place / "src").mkdir()
    (place / "src" / "main.rs").write_text(BLOCKS["rust"], encoding="utf-8")
    fetched = subprocess.run(["cargo", "fetch", "--offline"], cwd=place, capture_output=True, text=True)
    if fetched.returncode != 0:
        pytest.skip("the crate ort is not in cargo's cache: `cargo fetch` with a network, once")
    answer = said(["cargo", "run", "--offline", "--quiet"], place)
    np.testing.assert_allclose(numbers(answer), known[1], atol=1e-5)


def test_each_language_of_the_page_is_run_here_or_named_as_shown() -> None:
    assert set(BLOCKS) == {"python", "js", "html", "cpp", "rust", "csharp"}

"""Reports: size, seconds until a browser has drawn one, and a picture: `python -m benchmarks.report MESH… -o OUT`.

Each mesh is unwrapped with a normal map and `--report`; the last line compares all of them.  OUT receives MESH.webp,
MESH-dark.webp and `compared.webp`.  Chromium draws in software here.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

from PIL import Image

from flexpara.__main__ import main as flexpara

BROWSER = Path(__file__).resolve().parents[1] / "tests" / "helpers" / "browser.py"
DRAWN = "Number(document.documentElement?.dataset.drawn) > 0"
WIDTH, HEIGHT = 1300, 1000
QUALITY = 80


def browser_module() -> Any:
    """What drives the browser, which is no part of a package."""
    spec = spec_from_file_location("browser", BROWSER)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def opened(report: Path, picture: Path, folder: Path) -> float:
    """Seconds from opening the file until it is drawn; the window as a picture, light and dark."""
    browser = browser_module()
    with browser.started(browser.find_browser(), folder / f"profile-{report.stem}") as page:
        page.open("about:blank", WIDTH, HEIGHT)
        start = time.perf_counter()
        page.call("Page.navigate", url=report.resolve().as_uri())
        page.wait(DRAWN)
        seconds = time.perf_counter() - start
        for scheme, name in (("light", picture), ("dark", picture.with_stem(f"{picture.stem}-dark"))):
            page.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
            time.sleep(1.0)
            page.screenshot(folder / "shot.png")
            image = Image.open(folder / "shot.png").convert("RGB")
            image.thumbnail((900, 900), Image.Resampling.LANCZOS)
            image.save(name, quality=QUALITY, method=6)
        asked = [address for address in page.requests if not address.startswith(("file:", "data:", "blob:", "about:"))]
        assert (asked, page.complaints) == ([], []), (asked, page.complaints)
    return seconds


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("meshes", nargs="+", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    asked = parser.parse_args()
    asked.output.mkdir(parents=True, exist_ok=True)
    print("| report | MB | seconds to open |\n|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for mesh in asked.meshes:
            words = ["unwrap", str(mesh), "-o", str(folder / mesh.stem), "--maps", "normal", "--report", "--quiet"]
            assert flexpara(words) == 0
        reports = [(mesh.stem, folder / mesh.stem / f"{mesh.stem}.report.html") for mesh in asked.meshes]
        folders = [str(folder / mesh.stem) for mesh in asked.meshes]
        assert flexpara(["report", *folders, "-o", str(folder / "compared.html"), "--quiet"]) == 0
        for title, report in (*reports, ("compared", folder / "compared.html")):
            seconds = opened(report, asked.output / f"{title}.webp", folder)
            print(f"| {title} | {report.stat().st_size / 1e6:.1f} | {seconds:.1f} |", flush=True)


if __name__ == "__main__":
    main()

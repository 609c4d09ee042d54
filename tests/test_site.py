"""The documentation is a site: it is built strictly, and its tables of options hold every option."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from dataclasses import fields
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import pytest

from flexpara.bake.commands import BakeOptions
from flexpara.runtime.options.sources import MapSources
from flexpara.runtime.options.unwrap import Options, Outputs

ROOT = Path(__file__).resolve().parent.parent


def hooks() -> Any:
    spec = spec_from_file_location("hooks", ROOT / "docs" / "hooks.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_option_is_in_the_tables() -> None:
    page = hooks().on_page_markdown((ROOT / "docs" / "reference" / "options.md").read_text(encoding="utf-8"))
    shown = set(re.findall(r"^\| `--([\w-]+)` \|", page, re.MULTILINE))
    names = {"formats": "format", "every": "checkpoint-every", "fields": "field"}
    known = {field.name for kind in (Options, Outputs, BakeOptions, MapSources) for field in fields(kind)}
    assert {names.get(name, name.replace("_", "-")) for name in known} - shown == set()
    assert "| `--charts` | `8` | The most charts that each connected part" in page


@pytest.mark.skipif(find_spec("mkdocs") is None, reason="MkDocs is absent: pip install -e '.[docs]'")
def test_the_site_builds_strictly(tmp_path: Path) -> None:
    """A broken link, an unknown name in the API, or a page outside the menu is an error."""
    words = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--site-dir", str(tmp_path)]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr[-2000:]
    pages = list(tmp_path.rglob("*.html"))
    assert len(pages) > 18
    asked = re.compile(r'<(?:script|link|img)[^>]+(?:src|href)="(https?:[^"]+)"')
    assert [address for page in pages for address in asked.findall(page.read_text(encoding="utf-8"))] == []
    assert "symmetric_dirichlet_mean" in (tmp_path / "reference" / "api.html").read_text(encoding="utf-8")

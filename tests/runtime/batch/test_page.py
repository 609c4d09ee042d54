"""The page of a batch in a real browser: a click on a head sorts, thumbnails are shown, no network is asked."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import browser
import numpy as np
import pytest
from PIL import Image

from flexpara.runtime.batch.manifest import Entry
from flexpara.runtime.batch.status import Status, write_page


def entries(folder: Path) -> list[Entry]:
    """Three assets of 2, 10 and 1 charts, the last without a picture."""
    found = []
    for name, charts in (("b", 2), ("c", 10), ("a", 1)):
        (folder / name).mkdir()
        if charts > 1:
            Image.fromarray(np.zeros((8, 24, 3), np.uint8)).save(folder / name / f"{name}.preview.png")
        files = {f"{name}.preview.png": ""}
        found.append(Entry(f"{name}.obj", "done", "", "", name, metrics={"charts": charts}, files=files))
    return [*found, replace(found[0], asset="d.obj", status="failed", metrics={}, files={}, error="no mesh")]


@pytest.mark.skipif(browser.find_browser() is None, reason="no Chromium")
def test_a_click_on_a_head_sorts(tmp_path: Path) -> None:
    page = write_page(tmp_path, Status(4, entries(tmp_path)))
    names = "[...document.querySelectorAll('tbody tr')].map(row => row.cells[1].textContent[0]).join('')"
    with browser.started(browser.find_browser() or "", tmp_path / "profile") as opened:
        opened.open(page.as_uri())
        assert opened.run(names) == "bcad"
        click = "[...document.querySelectorAll('th button')].find(head => head.textContent === '{}').click()"
        for head, expected in (("charts", "cbad"), ("charts", "dabc"), ("asset", "dcba"), ("asset", "abcd")):
            opened.run(click.format(head))
            assert opened.run(names) == expected
        opened.wait("[...document.images].filter(image => image.naturalWidth === 24).length === 2")
        assert opened.complaints == []
        assert all(address.startswith("file:") for address in opened.requests)

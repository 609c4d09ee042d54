"""The report in a real browser: it opens from disk, complains of nothing, asks for nothing, and pointing works."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import browser
import pytest
from resultfolder import EVIL, OBJ, write_result

from flexpara.bake.report.gather import results_in
from flexpara.bake.report.page import html_of

if TYPE_CHECKING:
    from collections.abc import Iterator


PROGRAM = browser.find_browser()
pytestmark = [
    pytest.mark.skipif(PROGRAM is None, reason="no Chromium found: apt-get install chromium, or name it in $CHROMIUM"),
    pytest.mark.xdist_group("browser"),
]
DRAWN = "Number(document.documentElement.dataset.drawn) > 0 || !document.getElementById('problem').hidden"
ON_CANVAS = """(pane) => { const [x, y] = pane.project(flexparaReport.placeOf(pane));
 return [x / pane.canvas.width, y / pane.canvas.height]; }"""
"""Where the spot pointed at lies on the canvas of a pane, in shares of its side."""
READOUT = "document.getElementById('readout').textContent"


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """A browser at the report of two results of the same mesh."""
    folder = tmp_path_factory.mktemp("report")
    first, second = write_result(folder / "a"), write_result(folder / "b")
    path = folder / "report.html"
    path.write_text(html_of(results_in([first, second]), EVIL), encoding="utf-8")
    assert PROGRAM is not None
    with browser.started(PROGRAM, folder / "profile") as found:
        found.open(path.as_uri())
        found.wait(DRAWN)
        yield found


def place(page: Any, pane: int, x: float, y: float) -> tuple[float, float]:
    """The window's place of a spot of a pane, in shares of its side from the top left."""
    box = page.run(
        f"(() => {{ const canvas = flexparaReport.panes[{pane}].canvas; canvas.scrollIntoView({{block: 'center'}});"
        "const box = canvas.getBoundingClientRect(), side = Math.min(box.width, box.height);"
        "return [box.left + (box.width - side) / 2, box.top + (box.height - side) / 2, side]; })()"
    )
    return box[0] + x * box[2], box[1] + y * box[2]


def pointed(page: Any, pane: int, x: float, y: float) -> str:
    """What is said where the pointer is moved to."""
    page.run("document.getElementById('readout').textContent = ''")
    page.mouse("mouseMoved", *place(page, pane, x, y))
    page.wait(f"{READOUT} !== ''")
    return page.run(READOUT)


def test_nothing_is_requested_complained_of_or_run_that_is_not_ours(page: Any) -> None:
    assert page.run("document.getElementById('problem').textContent") == ""
    assert [address for address in page.requests if not address.startswith(("data:", "blob:", "file:"))] == []
    assert sum(address.startswith("file:") for address in page.requests) == 1
    assert page.complaints == []
    assert page.run("typeof hacked") == "undefined"
    assert page.run("document.title").startswith(EVIL)
    assert page.run("document.images.length") == 0


def test_the_policy_refuses_scripts_and_requests_of_others(page: Any) -> None:
    start = len(page.complaints)
    page.run("document.body.insertAdjacentHTML('beforeend', '<img src=x onerror=hacked=1>')")
    assert page.run("fetch('https://example.org').then(() => 'sent', () => 'refused')") == "refused"
    assert page.run("typeof hacked") == "undefined"
    assert len(page.complaints) > start
    del page.complaints[start:]


def test_pointing_at_the_layout_shows_the_place_on_the_model_and_back(page: Any) -> None:
    said = pointed(page, 1, 0.8, 0.6)  # right of the middle and below it
    assert said.startswith("a/card: chart 2 of 2 · triangle 2 · stretch 1.000")
    x, y = page.run(f"({ON_CANVAS})(flexparaReport.panes[0])")
    assert pointed(page, 0, x, y).partition("·")[2] == said.partition("·")[2]
    u, v, _ = page.run("flexparaReport.placeOf(flexparaReport.panes[1]).toArray()")
    assert (u, v) == pytest.approx((0.824, 0.392), abs=0.02)


def test_results_of_the_same_mesh_are_pointed_at_together(page: Any) -> None:
    pointed(page, 1, 0.72, 0.6)
    assert (
        page.run("flexparaReport.panes.map((pane) => flexparaReport.shares(pane, flexparaReport.spot))") == [True] * 4
    )


def test_beside_the_surface_nothing_is_said_to_be(page: Any) -> None:
    assert pointed(page, 0, 0.02, 0.02) == "Nothing of the surface is there."


def test_dragging_turns_the_models_together(page: Any) -> None:
    before = page.run("flexparaReport.orbit.azimuth")
    x, y = place(page, 2, 0.5, 0.5)
    page.mouse("mousePressed", x, y, held=True)
    page.mouse("mouseMoved", x + 50, y, held=True)
    page.mouse("mouseReleased", x + 50, y)
    assert page.run("flexparaReport.orbit.azimuth") < before
    assert page.run("flexparaReport.panes[0].view === flexparaReport.panes[2].view") is True


def test_everything_can_be_done_by_keys_and_has_a_name(page: Any) -> None:
    page.run("flexparaReport.panes[0].canvas.focus()")
    page.press("0")
    before = page.run("flexparaReport.orbit.azimuth")
    page.press("ArrowRight")
    page.press("+")
    assert page.run("flexparaReport.orbit.azimuth") > before
    assert page.run("flexparaReport.orbit.distance") < 3.4
    page.run("document.getElementById('readout').textContent = ''")
    page.press(" ")
    page.wait(f"{READOUT} !== ''")
    assert "chart" in page.run(READOUT)
    tree = page.call("Accessibility.getFullAXTree")["nodes"]
    parts = {node["role"]["value"]: node for node in tree if not node["ignored"]}
    assert {"application", "slider", "radio", "checkbox", "button", "table", "status"} <= set(parts)
    named = ("application", "slider", "radio", "checkbox", "button")
    unnamed = [node for node in tree if node.get("role", {}).get("value") in named and not node["name"]["value"]]
    assert unnamed == []


@pytest.mark.parametrize(("look", "pane", "color"), [("plain", 1, (204, 204, 204)), (EVIL, 1, (200, 30, 30))])
def test_a_look_is_the_colour_of_its_pixels(look: str, pane: int, color: tuple[int, ...], page: Any) -> None:
    """A map is seen where its uv are: the left half of the picture is red."""
    page.run("document.querySelector('[name=seams]').checked = false")
    page.mouse("mouseMoved", 3, 3)
    choose(page, look)
    assert page.run(f"({PIXEL})({pane}, 0.28, 0.6)")[:3] == pytest.approx(color, abs=6)


PIXEL = """(number, x, y) => { const {canvas} = flexparaReport.panes[number];
 return [...canvas.getContext('2d').getImageData(x * canvas.width, y * canvas.height, 1, 1).data]; }"""


def choose(page: Any, look: str) -> None:
    """Pick a look, and wait until it is drawn."""
    drawn = page.run("document.documentElement.dataset.drawn")
    page.run("flexparaReport.spot = null")
    page.run(f"[...document.querySelectorAll('[name=look]')].find((input) => input.value === {look!r}).click()")
    page.wait(f"document.documentElement.dataset.drawn !== {drawn!r}")


@pytest.fixture(scope="module")
def folded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """A browser at the report of one result: its third triangle is turned over and lies on the second."""
    folder = tmp_path_factory.mktemp("folded")
    write_result(folder / "a", obj=OBJ.replace("vt 0.6 0.7", "vt 0.85 0.2"))
    path = folder / "report.html"
    path.write_text(html_of(results_in([folder / "a"]), "folded"), encoding="utf-8")
    assert PROGRAM is not None
    with browser.started(PROGRAM, folder / "profile") as found:
        found.open(path.as_uri())
        found.wait(DRAWN)
        choose(found, "plain")
        yield found


def mark(page: Any, **values: Any) -> None:
    """Set checkboxes and sliders, and wait until that is drawn."""
    drawn = page.run("document.documentElement.dataset.drawn")
    for name, value in values.items():
        field = "checked" if isinstance(value, bool) else "value"
        page.run(f"document.getElementById('controls').elements.{name}.{field} = {json.dumps(value)}")
    page.run("document.getElementById('controls').dispatchEvent(new Event('input'))")
    page.wait(f"document.documentElement.dataset.drawn !== {drawn!r}")


def seen(page: Any, u: float, v: float, apart: float = 0.0) -> list[int]:
    """The colour of a place of the layout, a few pixels to the right of it if so wished."""
    x, y = (u - 0.5) / 1.08 + 0.5 + apart, 0.5 - (v - 0.5) / 1.08
    return page.run(f"({PIXEL})(1, {x}, {y})")[:3]


def test_flips_and_overlap_are_marked_where_they_are_and_counted(folded: Any) -> None:
    turned, whole = (0.783, 0.333), (0.25, 0.3)
    mark(folded, seams=False, flipped=True)
    assert seen(folded, *turned) == pytest.approx([0, 184, 242], abs=3)
    assert seen(folded, *whole) == pytest.approx([204] * 3, abs=12)
    mark(folded, overlapping=True)
    both = {tuple(seen(folded, *turned, apart=step * 0.004)) for step in range(8)}
    assert len(both) >= 2  # stripes: neither mark hides the other
    texts = [folded.run(f"document.getElementById('{name}-count').textContent") for name in ("flipped", "overlapping")]
    assert texts == ["1", "2"]
    mark(folded, flipped=False, overlapping=False)


def test_a_mip_level_is_what_a_texture_has_left_there(folded: Any) -> None:
    choose(folded, EVIL)
    assert seen(folded, 0.25, 0.3) == pytest.approx([200, 30, 30], abs=6)
    mark(folded, level=6)  # of 64 texels: one is left, half red and half black
    assert seen(folded, 0.25, 0.3)[0] < 160
    assert folded.run("document.getElementById('level-value').textContent").startswith("6, charts mix")


def test_light_and_dark(page: Any) -> None:
    light = page.run("getComputedStyle(document.body).backgroundColor")
    page.run("document.getElementById('theme').click()")
    dark = page.run("getComputedStyle(document.body).backgroundColor")
    assert (light, dark) == ("rgb(251, 251, 249)", "rgb(21, 24, 28)")
    page.run("document.getElementById('theme').click()")


def test_a_browser_without_webgl_shows_the_numbers_and_says_so(page: Any) -> None:
    address = page.run("location.href")
    page.call(
        "Page.addScriptToEvaluateOnNewDocument",
        source="HTMLCanvasElement.prototype.getContext = () => null; console.error = () => {};",
    )
    page.call("Page.navigate", url=address)
    page.wait("document.readyState === 'complete' && !document.getElementById('problem').hidden")
    assert "the numbers below stand" in page.run("document.getElementById('problem').textContent")
    assert page.run("document.querySelectorAll('#numbers tbody tr').length") > 8

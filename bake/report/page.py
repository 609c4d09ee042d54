"""The page: results, styles, scripts and three.js in one HTML text, which asks for nothing from anywhere.

Scripts are modules at data addresses, named by an import map: a page opened from disk may load no other.  Its policy
(Content-Security-Policy) allows these alone and no request at all; texts of results are escaped, or set as text.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import zlib
from importlib.resources import files
from io import BytesIO
from string import Template
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from ... import __version__
from ...runtime.mesh import Frame
from ..colors.color import chart_colors, srgb_bytes_from_linear
from ..colors.heat import heat_colors
from ..maps.checker import uv_card
from .pictures import data_uri
from .words import table

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from .result import Result

MODULES = ("report", "data", "stage", "shaders", "panes", "pointing")
THREE = {"three": "three/three.module.min.js", "three.core": "three/three.core.min.js"}
CARD = 1024
"""Side of the test card in texels."""
SHORTEST = 0.005
"""Seconds below which a stage is not shown."""
LEVELS = 256
"""Colours of the scale of distortion."""
FINENESS = 4096.0
"""Steps of a stretch of 1, as it is stored in sixteen bits."""


def html_of(results: Sequence[Result], title: str) -> str:
    """The whole page.

    Args:
        results: one or more, side by side in this order.
        title: what stands above them.
    """
    data = json.dumps(page_data(results), allow_nan=False).replace("<", "\\u003c")
    modules = {name: _module(f"{name}.js") for name in MODULES} | {name: _module(file) for name, file in THREE.items()}
    return Template(_site("page.html")).substitute(
        title=html.escape(title),
        nonce=hashlib.sha256(data.encode("ascii")).hexdigest()[:32],
        style=_site("page.css"),
        imports=json.dumps({"imports": modules}),
        data=data,
        metrics=_metrics_table(results),
        seconds=_seconds(results),
        notes=_notes(results),
        version=__version__,
    )


def write_page(results: Sequence[Result], title: str, path: Path) -> None:
    """Write the whole page."""
    path.write_text(html_of(results, title), encoding="utf-8")


def page_data(results: Sequence[Result]) -> dict[str, Any]:
    """What the scripts of the page read."""
    top = max(result.facts.top for result in results)
    steps = np.linspace(-1.0, 1.0, LEVELS)
    return {
        "top": top,
        "heat": packed(srgb_bytes_from_linear(heat_colors(steps))),
        "fineness": FINENESS,
        "card": _card(),
        "results": [_result_data(result, top) for result in results],
    }


def packed(values: NDArray[Any]) -> dict[str, str]:
    """An array for the page: its number type, and its deflated bytes, little-endian."""
    content = zlib.compress(np.ascontiguousarray(values).astype(values.dtype.newbyteorder("<")).tobytes(), 6)
    return {"type": values.dtype.name, "bytes": base64.b64encode(content).decode("ascii")}


def _result_data(result: Result, top: float) -> dict[str, Any]:
    """One result: positions in the unit ball, uv in sides of the page, and facts of faces."""
    shape, facts, frame = result.shape, result.facts, Frame.of(result.shape.positions)
    chart_type = np.uint16 if facts.chart.max() < 1 << 16 else np.uint32
    level = np.round((facts.heat(top) + 1.0) * 0.5 * (LEVELS - 1))
    return {
        "title": result.title,
        "mesh": result.mesh,
        "size": None if result.page is None else result.page.side,
        "extent": shape.extent.tolist(),
        "cleanMip": result.metrics.get("bleed_free_mip"),
        "pictures": dict(result.pictures),
        "unit": 1.0 / frame.scale,
        "arrays": {
            "positions": packed(frame.apply(shape.positions).astype(np.float32)),
            "normals": packed(np.round(shape.normals * 127.0).astype(np.int8)),
            "uv": packed((shape.uv * shape.extent).astype(np.float32)),
            "faces": packed(shape.faces.astype(np.uint32)),
            "charts": packed(facts.chart.astype(chart_type)),
            "colors": packed(srgb_bytes_from_linear(chart_colors(int(facts.chart.max()) + 1))),
            "stretch": packed(np.minimum(np.round(facts.stretch * FINENESS), 65535.0).astype(np.uint16)),
            "heat": packed(level.astype(np.uint8)),
            "flags": packed(facts.flags),
            "seams": packed(facts.seams.astype(np.uint32)),
        },
    }


def _card() -> str:
    """The asymmetric test card as a data address."""
    stream = BytesIO()
    Image.fromarray(srgb_bytes_from_linear(uv_card(CARD))).quantize(256).save(stream, "PNG", optimize=True)
    return data_uri("image/png", stream.getvalue())


def _site(name: str) -> str:
    return (files(__name__.rpartition(".")[0]) / "site" / name).read_text(encoding="utf-8")


def _module(name: str) -> str:
    """A script as an address; what it imports from beside itself is named in the import map."""
    text = _site(name).replace('"./three.core.min.js"', '"three.core"')
    return data_uri("text/javascript", text.encode("utf-8"))


def _metrics_table(results: Sequence[Result]) -> str:
    """What was measured, a column for each result; the best of several in bold, and said."""
    head = "".join(f'<th scope="col">{html.escape(result.title)}</th>' for result in results)
    rows = []
    alike = len({len(result.shape.faces) for result in results}) == 1  # of different meshes none is ahead
    for row in table([result.metrics for result in results], ranked=alike):
        cells = "".join(
            f'<td class="best"><strong>{html.escape(value)}</strong><span class="hidden"> (best)</span></td>'
            if best
            else f"<td>{html.escape(value)}</td>"
            for value, best in zip(row.values, row.best, strict=True)
        )
        rows.append(f'<tr><th scope="row">{row.name}</th>{cells}<td class="meaning">{row.meaning}</td></tr>')
    caption = "<caption>What was measured</caption>"
    header = f'<thead><tr><th scope="col">Measure</th>{head}<th scope="col">What it means</th></tr></thead>'
    return f"<table>{caption}{header}<tbody>{''.join(rows)}</tbody></table>"


def _seconds(results: Sequence[Result]) -> str:
    """Time per stage, a bar each."""
    timed = [result for result in results if result.seconds]
    longest = max((value for result in timed for value in result.seconds.values()), default=0.0)
    return "".join(_bars(result.title, result.seconds, longest) for result in timed)


def _bars(title: str, seconds: Mapping[str, float], longest: float) -> str:
    rows = "".join(
        f'<tr><th scope="row">{html.escape(name)}</th><td>{value:.2f} s</td>'
        f'<td><meter min="0" max="{longest:.6f}" value="{value:.6f}" aria-hidden="true"></meter></td></tr>'
        for name, value in seconds.items()
        if value >= SHORTEST
    )
    caption = f"{html.escape(title)}: {sum(seconds.values()):.1f} s in all"
    return f"<table><caption>{caption}</caption><tbody>{rows}</tbody></table>"


def _notes(results: Sequence[Result]) -> str:
    """What the user was told, result by result."""
    items = [
        f"<li>{html.escape(result.title)}: {html.escape(note)}</li>" for result in results for note in result.notes
    ]
    return f"<ul>{''.join(items)}</ul>" if items else "<p>None.</p>"

"""Evaluates an exported inverse: atlas uv in, surface points and normals out.  Needs numpy and onnxruntime only.

n rows.  uv in [0, 1]², v up; points in the units of the source file; normals unit, outwards as the faces are oriented.

The file is `<stem>.wrap.onnx`: `uv` (n, 2) float32 and `chart` (n) int64 → `points` (n, 3), `normals` (n, 3) float32.
Its JSON is that of sessions/bundle.py with kind "wrap".  The graph adds the frame's centre in float32; the session sets
the graph's two centre initializers to zero and adds it in float64, so that far from the origin no precision is lost.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, ShapeError
from .bundle import BundleMetadata
from .chunks import fill_in_chunks
from .opened import BundleSession

if TYPE_CHECKING:
    from collections.abc import Sequence

KIND = "wrap"
INPUTS = {"uv": "tensor(float)", "chart": "tensor(int64)"}
OUTPUTS = {"points": "tensor(float)", "normals": "tensor(float)"}
CONVENTIONS = {
    "uv": "float32 (n, 2), atlas coordinates in [0, 1], origin bottom left, v up, inside the chart",
    "chart": "int64 (n), index into placement; out of range: points and normals are NaN",
    "points": "float32 (n, 3), units of the source file, inside the frame's box",
    "normals": "float32 (n, 3), unit length",
    "placement": "rows of (2, 3): atlas uv = placement[:, :2] @ chart uv + placement[:, 2]",
    "frame": "points = xyz of the networks * scale + centre",
}
SLACK = 1e-6
"""uv this far outside [0, 1] are taken for rounding."""

Coordinates = NDArray[np.float32] | NDArray[np.float64] | NDArray[np.float32 | np.float64]


class Wrapped(NamedTuple):
    """What lies at n atlas uv.

    points: (n, 3) float64, source units.  normals: (n, 3) float32, unit.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float32]


class WrapSession(BundleSession):
    """An exported inverse.  Immutable; `wrap` may be called from several threads at once."""

    INPUTS = INPUTS
    OUTPUTS = OUTPUTS
    KIND = KIND

    def wrap(self, uv: Coordinates, chart: NDArray[np.integer]) -> Wrapped:
        """Surface points and normals.

        Args:
            uv: (n, 2) float32 or float64 in [0, 1], v up, inside the chart; n = 0 is allowed.  Outside the chart the
                networks extrapolate: the answer stays in the frame's box, and means less the further out.
            chart: (n,) integers in [0, chart_count).

        Raises:
            ShapeError: another shape or dtype.
            InputError: uv that are NaN, infinite or outside [0, 1]; a chart that does not exist.
        """
        uv, chart = _checked_uv(uv), _checked_chart(chart, len(uv), self.chart_count)
        n, frame = len(uv), self.metadata.frame
        answer = Wrapped(np.zeros((n, 3)), np.zeros((n, 3), dtype=np.float32))

        def run(rows: slice) -> Sequence[NDArray[np.generic]]:
            feed = {"uv": uv[rows].astype(np.float32), "chart": chart[rows].astype(np.int64)}
            return self._opened.run(list(OUTPUTS), feed)

        fill_in_chunks(answer, run, self._chunk, self._threads)
        return answer._replace(points=answer.points + np.asarray(frame.centre))


def wrap_json(facts: BundleMetadata) -> str:
    """The metadata of an inverse as one line of JSON.  Raises: as BundleMetadata.to_json."""
    content = json.loads(facts.to_json()) | {"kind": KIND, "conventions": CONVENTIONS}
    return json.dumps(content, allow_nan=False, sort_keys=True, separators=(",", ":"))


def _checked_uv(uv: Coordinates) -> Coordinates:
    uv = np.asarray(uv)
    if uv.ndim != 2 or uv.shape[1] != 2 or uv.dtype not in (np.float32, np.float64):
        hint = "pass uv.T" if uv.ndim == 2 and uv.shape[0] == 2 else "convert them"
        raise ShapeError(f"uv of shape {uv.shape} {uv.dtype}, expected (n, 2) float32 or float64; {hint}")
    inside = ((uv >= -SLACK) & (uv <= 1.0 + SLACK)).all(axis=1)  # False for NaN
    if not inside.all():
        first = int((~inside).argmax())
        found = f"{int((~inside).sum())} of {len(uv)} uv are outside [0, 1] (row {first}: {uv[first].tolist()})"
        raise InputError(f"{found}, expected atlas coordinates; divide texels by the atlas size, v up")
    return uv


def _checked_chart(chart: NDArray[np.integer], n: int, charts: int) -> NDArray[np.integer]:
    chart = np.asarray(chart)
    if chart.shape != (n,) or chart.dtype.kind not in "iu":
        found = f"chart of shape {chart.shape} {chart.dtype}"
        raise ShapeError(f"{found}, expected ({n},) integers; pass one chart index a uv")
    known = (chart >= 0) & (chart < charts)
    if not known.all():
        first = int((~known).argmax())
        found = f"{int((~known).sum())} of {n} charts do not exist (row {first}: {int(chart[first])})"
        raise InputError(f"{found}, expected indices in [0, {charts}); leave out rows outside the atlas's charts")
    return chart

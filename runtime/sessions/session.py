"""Evaluates an exported file: points in, uv out.  Needs numpy and onnxruntime; no torch, no mesh.

n points.  Points are in the units of the source file; uv in [0, 1]², v up.

The frame's centre is subtracted in float64: points a million radii from the origin keep their precision on the surface.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, ShapeError
from .chunks import fill_in_chunks
from .opened import BundleSession

INPUTS = {"points": "tensor(float)"}
OUTPUTS = {"uv": "tensor(float)", "chart": "tensor(int64)", "score": "tensor(float)"}
FAR = 1e6
"""Points further than this many frame radii from the centre are refused: another unit, or another mesh."""

Points = NDArray[np.float32] | NDArray[np.float64] | NDArray[np.float32 | np.float64]


class Unwrapped(NamedTuple):
    """Where n points lie in the atlas.

    uv: (n, 2) float32 in [0, 1], v up.  chart: (n,) int64 in [0, chart_count).  score: (n,) float32 in [0, 1], how far
    chart and uv can be trusted: the share of right answers that was measured around the point when the map was fitted,
    1 but where parts of the surface touch; falling with the square of the distance where no surface is near.
    """

    uv: NDArray[np.float32]
    chart: NDArray[np.int64]
    score: NDArray[np.float32]


class UnwrapSession(BundleSession):
    """An exported surface map.  Immutable; `unwrap` may be called from several threads at once."""

    INPUTS = INPUTS
    OUTPUTS = OUTPUTS

    def unwrap(self, points: Points) -> Unwrapped:
        """Atlas uv, chart and score of points.

        Args:
            points: (n, 3) float32 or float64, units of the source file, on or near its surface; n = 0 is allowed.

        Raises:
            ShapeError: another shape or dtype.
            InputError: NaN, infinite, or absurdly far from the surface.
            BundleError: the file is damaged in a way that only its answers show.
        """
        points = _checked_points(points)
        n = len(points)
        answer = Unwrapped(
            uv=np.zeros((n, 2), dtype=np.float32),
            chart=np.zeros(n, dtype=np.int64),
            score=np.zeros(n, dtype=np.float32),
        )
        fill_in_chunks(answer, lambda rows: self._run(points[rows], rows.start), self._chunk, self._threads)
        return answer

    def _run(self, points: Points, start: int) -> list[NDArray[np.generic]]:
        """Outputs uv, chart, score of one chunk, whose first point is number ``start``."""
        frame = self._opened.metadata.frame
        centred = np.asarray(points, dtype=np.float64) - np.asarray(frame.centre)
        far = np.abs(centred).max(axis=1) > FAR * frame.scale
        if far.any():
            first = int(far.argmax())
            found = f"point {start + first} = {points[first].tolist()}"
            expected = f"points near the surface (centre {frame.centre}, radius {frame.scale:.6g})"
            raise InputError(f"{found}, expected {expected}; use the units and the placement of the source file")
        return self._opened.run(list(OUTPUTS), {"points": centred.astype(np.float32)})


def _checked_points(points: Points) -> Points:
    points = np.asarray(points)
    if points.ndim != 2 or points.shape[1] != 3 or points.dtype not in (np.float32, np.float64):
        hint = "pass points.T" if points.ndim == 2 and points.shape[0] == 3 and points.shape[1] != 3 else "convert it"
        found = f"points of shape {points.shape} {points.dtype}"
        raise ShapeError(f"{found}, expected (n, 3) float32 or float64; {hint}")
    finite = np.isfinite(points).all(axis=1)
    if not finite.all():
        first = int((~finite).argmax())
        found = f"{int((~finite).sum())} of {len(points)} points are NaN or infinite (first: {first})"
        raise InputError(f"{found}, expected finite coordinates; remove them")
    return points

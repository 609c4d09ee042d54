"""Evaluates an exported file: points in, uv out.  Needs numpy and onnxruntime; no torch, no mesh.

n points.  Points are in the units of the source file; uv in [0, 1]², v up.

The graph subtracts the frame's centre in float32.  The session does that in float64 instead and sets the graph's own
two centre initializers to zero: float64 points a million radii from the origin keep their precision on the surface.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from ..errors import BundleError, InputError, MissingDependencyError, MissingFileError, ShapeError
from .bundle import METADATA_KEY, BundleMetadata
from .chunks import checked_chunk, checked_threads, fill_in_chunks
from .modelerrors import MODEL_ERRORS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

MAX_BYTES = 1 << 30
CENTRES = ("centre", "centre_rest")
INPUTS = {"points": "tensor(float)"}
OUTPUTS = {"uv": "tensor(float)", "chart": "tensor(int64)", "score": "tensor(float)"}
FAR = 1e6
"""Points further than this many frame radii from the centre are refused: another unit, or another mesh."""

Points = NDArray[np.float32] | NDArray[np.float64] | NDArray[np.float32 | np.float64]

_REMEDY = "pass the .onnx file that flexpara unwrap wrote"


class Unwrapped(NamedTuple):
    """Where n points lie in the atlas.

    uv: (n, 2) float32 in [0, 1], v up.  chart: (n,) int64 in [0, chart_count).  score: (n,) float32 in [0, 1], how far
    chart and uv can be trusted: the share of right answers that was measured around the point when the map was fitted,
    1 but where parts of the surface touch; falling with the square of the distance where no surface is near.
    """

    uv: NDArray[np.float32]
    chart: NDArray[np.int64]
    score: NDArray[np.float32]


class Opened(NamedTuple):
    """A checked file of flexpara.

    zero: what replaced the graph's initializers CENTRES.  onnxruntime reads it from this very memory, so it has to live
    as long as the session.
    """

    session: onnxruntime.InferenceSession
    metadata: BundleMetadata
    zero: onnxruntime.OrtValue
    path: Path

    def run(self, outputs: Sequence[str], feed: Mapping[str, NDArray[np.generic]]) -> list[NDArray[np.generic]]:
        """The outputs, every number finite.  Raises: BundleError where a damaged model can't answer so."""
        try:
            found = [np.asarray(output) for output in self.session.run(list(outputs), dict(feed))]
        except MODEL_ERRORS as error:
            raise BundleError(
                f"{self.path}: the model does not run, expected an answer; the file is damaged: {_REMEDY}"
            ) from error
        for name, values in zip(outputs, found, strict=True):
            if values.dtype.kind == "f" and not np.isfinite(values).all():
                raise BundleError(
                    f"{self.path}: the model answers {name} = NaN or infinite, expected finite numbers; the file is "
                    f"damaged: {_REMEDY}"
                )
        return found


def open_bundle(
    path: Path,
    providers: Sequence[str],
    inputs: Mapping[str, str],
    outputs: Mapping[str, str],
) -> Opened:
    """Load a file and check that it is ours and has these inputs and outputs (name → onnxruntime's type).

    Raises: as UnwrapSession.
    """
    _check_file(path)
    _check_available(providers)
    zero = onnxruntime.OrtValue.ortvalue_from_numpy(np.zeros(3, dtype=np.float32))
    session = _load(path, providers, dict.fromkeys(CENTRES, zero))
    metadata = _read_metadata(session, path)
    _check_signature(session, path, inputs, outputs)
    _check_used(session, providers)
    return Opened(session, metadata, zero, path)


class UnwrapSession:
    """An exported surface map.  Immutable; `unwrap` may be called from several threads at once."""

    def __init__(
        self,
        path: str | Path,
        *,
        providers: Sequence[str] = ("CPUExecutionProvider",),
        chunk: int = 16_384,
        threads: int | None = None,
    ) -> None:
        """Load and check a file.

        Args:
            path: an .onnx file that flexpara wrote.
            providers: onnxruntime execution providers, best first; all must really be used, there is no fallback.
            chunk: points a run; what is in flight then stays in the processor's caches.
            threads: that answer a chunk each; None = one a core.

        Raises:
            MissingFileError: nothing lies at path.
            BundleError: not an ONNX file, not written by flexpara, damaged, or of another format version.
            MissingDependencyError: a provider is not in this build of onnxruntime or can't start here.
            InputError: chunk or threads below 1.
        """
        self._chunk, self._threads = checked_chunk(chunk), checked_threads(threads)
        self._opened = open_bundle(Path(path), providers, INPUTS, OUTPUTS)

    @property
    def metadata(self) -> BundleMetadata:
        """What the file says about itself: frame, placement, source hash, settings, metrics, producer."""
        return self._opened.metadata

    @property
    def chart_count(self) -> int:
        """Number of charts, k."""
        return self._opened.metadata.chart_count

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


def _check_file(path: Path) -> None:
    if not path.exists():
        raise MissingFileError(f"{path}: no such file, expected an exported .onnx file; {_REMEDY}")
    if not path.is_file():
        raise BundleError(f"{path}: is no file, expected an exported .onnx file; {_REMEDY}")
    size = path.stat().st_size
    if not 0 < size <= MAX_BYTES:
        raise BundleError(f"{path}: {size} bytes, expected 1 to {MAX_BYTES}; {_REMEDY}")


def _check_available(providers: Sequence[str]) -> None:
    available = onnxruntime.get_available_providers()
    missing = [name for name in providers if name not in available]
    if isinstance(providers, str) or not providers:
        raise InputError(
            f"providers = {providers!r}, expected a list of names among {available}; leave it out for the CPU"
        )
    if missing:
        found = f"{', '.join(missing)} not in this onnxruntime ({onnxruntime.__version__})"
        expected = f"expected some of {', '.join(available)}"
        raise MissingDependencyError(f"{found}, {expected}; install the build that has it (CUDA: onnxruntime-gpu)")


def _load(
    path: Path, providers: Sequence[str], replaced: Mapping[str, onnxruntime.OrtValue]
) -> onnxruntime.InferenceSession:
    """The model with some initializers replaced; the caller keeps those alive."""
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 4
    options.intra_op_num_threads = 1  # chunks are shared out, see chunks.py
    for name, value in replaced.items():
        options.add_initializer(name, value)
    try:
        return onnxruntime.InferenceSession(path, options, providers=list(providers), enable_fallback=0)
    except (*MODEL_ERRORS, UnicodeDecodeError) as error:
        raise BundleError(f"{path}: no usable ONNX model, expected an exported file; {_REMEDY}") from error


def _read_metadata(session: onnxruntime.InferenceSession, path: Path) -> BundleMetadata:
    properties = session.get_modelmeta().custom_metadata_map
    if METADATA_KEY not in properties:
        producer = session.get_modelmeta().producer_name or "an unknown tool"
        raise BundleError(f"{path}: an ONNX model by {producer}, expected metadata `{METADATA_KEY}`; {_REMEDY}")
    return BundleMetadata.from_json(properties[METADATA_KEY], str(path))


def _check_signature(
    session: onnxruntime.InferenceSession, path: Path, inputs: Mapping[str, str], outputs: Mapping[str, str]
) -> None:
    found_inputs = {node.name: node.type for node in session.get_inputs()}
    found_outputs = {node.name: node.type for node in session.get_outputs()}
    if found_inputs != inputs or found_outputs != outputs:
        raise BundleError(f"{path}: {found_inputs} → {found_outputs}, expected {inputs} → {outputs}; {_REMEDY}")


def _check_used(session: onnxruntime.InferenceSession, providers: Sequence[str]) -> None:
    used = session.get_providers()
    if [name for name in used if name in providers] != list(providers):
        found = f"onnxruntime uses {', '.join(used)}"
        raise MissingDependencyError(f"{found}, expected {', '.join(providers)}; mend its drivers, or ask for the CPU")


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

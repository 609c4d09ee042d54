"""Fields given as ONNX, sampled into a texture: `points` float32 (n, 3) → any one output float32 (n, c), c = 1 to 4.

n points, in the units of the source file: the surface under each texel.  Any tool may have written the file; it is
checked before it is run, and what it returns is checked after.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import onnxruntime

from ...runtime.errors import InputError, MissingFileError, ShapeError
from ...runtime.sessions.modelcheck import check_model
from ...runtime.sessions.modelerrors import MODEL_ERRORS
from ..bakemap import BakeMap

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Asset, Atlas
    from ..raster.gbuffer import GBuffer
    from ..texture import Encoding

MAX_BYTES = 1 << 30
CHUNK = 16_384
"""Points a run: bounds the memory of what the graph makes of them."""
CHANNELS = (1, 2, 3, 4)
_EXPECTED = "expected an ONNX graph of one input points float32 (n, 3) and one output float32 (n, 1 to 4)"
_REMEDY = "export the field anew with these names and a dynamic n"


class FieldSession:
    """A field that is ready to be evaluated."""

    def __init__(self, path: str | Path) -> None:
        """Load and check a file.

        Raises:
            MissingFileError: nothing lies there.
            InputError: no ONNX file, too large, or a graph of other inputs and outputs.
        """
        self.path = Path(path)
        _check_file(self.path)
        options = onnxruntime.SessionOptions()
        options.log_severity_level = 4
        content = self.path.read_bytes()
        check_model(content, str(path), operators=None)
        try:
            self._session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
        except MODEL_ERRORS as error:
            reason = str(error).splitlines()[0][:200]
            raise InputError(f"{path}: no usable ONNX model ({reason}), {_EXPECTED}; {_REMEDY}") from error
        try:
            self.output = _checked_signature(self._session, self.path)
        except UnicodeDecodeError as error:
            raise InputError(f"{path}: names that are no text, {_EXPECTED}; {_REMEDY}") from error

    def evaluate(self, points: NDArray[np.float32]) -> NDArray[np.float32]:
        """(n, c) float32 values at points (n, 3) float32 in source units; n = 0 gives (0, 1).

        Raises: InputError where the graph fails, ShapeError where it returns another shape or what is no number.
        """
        starts = range(0, len(points), CHUNK)
        parts = [self._run(np.ascontiguousarray(points[start : start + CHUNK], np.float32)) for start in starts]
        counts = {part.shape[1] for part in parts}
        if len(counts) > 1:
            raise ShapeError(f"{self.path} returned {sorted(counts)} channels, expected one number; {_REMEDY}")
        return np.concatenate(parts) if parts else np.zeros((0, 1), np.float32)

    def _run(self, points: NDArray[np.float32]) -> NDArray[np.float32]:
        """One chunk."""
        try:
            (answer,) = self._session.run([self.output], {"points": points})
        except MODEL_ERRORS as error:
            reason = str(error).splitlines()[0][:200]
            raise InputError(f"{self.path}: the graph failed on {len(points)} points ({reason}); {_REMEDY}") from error
        values = np.asarray(answer)
        if values.ndim != 2 or len(values) != len(points) or values.shape[1] not in CHANNELS:
            found = f"{self.path} returned {values.shape} for {len(points)} points"
            raise ShapeError(f"{found}, expected ({len(points)}, 1 to 4); {_REMEDY}")
        if not np.isfinite(values).all():
            raise ShapeError(f"{self.path} returned NaN or infinite values, expected finite ones; mend the field")
        return values.astype(np.float32, copy=False)


def field_map(path: str | Path, *, name: str | None = None, encoding: Encoding = "linear") -> BakeMap:
    """A map of a field's values at the surface.

    Object space, in whatever units the field has; EXR float by default, PNG 8 bits for the other encodings (srgb:
    linear light in [0, 1]; unit: [0, 1]; signed: [−1, 1]; what lies beyond is clamped).

    Args:
        path: the .onnx file.
        name: of the map and in file names; the file's stem, with dashes for what no file name should have.
        encoding: how values are stored.

    Raises: as FieldSession.
    """
    session = FieldSession(path)
    plain = name or re.sub(r"[^A-Za-z0-9_]+", "-", Path(path).stem).strip("-") or "field"

    def compute(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
        del atlas, asset
        values = session.evaluate(gbuffer.position.reshape(-1, 3)[gbuffer.texels])
        height, width = gbuffer.shape
        result = np.zeros((height * width, values.shape[1]), np.float32)
        result[gbuffer.texels] = values
        return result.reshape(height, width, -1)

    ranges = {"linear": "any", "signed": "[-1, 1]"}
    black = (0.0, 0.0, 0.0)
    file_type, bits = ("exr", 32) if encoding == "linear" else ("png", 8)
    value_range = ranges.get(encoding, "[0, 1]")
    return BakeMap(plain, "object", "the field's own", value_range, encoding, file_type, bits, compute, black)


def _check_file(path: Path) -> None:
    """Raise unless a file of a sensible size lies there."""
    if not path.exists():
        raise MissingFileError(f"{path}: no such file, {_EXPECTED}; check the path")
    if not path.is_file():
        raise InputError(f"{path}: is no file, {_EXPECTED}; name the .onnx file")
    size = path.stat().st_size
    if not 0 < size <= MAX_BYTES:
        raise InputError(f"{path}: {size} bytes, expected 1 to {MAX_BYTES}; {_REMEDY}")


def _checked_signature(session: onnxruntime.InferenceSession, path: Path) -> str:
    """The name of the one output.  Raises InputError for other inputs and outputs than a field has."""
    inputs = [(node.name, node.type, list(node.shape)) for node in session.get_inputs()]
    outputs = [(node.name, node.type, list(node.shape)) for node in session.get_outputs()]
    found = f"{path}: {inputs} → {outputs}"
    right = len(inputs) == len(outputs) == 1 and inputs[0][0] == "points"
    if not right or {inputs[0][1], outputs[0][1]} != {"tensor(float)"}:
        raise InputError(f"{found}, {_EXPECTED}; {_REMEDY}")
    (count, *rest), answer = inputs[0][2] or [0], outputs[0][2]
    if isinstance(count, int) or len(rest) != 1 or (isinstance(rest[0], int) and rest[0] != 3):
        raise InputError(f"{found}, {_EXPECTED}; {_REMEDY}")
    if answer and (len(answer) != 2 or (isinstance(answer[1], int) and answer[1] not in CHANNELS)):
        raise InputError(f"{found}, {_EXPECTED}; {_REMEDY}")
    return outputs[0][0]

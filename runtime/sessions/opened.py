"""A file of flexpara, opened and checked: what both of its sessions stand on.

The graph subtracts or adds the frame's centre in float32.  A session does that in float64 instead and sets the graph's
own two centre initializers to zero: far from the origin no precision is lost.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np
import onnxruntime

from ..errors import BundleError, InputError, MissingDependencyError, MissingFileError
from .bundle import METADATA_KEY, BundleMetadata
from .chunks import checked_chunk, checked_threads
from .modelcheck import check_model
from .modelerrors import MODEL_ERRORS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

MAX_BYTES = 1 << 30
CENTRES = ("centre", "centre_rest")
_REMEDY = "pass the .onnx file that flexpara unwrap wrote"


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

    Raises: as BundleSession.
    """
    _check_file(path)
    _check_available(providers)
    zero = onnxruntime.OrtValue.ortvalue_from_numpy(np.zeros(3, dtype=np.float32))
    session = _load(path, providers, dict.fromkeys(CENTRES, zero))
    try:
        metadata = _read_metadata(session, path)
        _check_signature(session, path, inputs, outputs)
    except UnicodeDecodeError as error:
        raise BundleError(f"{path}: names or metadata that are no text, expected UTF-8; {_REMEDY}") from error
    _check_used(session, providers)
    return Opened(session, metadata, zero, path)


class BundleSession:
    """An exported map, ready to answer.  Immutable; it may be asked from several threads at once."""

    INPUTS: ClassVar[Mapping[str, str]]
    OUTPUTS: ClassVar[Mapping[str, str]]
    KIND: ClassVar[str | None] = None
    """What the metadata call such a file; None: a map from points, which has no name."""

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
            chunk: rows a run; what is in flight then stays in the processor's caches.
            threads: that answer a chunk each; None = one a core.

        Raises:
            MissingFileError: nothing lies at path.
            BundleError: no ONNX file, not written by flexpara, of another kind, damaged, or of another format version.
            MissingDependencyError: a provider is not in this build of onnxruntime or can't start here.
            InputError: chunk or threads below 1.
        """
        self._chunk, self._threads = checked_chunk(chunk), checked_threads(threads)
        self._opened = open_bundle(Path(path), providers, self.INPUTS, self.OUTPUTS)
        if self.KIND is not None:
            _check_kind(self._opened, self.KIND)

    @property
    def metadata(self) -> BundleMetadata:
        """What the file says about itself: frame, placement, source hash, settings, metrics, producer."""
        return self._opened.metadata

    @property
    def chart_count(self) -> int:
        """Number of charts, k."""
        return self._opened.metadata.chart_count


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
    """The model, checked, with some initializers replaced; the caller keeps those alive."""
    content = path.read_bytes()
    try:
        check_model(content, str(path))
    except BundleError as error:
        if path.suffix.lower() == ".onnx":
            raise
        raise BundleError(f"{path} is no ONNX model, expected an exported file; {_REMEDY}") from error
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 4
    options.intra_op_num_threads = 1  # chunks are shared out, see chunks.py
    for name, value in replaced.items():
        options.add_initializer(name, value)
    try:
        return onnxruntime.InferenceSession(content, options, providers=list(providers), enable_fallback=0)
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


def _check_kind(opened: Opened, expected: str) -> None:
    """The metadata have passed BundleMetadata.from_json: they are a JSON object."""
    kind = json.loads(opened.session.get_modelmeta().custom_metadata_map[METADATA_KEY]).get("kind")
    if kind != expected:
        found = f"{opened.path}: metadata of kind {str(kind)[:40]!r}"
        raise BundleError(f"{found}, expected {expected!r}; pass the .{expected}.onnx file")


def _check_used(session: onnxruntime.InferenceSession, providers: Sequence[str]) -> None:
    used = session.get_providers()
    if [name for name in used if name in providers] != list(providers):
        found = f"onnxruntime uses {', '.join(used)}"
        raise MissingDependencyError(f"{found}, expected {', '.join(providers)}; mend its drivers, or ask for the CPU")

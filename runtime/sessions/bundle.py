"""What an exported ONNX file says about itself: one JSON text under the key `flexpara` of its metadata_props.

k charts · p patches.  Written by export/, read by the session, both through `BundleMetadata`: there is one format.
Positions and the frame are in the units of the source file; uv are in [0, 1]², v up; size and padding are in texels.
A file may come from anywhere: nothing in the JSON is trusted before it is checked, and nothing in it is ever executed.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, NoReturn, cast

import numpy as np

from ..errors import BundleError, InputError
from ..mesh import Frame
from ..pagesize import PageSize

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ..pagesize import Size

METADATA_KEY = "flexpara"
FORMAT_VERSION = 1
CONVENTIONS = {
    "points": "float32 (n, 3), units of the source file, on or near its surface",
    "uv": "float32 (n, 2), atlas coordinates in [0, 1], origin bottom left, v up",
    "chart": "int64 (n), index into placement",
    "score": "float32 (n), in [0, 1]: how far chart and uv can be trusted",
    "placement": "rows of (2, 3): atlas uv = placement[:, :2] @ chart uv + placement[:, 2]",
    "frame": "the networks see (points - centre) / scale",
}
Placement = tuple[tuple[tuple[float, float, float], tuple[float, float, float]], ...]

_MAX_CHARS = 64 * 1024 * 1024
_MAX_COUNT = 1_000_000
LARGEST = 1 << 20
"""Texels of a side."""
_REMEDY = "export the file again with this version of flexpara"


@dataclass(frozen=True)
class BundleMetadata:
    """Everything known about an exported map besides its weights.

    chart_count, patch_count: k ≥ 1 and p ≥ 1.  frame: centre and scale, source units.
    placement: k rows of (2, 3), chart coordinates → atlas uv.  patch_chart: p chart indices.  size, padding: texels,
    the size a number for a square, else "WIDTHxHEIGHT".
    source_sha256: hex digest of the source file, "" when made in memory.  settings, metrics: JSON objects, as training
    reports them.  producer_name, producer_version: who wrote the file.
    """

    chart_count: int
    patch_count: int
    frame: Frame
    placement: Placement
    patch_chart: tuple[int, ...]
    size: Size
    padding: int
    source_sha256: str
    settings: Mapping[str, Any]
    metrics: Mapping[str, Any]
    producer_name: str
    producer_version: str
    format_version: int = FORMAT_VERSION

    def placement_array(self) -> NDArray[np.float64]:
        """(k, 2, 3) float64."""
        return np.asarray(self.placement, dtype=np.float64)

    def to_json(self) -> str:
        """One line of JSON with sorted keys: equal metadata give equal text.

        Raises:
            InputError: settings or metrics hold something JSON has no word for (NaN, an array, a path).
        """
        content = asdict(self)
        producer = {"name": content.pop("producer_name"), "version": content.pop("producer_version")}
        content |= {"producer": producer, "conventions": CONVENTIONS}
        try:
            return json.dumps(content, allow_nan=False, sort_keys=True, separators=(",", ":"))
        except (TypeError, ValueError) as error:
            message = f"metadata: {error}; expected settings and metrics of finite numbers, strings, lists and objects"
            raise InputError(f"{message}; convert them first") from error

    @classmethod
    def from_json(cls, text: str, name: str = "the file") -> BundleMetadata:
        """Read and check what `to_json` wrote; ``name`` is what error messages call the file.

        Raises:
            BundleError: not JSON, another format version, or a value that is missing, of the wrong kind or range.
        """
        reader = _Reader(name, _parse(text, name))
        version = reader.content.get("format_version")
        if version != FORMAT_VERSION or isinstance(version, bool):
            reader.fail("format_version", version, f"{FORMAT_VERSION}")
        charts = reader.integer(reader.content, "chart_count", 1, _MAX_COUNT)
        patches = reader.integer(reader.content, "patch_count", 1, _MAX_COUNT)
        producer = reader.mapping("producer")
        return cls(
            chart_count=charts,
            patch_count=patches,
            frame=reader.frame(),
            placement=reader.placement(charts),
            patch_chart=reader.patch_chart(patches, charts),
            size=reader.size(),
            padding=reader.integer(reader.content, "padding", 0, LARGEST),
            source_sha256=reader.text(reader.content, "source_sha256"),
            settings=reader.mapping("settings"),
            metrics=reader.mapping("metrics"),
            producer_name=reader.text(producer, "name"),
            producer_version=reader.text(producer, "version"),
        )


def _reject_constant(token: str) -> NoReturn:
    raise ValueError(f"{token} is not a number")


def _parse(text: str, name: str) -> dict[str, Any]:
    if len(text) > _MAX_CHARS:
        raise BundleError(f"{name}: {len(text)} characters of metadata, expected at most {_MAX_CHARS}; {_REMEDY}")
    try:
        content = json.loads(text, parse_constant=_reject_constant)
    except (ValueError, RecursionError) as error:
        reason = str(error).splitlines()[0]
        raise BundleError(f"{name}: flexpara metadata is no JSON ({reason}), expected an object; {_REMEDY}") from error
    if not isinstance(content, dict):
        raise BundleError(f"{name}: flexpara metadata is a {type(content).__name__}, expected an object; {_REMEDY}")
    return cast("dict[str, Any]", content)


@dataclass(frozen=True)
class _Reader:
    """Typed access to parsed JSON; each failure names the file, the key, the value found and what was expected."""

    name: str
    content: Mapping[str, Any]

    def fail(self, key: str, value: object, expected: str) -> NoReturn:
        found = repr(value)
        found = found if len(found) <= 60 else f"{found[:57]}..."
        raise BundleError(f"{self.name}: flexpara metadata has {key} = {found}, expected {expected}; {_REMEDY}")

    def integer(self, content: Mapping[str, Any], key: str, low: int, high: int) -> int:
        value = content.get(key)
        if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
            self.fail(key, value, f"an integer in [{low}, {high}]")
        return value

    def size(self) -> Size:
        """Of the atlas: texels of a square's side, or WIDTHxHEIGHT."""
        value = self.content.get("size")
        try:
            page = PageSize.of(self.integer(self.content, "size", 1, LARGEST) if not isinstance(value, str) else value)
        except InputError:
            page = PageSize(0, 0)
        if min(page) < 1 or page.side > LARGEST:
            self.fail("size", value, f"1 to {LARGEST} texels, or WIDTHxHEIGHT")
        return page.stored

    def text(self, content: Mapping[str, Any], key: str) -> str:
        value = content.get(key)
        if not isinstance(value, str):
            self.fail(key, value, "a string")
        return value

    def mapping(self, key: str) -> Mapping[str, Any]:
        value = self.content.get(key)
        if not isinstance(value, dict):
            self.fail(key, value, "an object")
        return cast("dict[str, Any]", value)

    def array(self, content: Mapping[str, Any], key: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
        """Finite numbers of exactly this shape."""
        value = content.get(key)
        try:
            found = np.asarray(value)
            numeric = found.dtype.kind in "iuf" and found.shape == shape
            array = found.astype(np.float64) if numeric else None
        except (ValueError, OverflowError):
            array = None
        if array is None or not np.isfinite(array).all():
            self.fail(key, value, f"finite numbers of shape {shape}")
        return array

    def frame(self) -> Frame:
        content = self.mapping("frame")
        x, y, z = self.array(content, "centre", (3,)).tolist()
        scale = float(self.array(content, "scale", ()))
        if not (scale > 0.0 and math.isfinite(1.0 / scale)):
            self.fail("frame.scale", scale, "a positive number")
        return Frame(centre=(x, y, z), scale=scale)

    def placement(self, charts: int) -> Placement:
        return nested_placement(self.array(self.content, "placement", (charts, 2, 3)))

    def patch_chart(self, patches: int, charts: int) -> tuple[int, ...]:
        found = self.array(self.content, "patch_chart", (patches,))
        if not ((found >= 0) & (found < charts) & (found == np.floor(found))).all():
            self.fail("patch_chart", self.content.get("patch_chart"), f"chart indices in [0, {charts})")
        return tuple(found.astype(np.int64).tolist())


def nested_placement(
    placement: NDArray[np.float64],
) -> Placement:
    """(k, 2, 3) array → nested tuples."""
    return tuple((tuple(u), tuple(v)) for u, v in placement.tolist())

"""The schemas of the documents describe what is written: the report, the ONNX file's metadata, the arrays."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

pytest.importorskip("onnx")
pytest.importorskip("igl")
pytest.importorskip("jsonschema")

import jsonschema
import onnx

from flexpara.__main__ import main
from flexpara.runtime.samples import make_sample

if TYPE_CHECKING:
    from collections.abc import Mapping

SCHEMAS = Path(__file__).resolve().parent.parent / "docs" / "reference" / "schemas"


def checked(name: str, value: object) -> None:
    """Raises where a value is not what the schema of this name says."""
    schema = json.loads((SCHEMAS / f"{name}-1.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.Draft202012Validator(schema).validate(value)


def described(arrays: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Types and shapes, with n for the vertices and f for the triangles."""
    sizes = {len(arrays["positions"]): "n", len(arrays["faces"]): "f"}
    return {
        name: {"dtype": values.dtype.name, "shape": [sizes.get(values.shape[0], values.shape[0]), *values.shape[1:]]}
        for name, values in arrays.items()
    }


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The output of one unwrap, maps and arrays included."""
    folder = tmp_path_factory.mktemp("schemas")
    vertices, faces = make_sample("sphere", resolution=8)
    lines = [f"v {x} {y} {z}" for x, y, z in vertices.tolist()] + [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
    (folder / "ball.obj").write_text("\n".join(lines), encoding="utf-8")
    words = ["--size", "64", "--maps", "position", "--format", "npz,glb", "--quiet"]
    assert main(["unwrap", str(folder / "ball.obj"), "-o", str(folder / "out"), *words]) == 0
    return folder / "out"


def test_a_report_is_what_its_schema_says(out: Path) -> None:
    report = json.loads((out / "ball.report.json").read_text(encoding="utf-8"))
    checked("report", report)
    for key in ("metrics", "files", "format_version"):
        less = copy.deepcopy(report)
        del less[key]
        with pytest.raises(jsonschema.ValidationError):
            checked("report", less)
    with pytest.raises(jsonschema.ValidationError):
        checked("report", report | {"undocumented": 1})
    with pytest.raises(jsonschema.ValidationError):
        checked("report", report | {"format_version": 2})


def test_the_metadata_of_the_onnx_file_are_what_their_schema_says(out: Path) -> None:
    texts = {entry.key: entry.value for entry in onnx.load(out / "ball.onnx").metadata_props}
    about = json.loads(texts["flexpara"])
    checked("metadata", about)
    with pytest.raises(jsonschema.ValidationError):
        checked("metadata", about | {"placement": [[[1.0, 0.0]]]})


def test_the_arrays_are_what_their_schema_says(out: Path) -> None:
    with np.load(out / "ball.npz", allow_pickle=False) as found:
        arrays = dict(found)
    checked("npz", described(arrays))
    with pytest.raises(jsonschema.ValidationError):
        checked("npz", described(arrays | {"uv": arrays["uv"].astype(np.float64)}))

"""A field's values land where its points lie, and files that are no fields are refused."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flexpara.bake.baker import bake
from flexpara.bake.maps.field import CHUNK, FieldSession, field_map
from flexpara.runtime.errors import InputError, MissingFileError, ShapeError
from flexpara.runtime.mesh import Asset, Atlas

Pair = tuple[Atlas, Asset]

onnx = pytest.importorskip("onnx")


def write_field(
    path: Path, matrix: Any, *, points: Any = ("n", 3), out: Any = None, kind: int = 1, **names: str
) -> Path:
    """Values = points · matrix (3, c)."""
    weights = np.asarray(matrix, np.float32)
    helper = onnx.helper
    source, target = names.get("source", "points"), names.get("target", "color")
    node = helper.make_node("MatMul", [source, "weights"], [target])
    graph = helper.make_graph(
        [node],
        "field",
        [helper.make_tensor_value_info(source, kind, points)],
        [helper.make_tensor_value_info(target, kind, out or ("n", weights.shape[1]))],
        [onnx.numpy_helper.from_array(weights if kind == 1 else weights.astype(np.float64), "weights")],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    path.write_bytes(model.SerializeToString())
    return path


def test_each_texel_holds_the_field_at_its_point(sphere: Pair, tmp_path: Path) -> None:
    matrix = np.random.default_rng(0).normal(size=(3, 2))
    entry = field_map(write_field(tmp_path / "my field.onnx", matrix))
    assert (entry.name, entry.file_type, entry.bits) == ("my-field", "exr", 32)
    textures = bake(*sphere, ["position", entry], size=32, padding=0)
    position, values = textures["position"].pixels, textures["my-field"].pixels
    np.testing.assert_allclose(values, position @ matrix.astype(np.float32), atol=1e-5)


def test_colours_are_stored_as_png(quad: Pair, tmp_path: Path) -> None:
    entry = field_map(write_field(tmp_path / "a.onnx", np.eye(3)), name="tint", encoding="srgb")
    texture = bake(*quad, [entry], size=8)["tint"]
    assert (texture.encoding, texture.file_type, texture.bits) == ("srgb", "png", 8)


def test_many_points_go_through_in_chunks(tmp_path: Path) -> None:
    session = FieldSession(write_field(tmp_path / "a.onnx", np.ones((3, 1))))
    points = np.random.default_rng(1).random((2 * CHUNK + 5, 3)).astype(np.float32)
    np.testing.assert_allclose(session.evaluate(points)[:, 0], points.sum(axis=1), rtol=1e-5)
    assert session.evaluate(points[:0]).shape == (0, 1)


def test_what_is_no_onnx_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="no such file"):
        FieldSession(tmp_path / "none.onnx")
    with pytest.raises(InputError, match="is no file"):
        FieldSession(tmp_path)
    (tmp_path / "empty.onnx").touch()
    with pytest.raises(InputError, match="0 bytes"):
        FieldSession(tmp_path / "empty.onnx")
    (tmp_path / "noise.onnx").write_bytes(bytes(range(200)))
    with pytest.raises(InputError, match="no usable ONNX model"):
        FieldSession(tmp_path / "noise.onnx")


@pytest.mark.parametrize(
    "changes",
    [
        {"source": "xyz"},
        {"points": ("n", 4), "matrix": np.ones((4, 1))},
        {"points": (7, 3), "out": (7, 1)},
        {"points": ("b", "n", 3), "out": ("b", "n", 1)},
        {"matrix": np.ones((3, 5))},
        {"kind": 11},
    ],
)
def test_another_signature_is_refused(tmp_path: Path, changes: dict[str, Any]) -> None:
    path = write_field(tmp_path / "a.onnx", **{"matrix": np.ones((3, 1)), **changes})
    with pytest.raises(InputError, match=r"expected an ONNX graph of one input points float32 \(n, 3\)"):
        FieldSession(path)


def test_answers_are_checked(tmp_path: Path) -> None:
    session = FieldSession(write_field(tmp_path / "a.onnx", np.ones((3, 1)), out=("n", "c")))
    with pytest.raises(ShapeError, match="NaN or infinite"):
        session.evaluate(np.full((2, 3), np.inf, np.float32))
    session._session = SimpleNamespace(run=lambda *_: [np.zeros((2, 6), np.float32)])  # type: ignore[assignment]
    with pytest.raises(ShapeError, match=r"returned \(2, 6\) for 2 points"):
        session.evaluate(np.zeros((2, 3), np.float32))

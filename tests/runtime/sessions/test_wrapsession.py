"""The inverse session, on files with a closed form: points = centre + scale · (u, v, chart), normals = ±z by chart."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexpara.export.graph.builder import Ends, GraphBuilder, Header
from flexpara.runtime.errors import BundleError, InputError, MissingDependencyError, MissingFileError, ShapeError
from flexpara.runtime.mesh import Frame
from flexpara.runtime.sessions.bundle import METADATA_KEY, BundleMetadata
from flexpara.runtime.sessions.session import UnwrapSession
from flexpara.runtime.sessions.wrapsession import WrapSession, wrap_json

FRAME = Frame(centre=(1_000_000.1, -2_000_000.2, 0.3), scale=2.0)
FACTS = BundleMetadata(
    chart_count=2,
    patch_count=2,
    frame=FRAME,
    placement=(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),) * 2,
    patch_chart=(0, 1),
    size=256,
    padding=2,
    source_sha256="c0ffee",
    settings={"seed": 3},
    metrics={},
    producer_name="flexpara",
    producer_version="0.1.0",
)
OUTPUTS: Ends = {"points": ("float32", ["n", 3]), "normals": ("float32", ["n", 3])}


def closed_form(metadata: dict[str, str], outputs: Ends | None = None, *, uv: str = "uv") -> bytes:
    """An ONNX file as flexpara writes it, with arithmetic in place of networks."""
    builder = GraphBuilder()
    height = builder.op("Unsqueeze", builder.op("Cast", "chart", to=1), builder.axes(1))
    xyz = builder.op("Concat", uv, height, axis=1)
    away = builder.op("Mul", xyz, builder.constant(np.asarray(FRAME.scale, np.float32)))
    near = builder.op("Add", away, builder.named("centre_rest", np.zeros(3, np.float32)))
    builder.op("Add", near, builder.named("centre", np.asarray(FRAME.centre, np.float32)), name="points")
    one, two, zero = (builder.constant(np.asarray(value, np.float32)) for value in (1.0, 2.0, 0.0))
    up = builder.op("Sub", one, builder.op("Mul", height, two))
    flat = builder.op("Mul", uv, zero)
    builder.op("Concat", flat, up, axis=1, name="normals")
    return builder.serialize(
        {uv: ("float32", ["n", 2]), "chart": ("int64", ["n"])},
        outputs or OUTPUTS,
        Header(18, 8, ("a test", "0"), metadata),
    )


@pytest.fixture
def inverse(tmp_path: Path) -> Path:
    path = tmp_path / "map.wrap.onnx"
    path.write_bytes(closed_form({METADATA_KEY: wrap_json(FACTS)}))
    return path


def rows(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Atlas uv (count, 2) and charts (count,)."""
    rng = np.random.default_rng(0)
    return rng.random((count, 2)), rng.integers(2, size=count)


def test_one_uv_by_hand(inverse: Path) -> None:
    points, normals = WrapSession(inverse).wrap(np.array([[0.25, 0.5]]), np.array([1]))
    assert points.tolist() == [[1_000_000.1 + 0.5, -2_000_000.2 + 1.0, 0.3 + 2.0]]
    assert normals.tolist() == [[0.0, 0.0, -1.0]]
    assert (points.dtype, normals.dtype) == (np.float64, np.float32)


@pytest.mark.parametrize("chunk", [1, 7, 100])
def test_chunks_do_not_change_the_answer(inverse: Path, chunk: int) -> None:
    uv, chart = rows(50)
    whole, parts = WrapSession(inverse).wrap(uv, chart), WrapSession(inverse, chunk=chunk).wrap(uv, chart)
    assert all(np.array_equal(a, b) for a, b in zip(whole, parts, strict=True))


def test_points_far_from_the_origin_keep_their_precision(inverse: Path) -> None:
    uv, chart = rows(50)
    truth = np.asarray(FRAME.centre) + 2.0 * np.concatenate([uv, chart[:, None]], axis=1)
    assert np.abs(WrapSession(inverse).wrap(uv, chart).points - truth).max() < 1e-6


def test_no_rows_give_empty_arrays(inverse: Path) -> None:
    points, normals = WrapSession(inverse).wrap(np.zeros((0, 2), np.float32), np.zeros(0, np.int64))
    assert (points.shape, normals.shape) == ((0, 3), (0, 3))


@pytest.mark.parametrize("dtype", [np.int32, np.uint8, np.int64])
def test_charts_may_be_any_integers(inverse: Path, dtype: Any) -> None:
    uv, chart = rows(5)
    assert np.array_equal(
        WrapSession(inverse).wrap(uv, chart.astype(dtype)).points, WrapSession(inverse).wrap(uv, chart).points
    )


def test_the_file_says_what_it_is(inverse: Path) -> None:
    session = WrapSession(inverse)
    assert (session.metadata, session.chart_count) == (FACTS, 2)
    content = json.loads(wrap_json(FACTS))
    assert content["kind"] == "wrap"
    assert set(content["conventions"]) >= {"uv", "chart", "points", "normals"}


@pytest.mark.parametrize(
    ("uv", "chart", "message"),
    [
        (np.zeros((2, 5)), np.zeros(5, np.int64), r"uv of shape \(2, 5\) float64, .* pass uv.T"),
        (np.zeros((5, 3)), np.zeros(5, np.int64), "convert them"),
        (np.zeros((5, 2), np.int64), np.zeros(5, np.int64), "int64, expected"),
        (np.zeros((5, 2)), np.zeros(4, np.int64), r"chart of shape \(4,\) int64, expected \(5,\)"),
        (np.zeros((5, 2)), np.zeros((5, 1), np.int64), r"chart of shape \(5, 1\)"),
        (np.zeros((5, 2)), np.zeros(5), "float64, expected"),
    ],
)
def test_rows_of_another_shape_or_type_are_refused(inverse: Path, uv: Any, chart: Any, message: str) -> None:
    with pytest.raises(ShapeError, match=message):
        WrapSession(inverse).wrap(uv, chart)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -0.01, 1.01, 512.0])
def test_uv_outside_the_atlas_are_counted(inverse: Path, bad: float) -> None:
    uv, chart = rows(10)
    uv[[4, 6], 1] = bad
    with pytest.raises(InputError, match=r"2 of 10 uv are outside \[0, 1\] \(row 4: .* divide texels"):
        WrapSession(inverse).wrap(uv, chart)


def test_uv_outside_by_rounding_are_fine(inverse: Path) -> None:
    uv = np.array([[1.0 + 1e-7, -1e-7]])
    assert np.isfinite(WrapSession(inverse).wrap(uv, np.array([0])).points).all()


@pytest.mark.parametrize("bad", [-1, 2, 1 << 40])
def test_charts_that_do_not_exist_are_counted(inverse: Path, bad: int) -> None:
    uv, chart = rows(10)
    chart[[3, 8]] = bad
    with pytest.raises(InputError, match=rf"2 of 10 charts do not exist \(row 3: {bad}\), expected .* \[0, 2\)"):
        WrapSession(inverse).wrap(uv, chart)


WITH_METADATA = closed_form({METADATA_KEY: wrap_json(FACTS)})
DAMAGED: dict[str, tuple[Callable[[], bytes], str]] = {
    "empty": (lambda: b"", "0 bytes"),
    "random": (lambda: np.random.default_rng(0).bytes(4096), "no usable ONNX model"),
    "half": (lambda: WITH_METADATA[: len(WITH_METADATA) // 2], "no usable ONNX model"),
    "another tool's": (lambda: closed_form({}), "an ONNX model by a test, expected metadata `flexpara`"),
    "no kind": (lambda: closed_form({METADATA_KEY: FACTS.to_json()}), "metadata of kind 'None', expected 'wrap'"),
    "another version": (
        lambda: closed_form({METADATA_KEY: wrap_json(dataclasses.replace(FACTS, format_version=99))}),
        "format_version = 99, expected 1",
    ),
    "no JSON": (lambda: closed_form({METADATA_KEY: "ceci n'est pas"}), "no JSON"),
    "other outputs": (
        lambda: closed_form({METADATA_KEY: wrap_json(FACTS)}, {"points": OUTPUTS["points"]}),
        "expected {'uv': 'tensor",
    ),
    "another input": (lambda: closed_form({METADATA_KEY: wrap_json(FACTS)}, uv="st"), "{'st': 'tensor"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_file_that_is_not_an_inverse_of_ours_is_refused_in_one_line(tmp_path: Path, name: str) -> None:
    make, message = DAMAGED[name]
    path = tmp_path / "bad.onnx"
    path.write_bytes(make())
    with pytest.raises(BundleError, match=r"bad\.onnx: ") as caught:
        WrapSession(path)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_forward_session_refuses_an_inverse(inverse: Path) -> None:
    with pytest.raises(BundleError, match=r"expected \{'points'"):
        UnwrapSession(inverse)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match=r"nowhere\.onnx: no such file"):
        WrapSession(tmp_path / "nowhere.onnx")


def test_a_provider_that_is_not_there_is_an_error(inverse: Path) -> None:
    with pytest.raises(MissingDependencyError, match="NoSuchProvider not in this onnxruntime"):
        WrapSession(inverse, providers=("NoSuchProvider",))


@pytest.mark.parametrize("options", [{"chunk": 0}, {"threads": 0}], ids=str)
def test_a_chunk_or_thread_count_below_one_is_refused(inverse: Path, options: dict[str, int]) -> None:
    with pytest.raises(InputError, match="expected at least 1"):
        WrapSession(inverse, **options)  # type: ignore[arg-type]

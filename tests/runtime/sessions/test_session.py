"""The session, on files with a closed form: uv = ½ + ¼ (x, y) of the unit ball, chart = x > 0, score = |z|."""

from __future__ import annotations

import dataclasses
import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
import pytest

from flexpara.export.graph.builder import GraphBuilder, Header
from flexpara.runtime.errors import BundleError, InputError, MissingDependencyError, MissingFileError, ShapeError
from flexpara.runtime.mesh import Frame
from flexpara.runtime.sessions.bundle import METADATA_KEY, BundleMetadata
from flexpara.runtime.sessions.session import UnwrapSession

FRAME = Frame(centre=(1_000_000.1, -2_000_000.2, 0.3), scale=2.0)
FACTS = BundleMetadata(
    chart_count=2,
    patch_count=2,
    frame=FRAME,
    placement=(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),) * 2,
    patch_chart=(0, 1),
    size=256,
    padding=2,
    source_sha256="",
    settings={"seed": 3},
    metrics={},
    producer_name="flexpara",
    producer_version="0.1.0",
)
OUTPUTS: dict[str, tuple[str, list[str | int]]] = {
    "uv": ("float32", ["n", 2]),
    "chart": ("int64", ["n"]),
    "score": ("float32", ["n"]),
}


def closed_form(metadata: dict[str, str], outputs: Any = None, *, points: str = "points") -> bytes:
    """An ONNX file as flexpara writes it, with arithmetic in place of networks."""
    builder = GraphBuilder()
    centre = np.asarray(FRAME.centre)
    near = builder.op("Sub", points, builder.named("centre", centre.astype(np.float32)))
    rest = (centre - centre.astype(np.float32)).astype(np.float32)
    exact = builder.op("Sub", near, builder.named("centre_rest", rest))
    xyz = builder.op("Div", exact, builder.named("scale", np.asarray(FRAME.scale, np.float32)))
    x, y, z = (builder.op("Gather", xyz, builder.constant(np.asarray(axis, np.int64)), axis=1) for axis in range(3))
    one = builder.axes(1)
    pair = builder.op("Concat", builder.op("Unsqueeze", x, one), builder.op("Unsqueeze", y, one), axis=1)
    quarter, half, zero = (builder.constant(np.asarray(value, np.float32)) for value in (0.25, 0.5, 0.0))
    builder.op("Add", builder.op("Mul", pair, quarter), half, name="uv")
    builder.op("Cast", builder.op("Greater", x, zero), name="chart", to=7)
    builder.op("Abs", z, name="score")
    return builder.serialize(
        {points: ("float32", ["n", 3])},
        outputs or OUTPUTS,
        Header(18, 8, ("a test", "0"), metadata),
    )


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    path = tmp_path / "map.onnx"
    path.write_bytes(closed_form({METADATA_KEY: FACTS.to_json()}))
    return path


def ball_points(count: int) -> np.ndarray:
    """(count, 3) float64 in the unit ball."""
    return np.random.default_rng(0).uniform(-0.57, 0.57, (count, 3))


def test_one_point_by_hand(bundle: Path) -> None:
    point = np.asarray([FRAME.centre]) + np.asarray([[1.0, -1.0, 0.5]])
    uv, chart, score = UnwrapSession(bundle).unwrap(point)
    assert (uv.dtype, chart.dtype, score.dtype) == (np.float32, np.int64, np.float32)
    assert uv == pytest.approx(np.array([[0.625, 0.375]]), abs=1e-6)
    assert (chart.tolist(), score.tolist()) == ([1], pytest.approx([0.25], abs=1e-6))


@pytest.mark.parametrize("chunk", [1, 7, 100, 101, 10_000])
def test_chunks_do_not_change_the_answer(bundle: Path, chunk: int) -> None:
    ball = ball_points(100)
    uv, chart, score = UnwrapSession(bundle, chunk=chunk, threads=1).unwrap(ball * 2.0 + np.asarray(FRAME.centre))
    assert uv == pytest.approx(0.5 + 0.25 * ball[:, :2], abs=1e-6)
    assert np.array_equal(chart, (ball[:, 0] > 0).astype(np.int64))
    assert score == pytest.approx(np.abs(ball[:, 2]), abs=1e-6)


def test_float64_points_far_from_the_origin_keep_their_precision(bundle: Path) -> None:
    ball = ball_points(1000)
    points = ball * 2.0 + np.asarray(FRAME.centre)
    found = UnwrapSession(bundle).unwrap(points).uv
    assert np.abs(found - (0.5 + 0.25 * ball[:, :2])).max() < 1e-7
    session = onnxruntime.InferenceSession(bundle, providers=["CPUExecutionProvider"])
    rounded = np.asarray(session.run(["uv"], {"points": points.astype(np.float32)})[0])
    assert np.abs(rounded - found).max() > 1e-3  # what float32 points lose there, so the test above can fail


def test_float32_points_are_taken_at_their_value(bundle: Path) -> None:
    points = (ball_points(100) * 2.0 + np.asarray(FRAME.centre)).astype(np.float32)
    session = UnwrapSession(bundle)
    assert np.array_equal(session.unwrap(points).uv, session.unwrap(points.astype(np.float64)).uv)
    plain = onnxruntime.InferenceSession(bundle, providers=["CPUExecutionProvider"])
    assert np.asarray(plain.run(["uv"], {"points": points})[0]) == pytest.approx(session.unwrap(points).uv, abs=1e-6)


def test_many_sessions_in_turn_give_the_same_answer(bundle: Path) -> None:
    """What a session replaces in the graph lives as long as the session does."""
    point = np.asarray([FRAME.centre]) + np.asarray([[1.0, -1.0, 0.5]])
    sessions = [UnwrapSession(bundle, threads=1) for _ in range(30)]
    litter = [np.full(3, 1e5 + i, np.float32) for i in range(1000)]
    assert all(session.unwrap(point).uv == pytest.approx(np.array([[0.625, 0.375]])) for session in sessions)
    assert len(litter) == 1000


def test_no_points_give_empty_arrays(bundle: Path) -> None:
    uv, chart, score = UnwrapSession(bundle).unwrap(np.zeros((0, 3), np.float32))
    assert (uv.shape, chart.shape, score.shape) == ((0, 2), (0,), (0,))


def test_strided_points_are_read_right(bundle: Path) -> None:
    wide = np.tile(ball_points(50) * 2.0 + np.asarray(FRAME.centre), (1, 2))
    session = UnwrapSession(bundle)
    assert np.array_equal(session.unwrap(wide[::-2, 3:]).uv, session.unwrap(wide[::-2, 3:].copy()).uv)


def test_points_are_not_changed(bundle: Path) -> None:
    points = ball_points(5) + np.asarray(FRAME.centre)
    before = points.copy()
    UnwrapSession(bundle).unwrap(points)
    assert np.array_equal(points, before)


def test_the_file_says_what_it_is(bundle: Path) -> None:
    session = UnwrapSession(str(bundle))
    assert (session.metadata, session.chart_count) == (FACTS, 2)


def test_threads_may_share_a_session(bundle: Path) -> None:
    session = UnwrapSession(bundle, chunk=64)
    batches = [np.asarray(FRAME.centre) + ball_points(500) * scale for scale in (0.25, 0.5, 1.0, 2.0)]
    found: list[Any] = [None] * 4

    def work(i: int) -> None:
        found[i] = session.unwrap(batches[i]).uv

    workers = [threading.Thread(target=work, args=(i,)) for i in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert all(np.array_equal(found[i], session.unwrap(batches[i]).uv) for i in range(4))


@pytest.mark.parametrize(
    ("points", "hint"),
    [
        (np.zeros((3, 12)), r"\(3, 12\) float64, expected \(n, 3\) float32 or float64; pass points.T"),
        (np.zeros(3), r"\(3,\) float64"),
        (np.zeros((2, 2)), r"\(2, 2\)"),
        (np.zeros((1, 2, 3)), r"\(1, 2, 3\)"),
        (np.zeros((4, 3), np.int64), "int64, expected .*; convert it"),
        (np.zeros((4, 3), np.float16), "float16"),
        (np.zeros((4, 3), dtype="U3"), "<U3"),
    ],
    ids=lambda value: None if isinstance(value, str) else f"{value.shape} {value.dtype}",
)
def test_points_of_another_shape_or_type_are_refused(bundle: Path, points: Any, hint: str) -> None:
    with pytest.raises(ShapeError, match=hint):
        UnwrapSession(bundle).unwrap(points)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_points_that_are_not_finite_are_counted(bundle: Path, bad: float) -> None:
    points = ball_points(10) + np.asarray(FRAME.centre)
    points[[4, 7], 1] = bad
    with pytest.raises(InputError, match=r"2 of 10 points are NaN or infinite \(first: 4\)"):
        UnwrapSession(bundle).unwrap(points)


@pytest.mark.parametrize("far", [1e9, 1e300])
def test_points_in_another_unit_are_named(bundle: Path, far: float) -> None:
    points = ball_points(10) + np.asarray(FRAME.centre)
    points[6, 2] = far
    with pytest.raises(InputError, match=r"point 6 = .* use the units"):
        UnwrapSession(bundle, chunk=4).unwrap(points)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match=r"nowhere\.onnx: no such file"):
        UnwrapSession(tmp_path / "nowhere.onnx")


WITH_METADATA = closed_form({METADATA_KEY: FACTS.to_json()})
DAMAGED: dict[str, tuple[Callable[[], bytes], str]] = {
    "empty": (lambda: b"", "0 bytes"),
    "random": (lambda: np.random.default_rng(0).bytes(4096), "no usable ONNX model"),
    "text": (lambda: b"solid cube\nfacet normal 0 0 0\n" * 20, "no usable ONNX model"),
    "without its end": (lambda: WITH_METADATA[:-1], "no usable ONNX model"),
    "half": (lambda: WITH_METADATA[: len(WITH_METADATA) // 2], "no usable ONNX model"),
    "another tool's": (lambda: closed_form({}), "an ONNX model by a test, expected metadata `flexpara`"),
    "another key": (lambda: closed_form({"names": "{0: 'cat'}"}), "expected metadata `flexpara`"),
    "another version": (
        lambda: closed_form({METADATA_KEY: dataclasses.replace(FACTS, format_version=99).to_json()}),
        "format_version = 99, expected 1",
    ),
    "no JSON": (lambda: closed_form({METADATA_KEY: "ceci n'est pas"}), "no JSON"),
    "absurd JSON": (
        lambda: closed_form({METADATA_KEY: '{"format_version": 1, "chart_count": -7}'}),
        "chart_count = -7",
    ),
    "other outputs": (
        lambda: closed_form({METADATA_KEY: FACTS.to_json()}, {"uv": OUTPUTS["uv"]}),
        "expected {'points': 'tensor",
    ),
    "another input": (lambda: closed_form({METADATA_KEY: FACTS.to_json()}, points="xyz"), "{'xyz': 'tensor"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_file_that_is_not_ours_is_refused_in_one_line(
    tmp_path: Path, name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    make, message = DAMAGED[name]
    path = tmp_path / "bad.onnx"
    path.write_bytes(make())
    with pytest.raises(BundleError, match=r"bad\.onnx: ") as caught:
        UnwrapSession(path)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert tuple(capfd.readouterr()) == ("", "")


@pytest.mark.parametrize("length", range(0, len(WITH_METADATA), 37))
def test_a_file_cut_anywhere_is_refused(tmp_path: Path, length: int) -> None:
    (tmp_path / "cut.onnx").write_bytes(WITH_METADATA[:length])
    with pytest.raises(BundleError):
        UnwrapSession(tmp_path / "cut.onnx")


def test_a_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BundleError, match="is no file"):
        UnwrapSession(tmp_path)


def test_a_file_of_absurd_size_is_not_read(tmp_path: Path) -> None:
    with (tmp_path / "huge.onnx").open("wb") as file:
        os.truncate(file.fileno(), 3 << 30)
    with pytest.raises(BundleError, match="3221225472 bytes, expected 1 to"):
        UnwrapSession(tmp_path / "huge.onnx")


def test_a_provider_that_is_not_there_is_an_error(bundle: Path) -> None:
    with pytest.raises(MissingDependencyError, match=r"NoSuchProvider not in this onnxruntime .* install the build"):
        UnwrapSession(bundle, providers=("NoSuchProvider", "CPUExecutionProvider"))


def test_a_provider_that_is_not_used_is_an_error(bundle: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    listed = [*onnxruntime.get_available_providers(), "CUDAExecutionProvider"]
    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: listed)
    load = onnxruntime.InferenceSession
    monkeypatch.setattr(
        onnxruntime,
        "InferenceSession",
        lambda path, options, providers, **more: load(path, options, providers=providers[1:], **more),
    )
    with pytest.raises(MissingDependencyError, match="uses CPUExecutionProvider, expected CUDAExecutionProvider"):
        UnwrapSession(bundle, providers=("CUDAExecutionProvider", "CPUExecutionProvider"))


@pytest.mark.parametrize("providers", [(), "CPUExecutionProvider"])
def test_providers_are_a_list_of_names(bundle: Path, providers: Any) -> None:
    with pytest.raises(InputError, match="expected a list of names"):
        UnwrapSession(bundle, providers=providers)


@pytest.mark.parametrize("options", [{"chunk": 0}, {"threads": 0}, {"threads": -2}], ids=str)
def test_a_chunk_or_thread_count_below_one_is_refused(bundle: Path, options: dict[str, int]) -> None:
    with pytest.raises(InputError, match="expected at least 1"):
        UnwrapSession(bundle, **options)  # type: ignore[arg-type]


def test_answers_that_are_not_finite_are_refused(tmp_path: Path) -> None:
    quarter, broken = (np.float32(value).tobytes() for value in (0.25, np.nan))
    assert WITH_METADATA.count(quarter) == 1
    (tmp_path / "a.onnx").write_bytes(WITH_METADATA.replace(quarter, broken))
    session = UnwrapSession(tmp_path / "a.onnx")
    with pytest.raises(BundleError, match=r"a\.onnx: the model answers uv = NaN or infinite.*damaged"):
        session.unwrap(np.asarray([FRAME.centre]))


def test_text_that_is_none_inside_a_model_is_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert WITH_METADATA.count(b"Cast") == 1
    (tmp_path / "a.onnx").write_bytes(WITH_METADATA.replace(b"Cast", b"C\x8f\xffs"))
    with pytest.raises(BundleError, match="uses the operator"):
        UnwrapSession(tmp_path / "a.onnx")
    assert tuple(capfd.readouterr()) == ("", "")


def test_metadata_that_are_no_text_are_refused(tmp_path: Path) -> None:
    content = closed_form({METADATA_KEY: FACTS.to_json()})
    (tmp_path / "a.onnx").write_bytes(content.replace(b'"seed":3', b'"see\xff":3'))
    with pytest.raises(BundleError, match="no text"):
        UnwrapSession(tmp_path / "a.onnx")

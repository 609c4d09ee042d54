"""What training found, written and read back; and files that are not that."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import safetensors
from numpy.typing import NDArray
from safetensors import numpy as safetensors_numpy

from flexpara.runtime.errors import InputError, MissingFileError
from flexpara.runtime.mesh import Asset, Charts, Frame, Surface
from flexpara.train.deploy.config import FitConfig
from flexpara.train.deploy.fit import fit_networks
from flexpara.train.pipeline import Trained
from flexpara.train.saved import read_trained, to_bytes
from flexpara.train.workers import Beside

if TYPE_CHECKING:
    from pathlib import Path

VERTICES = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])
SURFACE = Surface(VERTICES, FACES)
CHARTS = Charts(np.array([0, 1]), SURFACE.triangles[..., :2], np.array([0, 1]), np.array([0, 1]), ("slim", "slit"))
NETWORKS = fit_networks(
    Surface(Frame.of(VERTICES).apply(VERTICES), FACES),
    CHARTS,
    FitConfig(),
    0,
)


def asset(sha256: str = "ab") -> Asset:
    return Asset(VERTICES, FACES, np.arange(4), SURFACE, sha256=sha256, stem="card")


def trained() -> Trained:
    return Trained(CHARTS, Beside.known(NETWORKS), Frame.of(VERTICES), {"seed": 3}, {"experts": 2})


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "card.trained.safetensors"
    path.write_bytes(to_bytes(trained(), "ab"))
    return path


def test_what_was_trained_comes_back_bit_for_bit(file: Path) -> None:
    before, after = trained(), read_trained(file, asset())
    for name in ("face_chart", "corner_uv", "face_patch", "patch_chart"):
        np.testing.assert_array_equal(getattr(before.charts, name), getattr(after.charts, name))
    assert (after.charts.method, after.frame) == (before.charts.method, before.frame)
    assert (after.settings, after.report) == (before.settings, before.report)
    for name in ("start", "gates", "sides", "depth", "weights", "label", "centre", "radius", "share"):
        np.testing.assert_array_equal(getattr(before.networks, name), getattr(after.networks, name))
    for name in ("low", "cell", "shape"):
        np.testing.assert_array_equal(getattr(before.networks.grid, name), getattr(after.networks.grid, name))
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (50, 3)).astype(np.float32)
    assert np.array_equal(before.networks(points).value, after.networks(points).value)


def test_the_same_training_gives_the_same_bytes() -> None:
    assert to_bytes(trained(), "ab") == to_bytes(trained(), "ab")


def test_another_mesh_is_refused(file: Path) -> None:
    with pytest.raises(InputError, match="belongs to another mesh"):
        read_trained(file, asset("cd"))


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="no such file"):
        read_trained(tmp_path / "none", asset())


@pytest.mark.parametrize("content", [b"", b"\x00" * 64, b"\xff" * 64, json.dumps({"format": 1}).encode()])
def test_what_is_no_such_file_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "x.safetensors"
    path.write_bytes(content)
    with pytest.raises(InputError, match="train again"):
        read_trained(path, asset())


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("charts.face_chart", np.array([0, 2])),
        ("charts.face_chart", np.array([0, -1])),
        ("charts.face_chart", np.array([0])),
        ("charts.face_patch", np.array([0, 2])),
        ("charts.patch_chart", np.array([0, 9])),
        ("charts.corner_uv", np.zeros((2, 3, 2), np.float32)),
        ("charts.corner_uv", np.full((2, 3, 2), np.nan)),
        ("grid.shape", np.array([1 << 12, 1 << 12, 1])),
        ("grid.shape", np.array([0, 1, 1])),
        ("grid.cell", np.zeros(3, np.float32)),
        ("networks.start", np.zeros(3, np.int32)),
        ("networks.start", NETWORKS.start - 99),
        ("networks.sides", NETWORKS.sides + 99999),
        ("networks.sides", np.zeros_like(NETWORKS.sides)),
        ("networks.weights", np.full_like(NETWORKS.weights, np.inf)),
        ("networks.weights", NETWORKS.weights[:, :1].copy()),
        ("networks.label", NETWORKS.label + 7),
        ("networks.label", NETWORKS.label[:0].copy()),
    ],
)
def test_arrays_that_do_not_fit_are_refused(name: str, value: NDArray[Any], file: Path) -> None:
    rewrite(file, arrays={name: value})
    with pytest.raises(InputError, match="train again"):
        read_trained(file, asset())


@pytest.mark.parametrize(
    "facts",
    [
        {"format": "flexpara-trained-0"},
        {"format": "flexpara-trained-1"},
        {"depth": 0},
        {"depth": 10**9},
        {"depth": "deep"},
        {"frame": {"centre": [0.0, 0.0], "scale": 1.0}},
        {"frame": {"centre": [0.0, 0.0, 0.0], "scale": 0.0}},
        {"methods": []},
        {"settings": 3},
    ],
)
def test_a_header_that_does_not_fit_is_refused(facts: dict[str, Any], file: Path) -> None:
    rewrite(file, facts=facts)
    with pytest.raises(InputError, match="train again"):
        read_trained(file, asset())


def rewrite(path: Path, *, arrays: dict[str, Any] | None = None, facts: dict[str, Any] | None = None) -> None:
    """The file with some of its parts replaced."""
    with safetensors.safe_open(path, "np") as file:
        header = json.loads(file.metadata()["flexpara"])
        parts = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    text = json.dumps({**header, **(facts or {})})
    path.write_bytes(safetensors_numpy.save({**parts, **(arrays or {})}, {"flexpara": text}))

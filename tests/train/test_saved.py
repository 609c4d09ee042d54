"""What training found, written and read back; and files that are not that."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import safetensors
import torch
from safetensors import torch as safetensors_torch

from flexpara.runtime.errors import InputError, MissingFileError
from flexpara.runtime.mesh import Asset, Charts, Frame, Surface
from flexpara.train.config import NetConfig
from flexpara.train.learn.networks import AtlasNetworks
from flexpara.train.pipeline import Trained
from flexpara.train.saved import read_trained, to_bytes

if TYPE_CHECKING:
    from pathlib import Path

VERTICES = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])
SURFACE = Surface(VERTICES, FACES)
NET = NetConfig(width=8, assign_width=8)


def asset(sha256: str = "ab") -> Asset:
    return Asset(VERTICES, FACES, np.arange(4), SURFACE, sha256=sha256, stem="card")


def trained() -> Trained:
    charts = Charts(np.array([0, 1]), SURFACE.triangles[..., :2], np.array([0, 1]), np.array([0, 1]), ("slim", "slit"))
    networks = AtlasNetworks(2, NET, generator=torch.Generator().manual_seed(1))
    return Trained(charts, networks, Frame.of(VERTICES), {"seed": 3}, {"patches": 2})


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
    for one, two in zip(before.networks.parameters(), after.networks.parameters(), strict=True):
        assert torch.equal(one, two)


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
        ("charts.face_chart", torch.tensor([0, 2])),
        ("charts.face_chart", torch.tensor([0, -1])),
        ("charts.face_chart", torch.tensor([0])),
        ("charts.face_patch", torch.tensor([0, 2])),
        ("charts.patch_chart", torch.tensor([0, 9])),
        ("charts.corner_uv", torch.zeros(2, 3, 2)),
        ("charts.corner_uv", torch.full((2, 3, 2), torch.nan, dtype=torch.float64)),
        ("networks.assign.layers.0.bias", torch.zeros(3)),
        ("networks.assign.layers.0.bias", torch.full((1, 8), torch.inf)),
    ],
)
def test_tensors_that_do_not_fit_are_refused(name: str, value: torch.Tensor, file: Path) -> None:
    rewrite(file, tensors={name: value})
    with pytest.raises(InputError, match="train again"):
        read_trained(file, asset())


@pytest.mark.parametrize(
    "facts",
    [
        {"format": "flexpara-trained-0"},
        {"net": {"width": 10**9}},
        {"net": {"depth": 1}},
        {"net": []},
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


def rewrite(path: Path, *, tensors: dict[str, Any] | None = None, facts: dict[str, Any] | None = None) -> None:
    """The file with some of its parts replaced."""
    with safetensors.safe_open(path, "pt") as file:
        header = json.loads(file.metadata()["flexpara"])
        parts = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    text = json.dumps({**header, **(facts or {})})
    path.write_bytes(safetensors_torch.save({**parts, **(tensors or {})}, {"flexpara": text}))

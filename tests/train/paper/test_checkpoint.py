"""Checkpoints: what is written comes back; a kill between the two files leaves the old pair; damage is named."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
import torch
from safetensors import torch as safetensors

from flexpara.runtime.errors import FlexparaError, InputError, MissingFileError
from flexpara.train.paper import checkpoint
from flexpara.train.paper.checkpoint import MANIFEST, Checkpoints, State, resume
from flexpara.train.paper.config import PaperConfig, PaperNets

if TYPE_CHECKING:
    from pathlib import Path

CONFIG = PaperConfig(steps=40, nets=PaperNets(hidden=2))
INPUT = "ab" * 32


def state(step: int) -> State:
    return State(step, {"networks.weight": torch.full((2, 3), float(step)), "generator": torch.arange(5).byte()})


def edit(folder: Path, **changes: Any) -> None:
    """Change fields of the manifest."""
    path = folder / MANIFEST
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


def forge(folder: Path, content: bytes) -> None:
    """Other tensors, with a manifest that vouches for them."""
    (folder / "checkpoint-00000010.safetensors").write_bytes(content)
    digest = hashlib.sha256(content).hexdigest()
    edit(folder, tensors={"file": "checkpoint-00000010.safetensors", "bytes": len(content), "sha256": digest})


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    Checkpoints(tmp_path, 10).save(state(10), CONFIG, INPUT)
    return tmp_path


def test_what_is_saved_comes_back(saved: Path) -> None:
    found = resume(saved)
    assert (found.state.step, found.config, found.input_sha256) == (10, CONFIG, INPUT)
    for name, tensor in state(10).tensors.items():
        assert torch.equal(found.state.tensors[name], tensor)


def test_the_next_checkpoint_replaces_the_one_before(saved: Path) -> None:
    Checkpoints(saved, 10).save(state(20), CONFIG, INPUT)
    assert resume(saved).state.step == 20
    assert sorted(path.name for path in saved.iterdir()) == ["checkpoint-00000020.safetensors", MANIFEST]


@pytest.mark.parametrize("written", [0, 1])
def test_a_kill_while_writing_leaves_the_old_pair(saved: Path, monkeypatch: pytest.MonkeyPatch, written: int) -> None:
    """Killed in the middle of file number ``written`` of two: half of it lies there under a temporary name."""
    whole, calls = checkpoint.replace_file, list[str]()

    def killed(path: Path, content: bytes) -> None:
        calls.append(path.name)
        if len(calls) > written:
            path.with_name(f".{path.name}.partial").write_bytes(content[: len(content) // 2])
            raise KeyboardInterrupt
        whole(path, content)

    monkeypatch.setattr(checkpoint, "replace_file", killed)
    with pytest.raises(KeyboardInterrupt):
        Checkpoints(saved, 10).save(state(20), CONFIG, INPUT)
    monkeypatch.undo()
    found = resume(saved)
    assert found.state.step == 10
    assert torch.equal(found.state.tensors["networks.weight"], torch.full((2, 3), 10.0))
    Checkpoints(saved, 10).save(state(30), CONFIG, INPUT)
    assert resume(saved).state.step == 30


def test_other_files_in_the_folder_stay(saved: Path) -> None:
    (saved / "notes.safetensors").write_bytes(b"mine")
    Checkpoints(saved, 10).save(state(20), CONFIG, INPUT)
    assert (saved / "notes.safetensors").read_bytes() == b"mine"


def test_a_checkpoint_is_due_at_the_interval_and_at_the_end() -> None:
    due = [step for step in range(1, 26) if Checkpoints(folder=None, every=10).due(step, 25)]  # pyright: ignore[reportArgumentType]
    assert due == [10, 20, 25]


def test_an_empty_folder_holds_no_state(tmp_path: Path) -> None:
    assert Checkpoints(tmp_path).latest(CONFIG, INPUT) is None
    with pytest.raises(MissingFileError, match=MANIFEST):
        resume(tmp_path)


def test_a_run_of_another_config_or_input_is_refused(saved: Path) -> None:
    with pytest.raises(InputError, match="other settings"):
        Checkpoints(saved).latest(replace(CONFIG, seed=1), INPUT)
    with pytest.raises(InputError, match="another input"):
        Checkpoints(saved).latest(CONFIG, "cd" * 32)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"format": "flexpara-checkpoint-99"}, "format is"),
        ({"step": "10"}, "step is '10'"),
        ({"step": True}, "step is 'True'"),
        ({"step": -1}, "expected 1 to 40"),
        ({"step": 41}, "expected 1 to 40"),
        ({"input_sha256": "../../x"}, "64 hex digits"),
        ({"config": {}}, "missing or unknown fields"),
        ({"config": []}, "expected dict"),
        ({"tensors": {"file": "../other", "bytes": 1, "sha256": "0"}}, "expected checkpoint-<step>"),
        ({"tensors": {"file": "checkpoint-00000077.safetensors", "bytes": 1, "sha256": "0"}}, "no such file"),
        ({"tensors": {"file": "checkpoint-00000010.safetensors", "bytes": 1, "sha256": "0"}}, "says 1"),
    ],
)
def test_a_manifest_that_lies_is_refused(saved: Path, changes: dict[str, Any], reason: str) -> None:
    edit(saved, **changes)
    with pytest.raises(InputError, match=reason):
        resume(saved)


@pytest.mark.parametrize(
    ("name", "value"),
    [("steps", 1e3), ("steps", -5), ("mode", "other"), ("rate", "fast"), ("rate", float("nan")), ("charts", 10**9)],
)
def test_a_config_field_that_lies_is_refused(saved: Path, name: str, value: object) -> None:
    edit(saved, config=json.loads((saved / MANIFEST).read_text())["config"] | {name: value})
    with pytest.raises(InputError, match=name):
        resume(saved)


def test_a_config_too_large_for_its_weights_is_refused(saved: Path) -> None:
    config = json.loads((saved / MANIFEST).read_text())["config"]
    edit(saved, config=config | {"nets": config["nets"] | {"hidden": 8192}})
    with pytest.raises(InputError, match="6 weights, expected at least 67108864"):
        resume(saved)


@pytest.mark.parametrize("content", [b"", b"{", b"[1]", b"\xff\xfe", b"[" * 100_000])
def test_a_manifest_that_is_no_json_object_is_refused(saved: Path, content: bytes) -> None:
    (saved / MANIFEST).write_bytes(content)
    with pytest.raises(InputError, match=MANIFEST):
        resume(saved)


def test_a_manifest_too_large_is_not_read(saved: Path) -> None:
    with (saved / MANIFEST).open("r+b") as file:
        file.truncate(1 << 30)
    with pytest.raises(InputError, match="expected at most"):
        resume(saved)


def test_a_changed_byte_is_noticed(saved: Path) -> None:
    path = saved / "checkpoint-00000010.safetensors"
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(content)
    with pytest.raises(InputError, match="sha256 differs"):
        resume(saved)


@pytest.mark.parametrize("content", [b"", b"\xff" * 8, b"\xff" * 64, (2**40).to_bytes(8, "little") + b"{}"])
def test_tensors_that_are_none_are_refused(saved: Path, content: bytes) -> None:
    forge(saved, content)
    with pytest.raises(InputError, match="holds no tensors"):
        resume(saved)


@pytest.mark.parametrize("tensor", [torch.tensor([float("nan")]), torch.tensor([1], dtype=torch.int64)])
def test_tensors_that_are_not_finite_float32_are_refused(saved: Path, tensor: torch.Tensor) -> None:
    forge(saved, safetensors.save({"networks.weight": tensor}))
    with pytest.raises(InputError, match=r"networks\.weight"):
        resume(saved)


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(FlexparaError, match="choose another folder"):
        Checkpoints(tmp_path / "file" / "deeper").save(state(10), CONFIG, INPUT)

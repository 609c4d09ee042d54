"""Checkpoints of a training run: one folder, one JSON, one safetensors file that the JSON names.  No pickle.

    checkpoint.json                    format, step, config, sha256 of the input, and name, size, sha256 of the tensors
    checkpoint-<step>.safetensors      networks, optimizer moments, state of the random generator

The tensors are written first, under a name of their own, then the JSON takes the place of the old one, then the old
tensors go.  Both are written beside their place and renamed.  A process killed at any moment so leaves the pair of
before or the pair of after.  What is read is checked before it is used: a folder may come from anywhere.
"""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import torch
from safetensors import SafetensorError
from safetensors import torch as safetensors

from ...runtime.errors import InputError, MissingFileError
from ...runtime.files import replace_file
from ..fromjson import from_json
from .config import PaperConfig

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from torch import Tensor

FORMAT = "flexpara-checkpoint-1"
MANIFEST = "checkpoint.json"
MANIFEST_BYTES = 1 << 20
TENSOR_BYTES = 1 << 34
"""Largest files that are read."""
TENSOR_NAME = re.compile(r"checkpoint-\d{8}\.safetensors")
DIGEST = re.compile(r"[0-9a-f]{64}")


@dataclass(frozen=True, eq=False)
class State:
    """What the next step depends on.  step: steps done.  tensors: by name, on the CPU."""

    step: int
    tensors: dict[str, Tensor]


@dataclass(frozen=True, eq=False)
class Resumed:
    """A checkpoint as read: the state, the config it was made with, and the sha256 of the input."""

    state: State
    config: PaperConfig
    input_sha256: str


@dataclass(frozen=True)
class Checkpoints:
    """Where and how often a run is saved.  folder: made when absent.  every: steps, ≥ 1; also after the last."""

    folder: Path
    every: int = 500

    def __post_init__(self) -> None:
        """Refuse an interval below 1 (InputError)."""
        if self.every < 1:
            raise InputError(f"checkpoints every {self.every} steps, expected at least 1; choose another interval")

    def due(self, step: int, steps: int) -> bool:
        """True where step number ``step`` of ``steps`` is to be saved."""
        return step % self.every == 0 or step == steps

    def save(self, state: State, config: PaperConfig, input_sha256: str) -> None:
        """Write one checkpoint in place of the one before.

        Raises:
            InputError: the folder can't be written to.
        """
        content = safetensors.save(state.tensors)
        name = f"checkpoint-{state.step:08d}.safetensors"
        facts = {
            "format": FORMAT,
            "step": state.step,
            "config": asdict(config),
            "input_sha256": input_sha256,
            "tensors": {"file": name, "bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()},
        }
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            replace_file(self.folder / name, content)
            replace_file(self.folder / MANIFEST, (json.dumps(facts, indent=2) + "\n").encode())
            for path in self.folder.iterdir():
                if TENSOR_NAME.fullmatch(path.name) and path.name != name:
                    path.unlink()
        except OSError as error:
            raise InputError(f"can't write to {self.folder} ({error.strerror}); choose another folder") from error

    def latest(self, config: PaperConfig, input_sha256: str) -> State | None:
        """The state to go on from, or None where the folder holds no checkpoint.

        Raises:
            InputError: the checkpoint is damaged, or of another config or input.
        """
        if not (self.folder / MANIFEST).exists():
            return None
        found = resume(self.folder)
        if found.config != config:
            raise InputError(
                f"{self.folder} holds a run with other settings; choose an empty folder, or resume that run"
            )
        if found.input_sha256 != input_sha256:
            raise InputError(f"{self.folder} holds a run of another input; choose an empty folder, or give that input")
        return found.state


def resume(folder: Path) -> Resumed:
    """Read and check a checkpoint.

    Raises:
        MissingFileError: there is none.
        InputError: it is damaged: not our format, a field of the wrong type or range, tensors that are not those that
            were written, or not finite.
    """
    manifest = folder / MANIFEST
    if not manifest.is_file():
        raise MissingFileError(
            f"{manifest}: no such file, expected a checkpoint; name the folder of --checkpoint-every"
        )
    facts = _read_manifest(manifest)
    config = _checked(manifest, facts, "config", dict, lambda found: from_json(PaperConfig, found, "config"))
    step = _checked(manifest, facts, "step", int)
    if not 0 < step <= config.steps:
        raise InputError(f"{manifest}: step is {step}, expected 1 to {config.steps}; use another checkpoint")
    sha = _checked(manifest, facts, "input_sha256", str)
    if not DIGEST.fullmatch(sha):
        raise InputError(f"{manifest}: input_sha256 is {sha[:80]!r}, expected 64 hex digits; use another checkpoint")
    tensors = _read_tensors(folder, _checked(manifest, facts, "tensors", dict))
    _check_scale(folder, tensors, config)
    return Resumed(State(step, tensors), config, sha)


def _check_scale(folder: Path, tensors: dict[str, Tensor], config: PaperConfig) -> None:
    """Refuse a config that would make far larger networks than those on disk, before they are made."""
    least = config.nets.hidden**2 * (config.charts if config.mode == "multi-chart" else 1)
    found = sum(tensor.numel() for name, tensor in tensors.items() if name.startswith("networks."))
    if found < least:
        raise InputError(f"{folder}: {found} weights, expected at least {least} for its config; use another checkpoint")


def _read_manifest(path: Path) -> dict[str, Any]:
    if (size := path.stat().st_size) > MANIFEST_BYTES:
        raise InputError(f"{path} has {size} bytes, expected at most {MANIFEST_BYTES}; use another checkpoint")
    try:
        facts = json.loads(path.read_bytes())
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is no JSON ({type(error).__name__}), expected a checkpoint; use another") from error
    found = facts.get("format") if isinstance(facts, dict) else facts
    if found != FORMAT:
        raise InputError(
            f"{path}: format is {str(found)[:80]!r}, expected {FORMAT!r}; use a checkpoint of this version"
        )
    return facts


def _checked(path: Path, facts: dict[str, Any], name: str, kind: type, read: Callable[[Any], Any] | None = None) -> Any:
    """A field of the type expected."""
    value = facts.get(name)
    if not isinstance(value, kind) or isinstance(value, bool):
        raise InputError(f"{path}: {name} is {str(value)[:80]!r}, expected {kind.__name__}; use another checkpoint")
    return value if read is None else read(value)


def _read_tensors(folder: Path, facts: dict[str, Any]) -> dict[str, Tensor]:
    manifest = folder / MANIFEST
    name, digest = _checked(manifest, facts, "file", str), _checked(manifest, facts, "sha256", str)
    size = _checked(manifest, facts, "bytes", int)
    if not TENSOR_NAME.fullmatch(name):
        raise InputError(f"{manifest}: file is {name[:80]!r}, expected checkpoint-<step>.safetensors; use another")
    path = folder / name
    if not path.is_file() or path.is_symlink():
        raise InputError(f"{path}: no such file, expected the tensors that {MANIFEST} names; use another checkpoint")
    if not path.stat().st_size == size <= TENSOR_BYTES:
        raise InputError(f"{path} has {path.stat().st_size} bytes, {MANIFEST} says {size}; use another checkpoint")
    content = path.read_bytes()
    if hashlib.sha256(content).hexdigest() != digest:
        raise InputError(f"{path} is not what was written (sha256 differs); use another checkpoint")
    try:
        tensors = safetensors.load(content)
    except (SafetensorError, ValueError, KeyError) as error:
        raise InputError(f"{path} holds no tensors ({error}), expected safetensors; use another checkpoint") from error
    for key, tensor in tensors.items():
        if tensor.dtype not in (torch.float32, torch.uint8) or not torch.isfinite(tensor).all():
            raise InputError(
                f"{path}: {key[:80]} is {tensor.dtype} or not finite, expected finite float32; use another"
            )
    return tensors

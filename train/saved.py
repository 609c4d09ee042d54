"""What training found, as one file: charts and networks as safetensors, everything else as JSON in its header.

f faces · k charts · p patches.  No pickle.  A file may come from anywhere: all of it is checked before it is used.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np
import safetensors
import torch
from safetensors import SafetensorError
from safetensors import torch as safetensors_torch

from ..runtime.errors import InputError, MissingFileError
from ..runtime.mesh import Charts, Frame
from .config import NetConfig
from .learn.networks import AtlasNetworks
from .pipeline import Trained

if TYPE_CHECKING:
    from pathlib import Path

    from torch import Tensor

    from ..runtime.mesh import Asset

FORMAT = "flexpara-trained-1"
LARGEST = 1 << 33
"""Bytes of a file that is read."""
WIDEST = 4096
"""Channels of a layer that is read."""
CHARTS = {
    "face_chart": torch.int64,
    "corner_uv": torch.float64,
    "face_patch": torch.int64,
    "patch_chart": torch.int64,
}


def to_bytes(trained: Trained, source_sha256: str) -> bytes:
    """The file's content.  source_sha256: of the mesh that was trained on."""
    arrays = {name: np.array(getattr(trained.charts, name), order="C") for name in CHARTS}  # they may share memory
    tensors = {f"charts.{name}": torch.from_numpy(array) for name, array in arrays.items()}
    weights = trained.networks.state_dict()
    tensors |= {f"networks.{name}": weight.contiguous() for name, weight in weights.items()}
    facts = {
        "format": FORMAT,
        "source_sha256": source_sha256,
        "methods": list(trained.charts.method),
        "frame": {"centre": list(trained.frame.centre), "scale": trained.frame.scale},
        "net": asdict(trained.networks.config),
        "settings": trained.settings,
        "report": trained.report,
    }
    return safetensors_torch.save(tensors, {"flexpara": json.dumps(facts, sort_keys=True, allow_nan=False)})


def read_trained(path: Path, asset: Asset) -> Trained:
    """What ``to_bytes`` wrote, for the mesh it was trained on.

    Raises:
        MissingFileError: nothing lies there.
        InputError: no such file of ours, damaged, or of another mesh.
    """
    if not path.is_file():
        raise MissingFileError(f"{path}: no such file, expected one that flexpara train wrote")
    if path.stat().st_size > LARGEST:
        raise InputError(f"{path} has {path.stat().st_size} bytes, expected at most {LARGEST}; train again")
    try:
        with safetensors.safe_open(path, "pt") as file:
            facts = json.loads((file.metadata() or {}).get("flexpara", "null"))
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118  # no mapping
    except (SafetensorError, ValueError, RecursionError, OSError) as error:
        raise _damaged(path, f"no safetensors file with our header ({type(error).__name__})") from error
    if not isinstance(facts, dict) or facts.get("format") != FORMAT:
        raise _damaged(path, f"format is {str(facts)[:60]!r}")
    if facts.get("source_sha256") != asset.sha256:
        raise InputError(f"{path} belongs to another mesh than {asset.stem}, expected the same file; pass that mesh")
    try:
        charts = _charts(path, tensors, facts["methods"], len(asset.faces))
        networks = _networks(path, tensors, NetConfig(**facts["net"]), len(charts.patch_chart))
        frame = Frame(tuple(map(float, facts["frame"]["centre"])), float(facts["frame"]["scale"]))  # pyright: ignore[reportArgumentType]
        settings, report = dict(facts["settings"]), dict(facts["report"])
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        if isinstance(error, InputError):
            raise
        raise _damaged(path, str(error)[:120]) from error
    if len(frame.centre) != 3 or not all(map(math.isfinite, (*frame.centre, frame.scale))) or frame.scale <= 0.0:
        raise _damaged(path, f"frame is {frame}")
    return Trained(charts, networks, frame, settings, report)


def _charts(path: Path, tensors: dict[str, Tensor], methods: list[str], faces: int) -> Charts:
    """The charts, with every index in range."""
    arrays = {name: tensors[f"charts.{name}"] for name in CHARTS}
    patches = len(arrays["patch_chart"])
    shapes = {"face_chart": (faces,), "corner_uv": (faces, 3, 2), "face_patch": (faces,), "patch_chart": (patches,)}
    for name, array in arrays.items():
        if array.dtype != CHARTS[name] or tuple(array.shape) != shapes[name]:
            raise _damaged(path, f"{name} is {array.dtype} {tuple(array.shape)}")
    limits = {"face_chart": len(methods), "patch_chart": len(methods), "face_patch": patches}
    for name, limit in limits.items():
        if not (arrays[name].min() >= 0 and arrays[name].max() < limit):
            raise _damaged(path, f"{name} leaves 0 to {limit - 1}")
    if not torch.isfinite(arrays["corner_uv"]).all():
        raise _damaged(path, "corner_uv is not finite")
    plain = {name: array.numpy() for name, array in arrays.items()}
    return Charts(**plain, method=tuple(map(str, methods)))


def _networks(path: Path, tensors: dict[str, Tensor], net: NetConfig, patches: int) -> AtlasNetworks:
    """The networks, their sizes checked before anything is made of them."""
    sizes = asdict(net)
    if not all(isinstance(size, int) and 0 <= size <= WIDEST for size in sizes.values()):
        raise _damaged(path, f"net is {sizes}")
    weights = {
        name.removeprefix("networks."): tensor for name, tensor in tensors.items() if name.startswith("networks.")
    }
    if sum(tensor.numel() for tensor in weights.values()) < patches * net.width * net.width:
        raise _damaged(path, f"too few weights for {patches} patches")
    networks = AtlasNetworks(patches, net, generator=torch.Generator().manual_seed(0))
    networks.load_state_dict(weights)
    if not all(torch.isfinite(weight).all() for weight in networks.state_dict().values()):
        raise _damaged(path, "weights are not finite")
    return networks.eval()


def _damaged(path: Path, found: str) -> InputError:
    return InputError(f"{path}: {found}, expected what flexpara train wrote ({FORMAT}); train again")

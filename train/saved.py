"""What training found, as one file: charts and networks as safetensors, everything else as JSON in its header.

f faces · k charts · p patches.  No pickle.  A file may come from anywhere: all of it is checked before it is used.
"""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import safetensors
from safetensors import SafetensorError
from safetensors import numpy as safetensors_numpy

from ..runtime.errors import InputError, MissingFileError
from ..runtime.mesh import Charts, Frame
from .deploy.gated import GatedExperts, Grid
from .pipeline import Trained
from .workers import Beside

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ..runtime.mesh import Asset

FORMAT = "flexpara-trained-2"
LARGEST = 1 << 33
"""Bytes of a file that is read."""
CHARTS = {"face_chart": np.int64, "corner_uv": np.float64, "face_patch": np.int64, "patch_chart": np.int64}
GRID = {"low": np.float32, "cell": np.float32, "shape": np.int64}
NETWORKS = {
    "start": np.int32,
    "gates": np.float32,
    "sides": np.int32,
    "weights": np.float32,
    "label": np.int64,
    "centre": np.float32,
    "radius": np.float32,
    "share": np.float32,
}

Arrays = dict[str, "NDArray[Any]"]


def to_bytes(trained: Trained, source_sha256: str) -> bytes:
    """The file's content.  source_sha256: of the mesh that was trained on."""
    networks, parts = trained.networks, Arrays()
    for kind, names, owner in (
        ("charts", CHARTS, trained.charts),
        ("networks", NETWORKS, networks),
        ("grid", GRID, networks.grid),
    ):
        parts |= {f"{kind}.{name}": np.array(getattr(owner, name), order="C") for name in names}
    facts = {
        "format": FORMAT,
        "source_sha256": source_sha256,
        "methods": list(trained.charts.method),
        "frame": {"centre": list(trained.frame.centre), "scale": trained.frame.scale},
        "depth": networks.depth,
        "settings": trained.settings,
        "report": trained.report,
    }
    return safetensors_numpy.save(parts, {"flexpara": json.dumps(facts, sort_keys=True, allow_nan=False)})


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
        with safetensors.safe_open(path, "np") as file:
            facts = json.loads((file.metadata() or {}).get("flexpara", "null"))
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118  # no mapping
    except (SafetensorError, ValueError, RecursionError, OSError) as error:
        raise _damaged(path, f"no safetensors file with our header ({type(error).__name__})") from error
    if not isinstance(facts, dict) or facts.get("format") != FORMAT:
        raise _damaged(path, f"format is {str(facts)[:60]!r}")
    if facts.get("source_sha256") != asset.sha256:
        raise InputError(f"{path} belongs to another mesh than {asset.stem}, expected the same file; pass that mesh")
    try:
        charts = _charts(path, arrays, facts["methods"], len(asset.faces))
        networks = _networks(path, arrays, int(facts["depth"]), len(charts.method))
        frame = Frame(tuple(map(float, facts["frame"]["centre"])), float(facts["frame"]["scale"]))  # pyright: ignore[reportArgumentType]
        settings, report = dict(facts["settings"]), dict(facts["report"])
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise _damaged(path, str(error)[:120]) from error
    if len(frame.centre) != 3 or not all(map(math.isfinite, (*frame.centre, frame.scale))) or frame.scale <= 0.0:
        raise _damaged(path, f"frame is {str(frame)[:120]}")
    return Trained(charts, Beside.known(networks), frame, settings, report)


def _read(path: Path, arrays: Arrays, kind: str, shapes: dict[str, tuple[int | None, ...]], types: Any) -> Arrays:
    """Arrays of a kind, of the types and shapes expected (None: any length), finite."""
    found = {name: arrays[f"{kind}.{name}"] for name in shapes}
    for name, array in found.items():
        fits = len(array.shape) == len(shapes[name]) and all(
            wanted in (None, size) for size, wanted in zip(array.shape, shapes[name], strict=True)
        )
        if array.dtype != types[name] or not fits or not np.isfinite(array).all():
            raise _damaged(path, f"{kind}.{name} is {array.dtype} {array.shape}, or not finite")
    return found


def _charts(path: Path, arrays: Arrays, methods: list[str], faces: int) -> Charts:
    """The charts, with every index in range."""
    shapes = {"face_chart": (faces,), "corner_uv": (faces, 3, 2), "face_patch": (faces,), "patch_chart": (None,)}
    found = _read(path, arrays, "charts", shapes, CHARTS)
    limits = {"face_chart": len(methods), "patch_chart": len(methods), "face_patch": len(found["patch_chart"])}
    for name, limit in limits.items():
        if not (found[name].min() >= 0 and found[name].max() < limit):
            raise _damaged(path, f"{name} leaves 0 to {limit - 1}")
    return Charts(**found, method=tuple(map(str, methods)))


def _networks(path: Path, arrays: Arrays, depth: int, charts: int) -> GatedExperts:
    """The networks, with every code in range, and every way through the gates an end."""
    found = _read(path, arrays, "grid", {"low": (3,), "cell": (3,), "shape": (3,)}, GRID)
    grid = Grid(**found)
    if not ((grid.cell > 0.0).all() and (grid.shape > 0).all() and grid.count < 1 << 24):
        raise _damaged(path, f"grid of {grid.shape.tolist()} cells")
    experts, gates = len(arrays["networks.label"]), len(arrays["networks.gates"])
    shapes: dict[str, tuple[int | None, ...]] = {"start": (grid.count,), "gates": (gates, 4), "sides": (gates, 2)}
    shapes |= {"weights": (experts, 2, 4), "centre": (experts, 3)}
    shapes |= dict.fromkeys(("label", "radius", "share"), (experts,))
    found = _read(path, arrays, "networks", shapes, NETWORKS)
    codes, sides = np.append(found["start"], found["sides"]), found["sides"]
    forward = (sides > np.arange(gates)[:, None]).all()  # a gate leads to later gates and to experts: no way is endless
    if experts == 0 or codes.min() < 0 or codes.max() >= gates + experts or not forward or depth != _depth(sides):
        raise _damaged(path, f"{gates} gates, {experts} experts, and codes that don't lead from these to those")
    if not (found["label"].min() >= 0 and found["label"].max() < charts):
        raise _damaged(path, f"networks.label leaves 0 to {charts - 1}")
    return GatedExperts(grid=grid, depth=depth, **found)


def _depth(sides: NDArray[np.int32]) -> int:
    """The most gates on any way: each gate's code is larger than those before it."""
    below = np.zeros(len(sides), dtype=np.int64)
    for gate in range(len(sides) - 1, -1, -1):
        later = sides[gate][sides[gate] < len(sides)]
        below[gate] = 1 + (below[later].max() if len(later) else 0)
    return int(below.max(initial=0))


def _damaged(path: Path, found: str) -> InputError:
    return InputError(f"{path}: {found}, expected what flexpara train wrote ({FORMAT}); train again")

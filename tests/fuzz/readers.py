"""Every reader of flexpara: how its files are damaged, which files stand beside them, and how they are read."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import mutate
from .mutate import Mutator, by_bytes, by_words, glb, in_turn
from .onnxcases import by_onnx

TENSORS = "checkpoint-00000005.safetensors"
Files = Mapping[str, bytes]


@dataclass(frozen=True)
class Reader:
    """One reader.

    name: of the file that is read.  mutate: its damaged copies.  read: called with its path.
    around: bytes of the damaged part and the seeds of all readers → the files of a case.
    """

    name: str
    mutate: Mutator
    read: Callable[[Path], object]
    around: Callable[[bytes, Mapping[str, list[bytes]]], Files] | None = None

    def files(self, data: bytes, seeds: Mapping[str, list[bytes]]) -> Files:
        """The files of a case."""
        return {self.name: data} if self.around is None else self.around(data, seeds)


def read_any(path: Path) -> object:
    """As `unwrap` reads: a mesh, or a cloud; and as a batch asks which files it names."""
    from flexpara.runtime.io.anyfile import load_any
    from flexpara.runtime.io.companions import companions

    companions(path)
    return load_any(path)


def read_scene(path: Path) -> object:
    """As `unwrap` and `bake` read a scene: its meshes once, all instances, all columns of its vertices."""
    from flexpara.runtime.io.companions import companions
    from flexpara.runtime.io.gltf.columns import primitive_columns
    from flexpara.runtime.io.gltf.editing import Editing
    from flexpara.runtime.io.meshfile import load_asset

    companions(path)
    load_asset(path, instances=True)
    asset = load_asset(path)
    assert asset.document is not None
    for part in asset.document.parts:
        mesh = asset.document.file.tree["meshes"][part.mesh]
        primitive_columns(asset.document.file, mesh["primitives"][part.primitive])
    return Editing(asset.document.file).finished()


def read_points_and_cloud(path: Path) -> object:
    """As `query` and `unwrap` read points."""
    from flexpara.runtime.errors import FlexparaError
    from flexpara.runtime.io.points.cloudfile import load_cloud
    from flexpara.runtime.io.points.pointfile import read_points

    try:
        load_cloud(path)
    except FlexparaError:
        return read_points(path)
    return read_points(path)


def read_onnx(path: Path) -> object:
    """As `query` asks a file."""
    from flexpara.runtime.sessions.session import UnwrapSession

    return UnwrapSession(path, threads=1).unwrap(np.random.default_rng(0).uniform(-1.0, 1.0, (100, 3)))


def read_wrap(path: Path) -> object:
    """As the inverse is asked."""
    from flexpara.runtime.sessions.wrapsession import WrapSession

    return WrapSession(path, threads=1).wrap(np.full((4, 2), 0.5, np.float32), np.zeros(4, np.int64))


def read_trained(path: Path) -> object:
    """As `export` reads it."""
    from flexpara.runtime.io.meshfile import load_asset
    from flexpara.train.saved import read_trained

    trained = read_trained(path, load_asset(path.with_name("box.obj")))
    return trained.networks(np.random.default_rng(0).uniform(-1.0, 1.0, (100, 3)).astype(np.float32))


def read_report(path: Path) -> object:
    """As `report` reads it, and as OutputFolder asks which files are flexpara's."""
    from flexpara.bake.report.gather import results_in
    from flexpara.runtime.files import OutputFolder

    OutputFolder(path.parent, "box")
    return results_in([path])


def read_run(path: Path) -> object:
    """As `unwrap --resume` reads it."""
    from flexpara.runtime.cli.runfile import find_run

    return find_run(path.parent.parent)


def read_batch(path: Path) -> object:
    """As `batch --status`, and a batch that goes on, read what an earlier one wrote."""
    from flexpara.runtime.batch.status import page_of, status_of

    status = status_of(path.parent)
    return status.lines(), page_of(path.parent, status).encode()


def read_list(path: Path) -> object:
    """As `batch` reads a list of assets."""
    from flexpara.runtime.batch.jobs import find_jobs
    from flexpara.runtime.cli.runfile import facts_of
    from flexpara.runtime.options.unwrap import Options, Outputs

    jobs = find_jobs([path], path.parent / "out", Options(), Outputs())
    return [(job.asked("1"), json.dumps(facts_of(job.run))) for job in jobs]


def read_checkpoint(path: Path) -> object:
    """As a run of preset paper goes on from it."""
    from flexpara.train.paper.checkpoint import resume

    return resume(path.parent)


def _with_tensors(data: bytes, seeds: Mapping[str, list[bytes]]) -> Files:
    return {"run/checkpoint.json": data, f"run/{TENSORS}": seeds["tensors"][0]}


def _with_manifest(data: bytes, seeds: Mapping[str, list[bytes]]) -> Files:
    """Damaged tensors whose size and hash are told right."""
    facts = json.loads(seeds["checkpoint"][0])
    facts["tensors"] |= {"bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}
    return {"run/checkpoint.json": json.dumps(facts).encode(), f"run/{TENSORS}": data}


def _with_library(data: bytes, seeds: Mapping[str, list[bytes]]) -> Files:
    return {"a.obj": seeds["obj"][0], "box.mtl": data, "skin.png": seeds["png"][0]}


def _textured(kind: str) -> Callable[[bytes, Mapping[str, list[bytes]]], Files]:
    def around(data: bytes, _: Mapping[str, list[bytes]]) -> Files:
        holder = {"extensions": {"KHR_texture_basisu": {"source": 0}}} if kind == "ktx2" else {"source": 0}
        points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32).tobytes()
        tree = {
            "asset": {"version": "2.0"},
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "buffers": [{"byteLength": 36 + len(data)}],
            "bufferViews": [
                {"buffer": 0, "byteLength": 36},
                {"buffer": 0, "byteOffset": 36, "byteLength": len(data)},
            ],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 0}, "material": 0}]}],
            "images": [{"bufferView": 1, "mimeType": f"image/{kind}"}],
            "textures": [holder],
            "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        }
        del tree["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"]
        return {"a.glb": glb(json.dumps(tree).encode(), points + data)}

    return around


def _draco(data: bytes, _: Mapping[str, list[bytes]]) -> Files:
    packed = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}
    views: list[dict[str, object]] = [{"buffer": 0, "byteLength": len(data)}]
    return {"a.glb": _packed(data, views, [{}, {}], {"extensions": packed})}


def _meshopt(data: bytes, seeds: Mapping[str, list[bytes]]) -> Files:
    """Whatever is damaged stands for positions or for corners, by its first byte; the other is whole."""
    first = data[:1] in (b"\xa0", b"\xa1")
    corners = b"\xd1" if data[:1] in (b"\xd0", b"\xd1") else b"\xe1"
    other = next(seed for seed in seeds["meshopt"] if (seed[:1] in (b"\xa0", b"\xa1")) != first)
    vertex, index = (data, other) if first else (other, data)
    mode = "INDICES" if corners == b"\xd1" and not first else "TRIANGLES"
    views = [
        _view(0, len(vertex), {"mode": "ATTRIBUTES", "count": 8, "byteStride": 12}),
        _view(len(vertex), len(index), {"mode": mode, "count": 36, "byteStride": 4}),
    ]
    return {"a.glb": _packed(vertex + index, views, [{"bufferView": 1}, {"bufferView": 0}], {})}


def _view(start: int, length: int, extension: dict[str, object]) -> dict[str, object]:
    whole = {"buffer": 0, "byteOffset": start, "byteLength": length, **extension}
    return {"buffer": 0, "byteLength": 4, "extensions": {"EXT_meshopt_compression": whole}}


def _packed(data: bytes, views: list[dict[str, object]], where: list[dict[str, int]], more: dict[str, object]) -> bytes:
    tree = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": views,
        "accessors": [
            {"componentType": 5125, "count": 36, "type": "SCALAR", **where[0]},
            {"componentType": 5126, "count": 8, "type": "VEC3", **where[1]},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 1}, "indices": 0, **more}]}],
    }
    return glb(json.dumps(tree).encode(), data)


def _batch(data: bytes, seeds: Mapping[str, list[bytes]]) -> Files:
    return {"manifest.jsonl": data, "batch.json": seeds["plan"][0]}


def _batch_plan(data: bytes, seeds: Mapping[str, list[bytes]]) -> Files:
    return {"manifest.jsonl": seeds["manifest"][0], "batch.json": data}


def _trained(data: bytes, seeds: Mapping[str, list[bytes]]) -> Files:
    return {"box.trained.safetensors": data, "box.obj": seeds["boxobj"][0]}


def _report(data: bytes, seeds: Mapping[str, list[bytes]]) -> Files:
    return {"box.report.json": data, "box.glb": seeds["mesh"][0], "a.png": seeds["png"][0]}


text_or_bytes = in_turn(by_words, by_words, by_bytes)
READERS: dict[str, Reader] = {
    "obj": Reader("a.obj", text_or_bytes, read_any),
    "mtl": Reader("a.obj", text_or_bytes, read_any, _with_library),
    "ply": Reader("a.ply", in_turn(by_words, by_bytes), read_any),
    "stl": Reader("a.stl", in_turn(by_words, by_bytes), read_any),
    "off": Reader("a.off", in_turn(by_words, by_bytes), read_any),
    "glb": Reader("a.glb", in_turn(mutate.by_glb, mutate.by_glb, mutate.by_glb, by_bytes), read_scene),
    "gltf": Reader("a.gltf", in_turn(mutate.by_json, mutate.by_json, by_bytes), read_scene),
    "draco": Reader("a.glb", by_bytes, read_scene, _draco),
    "meshopt": Reader("a.glb", by_bytes, read_scene, _meshopt),
    "png": Reader("a.glb", in_turn(mutate.by_png, by_bytes), read_any, _textured("png")),
    "jpg": Reader("a.glb", by_bytes, read_any, _textured("jpeg")),
    "ktx2": Reader("a.glb", by_bytes, read_any, _textured("ktx2")),
    "npy": Reader("a.npy", by_bytes, read_points_and_cloud),
    "npz": Reader("a.npz", in_turn(mutate.by_zip, by_bytes), read_points_and_cloud),
    "csv": Reader("a.csv", text_or_bytes, read_points_and_cloud),
    "3mf": Reader("a.3mf", in_turn(mutate.by_zip, by_bytes), read_any),
    "dae": Reader("a.dae", text_or_bytes, read_any),
    "onnx": Reader("a.onnx", by_onnx, read_onnx),
    "wrap": Reader("a.wrap.onnx", by_onnx, read_wrap),
    "trained": Reader(
        "box.trained.safetensors",
        in_turn(mutate.by_safetensors, mutate.by_safetensors, by_bytes),
        read_trained,
        _trained,
    ),
    "report": Reader("box.report.json", in_turn(mutate.by_json, by_bytes), read_report, _report),
    "manifest": Reader("manifest.jsonl", in_turn(mutate.by_lines, by_bytes), read_batch, _batch),
    "plan": Reader("batch.json", in_turn(mutate.by_json, by_bytes), read_batch, _batch_plan),
    "list": Reader("assets.jsonl", in_turn(mutate.by_lines, by_bytes), read_list),
    "checkpoint": Reader(
        "run/checkpoint.json", in_turn(mutate.by_json, mutate.by_json, by_bytes), read_checkpoint, _with_tensors
    ),
    "tensors": Reader(f"run/{TENSORS}", in_turn(mutate.by_header, by_bytes), read_checkpoint, _with_manifest),
    "run": Reader("mesh.checkpoint/run.json", in_turn(mutate.by_json, by_bytes), read_run),
}

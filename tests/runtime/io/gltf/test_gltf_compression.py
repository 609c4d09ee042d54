"""Compressed glTF geometry reads as it was before: Draco, and each mode and filter of meshopt."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexpara.runtime.errors import MeshError, MissingDependencyError
from flexpara.runtime.io.asset.changes import lost
from flexpara.runtime.io.gltf.compression import decode_draco, decode_view
from flexpara.runtime.io.gltf.scene import read_gltf
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.options.unwrap import Outputs
from flexpara.runtime.samples import make_sample

DracoPy = pytest.importorskip("DracoPy")
meshoptimizer = pytest.importorskip("meshoptimizer")

VERTICES, FACES = make_sample("torus")
SINGLE = VERTICES.astype(np.float32)


def glb(tree: dict[str, Any], data: bytes) -> bytes:
    text = json.dumps({"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}], **tree}).encode()
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def accessors(**more: Any) -> list[dict[str, Any]]:
    return [
        {"componentType": 5125, "count": FACES.size, "type": "SCALAR", **more.get("indices", {})},
        {"componentType": 5126, "count": len(SINGLE), "type": "VEC3", **more.get("positions", {})},
    ]


def test_draco_reads_as_it_was(tmp_path: Path) -> None:
    packed = DracoPy.encode(SINGLE, FACES.astype(np.uint32), preserve_order=True, quantization_bits=20)
    extension = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}
    primitive = {"attributes": {"POSITION": 1}, "indices": 0, "extensions": extension}
    tree = {
        "meshes": [{"primitives": [primitive]}],
        "accessors": accessors(),
        "buffers": [{"byteLength": len(packed)}],
        "bufferViews": [{"buffer": 0, "byteLength": len(packed)}],
        "extensionsRequired": ["KHR_draco_mesh_compression"],
    }
    raw = read_gltf(glb(tree, packed), tmp_path)
    np.testing.assert_array_equal(raw.faces, FACES)
    np.testing.assert_allclose(raw.positions, SINGLE, atol=1e-5)
    with pytest.raises(MeshError, match="Draco data"):
        decode_draco(packed[:40], {"POSITION": 0})


def meshopt(mode: str, packed: bytes, count: int, stride: int, **more: Any) -> dict[str, Any]:
    return {"mode": mode, "count": count, "byteStride": stride, "buffer": 0, "byteLength": len(packed), **more}


@pytest.mark.parametrize("name", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
@pytest.mark.parametrize("mode", ["TRIANGLES", "INDICES"])
def test_meshopt_reads_as_it_was(tmp_path: Path, name: str, mode: str) -> None:
    indices = FACES.astype(np.uint32).ravel()
    encode = meshoptimizer.encode_index_buffer if mode == "TRIANGLES" else meshoptimizer.encode_index_sequence
    first = bytes(encode(indices, len(indices), len(SINGLE)))
    second = bytes(meshoptimizer.encode_vertex_buffer(SINGLE, len(SINGLE), 12))
    views = [
        {"buffer": 1, "byteLength": 4, "extensions": {name: meshopt(mode, first, indices.size, 4)}},
        {
            "buffer": 1,
            "byteLength": 4,
            "extensions": {name: meshopt("ATTRIBUTES", second, len(SINGLE), 12, byteOffset=len(first))},
        },
    ]
    fallback = {"byteLength": 8, "extensions": {name: {"fallback": True}}}
    tree = {
        "meshes": [{"primitives": [{"attributes": {"POSITION": 1}, "indices": 0}]}],
        "accessors": accessors(indices={"bufferView": 0}, positions={"bufferView": 1}),
        "buffers": [{"byteLength": len(first) + len(second)}, fallback],
        "bufferViews": views,
        "extensionsRequired": [name],
    }
    raw = read_gltf(glb(tree, first + second), tmp_path)
    turns = [np.roll(FACES, turn, axis=1) for turn in range(3)]  # meshopt may start a triangle at another corner
    assert np.any([(raw.faces == turned).all(axis=1) for turned in turns], axis=0).all()
    np.testing.assert_array_equal(raw.positions, SINGLE)


def test_an_octahedral_filter_gives_unit_normals() -> None:
    coded = np.array([[0, 0, 127, 0], [127, 0, 127, 0]], dtype=np.int8)
    packed = bytes(meshoptimizer.encode_vertex_buffer(coded, 2, 4))
    found = decode_view(packed, {"mode": "ATTRIBUTES", "count": 2, "byteStride": 4, "filter": "OCTAHEDRAL"})
    normals = np.frombuffer(found, dtype=np.int8).reshape(2, 4)[:, :3] / 127.0
    np.testing.assert_allclose(normals, [[0, 0, 1], [1, 0, 0]], atol=0.02)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mode": "MAGIC"}, "mode 'MAGIC'"),
        ({"filter": "SEPIA"}, "filter 'SEPIA'"),
        ({"count": 10**12}, "elements"),
        ({"byteStride": 0}, "elements"),
        ({"byteStride": 6}, "damaged"),
        ({"count": 900}, "damaged"),
    ],
)
def test_damage_is_named(change: dict[str, Any], message: str) -> None:
    packed = bytes(meshoptimizer.encode_vertex_buffer(SINGLE[:4], 4, 12))
    with pytest.raises(MeshError, match=message):
        decode_view(packed, {"mode": "ATTRIBUTES", "count": 4, "byteStride": 12, **change})


def test_an_absent_library_is_named_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "DracoPy", None)
    with pytest.raises(MissingDependencyError, match=r"flexpara\[formats\]"):
        decode_draco(b"", {})


def test_compression_that_is_undone_is_named(tmp_path: Path) -> None:
    packed = DracoPy.encode(SINGLE, FACES.astype(np.uint32), preserve_order=True)
    extension = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}
    tree = {
        "meshes": [{"primitives": [{"attributes": {"POSITION": 1}, "indices": 0, "extensions": extension}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "accessors": accessors(),
        "buffers": [{"byteLength": len(packed)}],
        "bufferViews": [{"buffer": 0, "byteLength": len(packed)}],
        "extensionsRequired": ["KHR_draco_mesh_compression"],
    }
    (tmp_path / "packed.glb").write_bytes(glb(tree, packed))
    asset = load_asset(tmp_path / "packed.glb")
    assert lost(asset, Outputs(formats=("glb",), maps=())) == {"draco_undone": 1, "given_materials": 1}
    assert "draco_undone" not in lost(asset, Outputs(formats=("obj",), maps=()))

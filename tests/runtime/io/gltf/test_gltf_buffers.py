"""glTF buffers: data URIs however they are written, positions of any kind of number."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest

from flexpara.runtime.io.gltf.scene import read_gltf

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, -1, 0]])


def gltf(rows: np.ndarray, uri: str = "", **more: Any) -> bytes:
    """A file of one triangle whose positions are rows (3, 3 or 4), with further fields of its tree."""
    data = rows.tobytes()
    kind = {"float32": 5126, "int16": 5122}[rows.dtype.name]
    accessor = {"bufferView": 0, "componentType": kind, "count": 3, "type": "VEC3", "normalized": kind == 5122}
    tree = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(data), "uri": uri or f"data:;base64,{base64.b64encode(data).decode()}"}],
        "bufferViews": [{"buffer": 0, "byteLength": len(data), "byteStride": rows.strides[0]}],
        "accessors": [accessor],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "nodes": [{"mesh": 0}],
    }
    return json.dumps({**tree, **more}).encode()


@pytest.mark.parametrize(("head", "coded"), [(";base64", False), (";base64", True), (";BASE64", False), ("", True)])
def test_data_uris_are_read_however_they_are_written(tmp_path: Path, head: str, coded: bool) -> None:
    rows = CORNERS.astype(np.float32)
    body = base64.b64encode(rows.tobytes()).decode() if head else ""
    body = quote(body or rows.tobytes(), safe="") if coded else body
    raw = read_gltf(gltf(rows, f"data:application/octet-stream{head},{body}"), tmp_path)
    np.testing.assert_array_equal(raw.positions, CORNERS)


def test_quantized_positions_stand_where_their_node_takes_them(tmp_path: Path) -> None:
    rows = np.zeros((3, 4), dtype=np.int16)
    rows[:, :3] = 32767 * CORNERS
    nodes = [{"mesh": 0, "scale": [5, 5, 5], "translation": [1, 2, 3]}]
    raw = read_gltf(gltf(rows, nodes=nodes, extensionsRequired=["KHR_mesh_quantization"]), tmp_path)
    np.testing.assert_allclose(raw.positions, [[1, 2, 3], [6, 2, 3], [1, -3, 3]], atol=1e-9)

"""Limits of what is read: small files that would grow are refused before they do, and a user may let them in."""

from __future__ import annotations

import io
import json
import struct
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest

from flexpara.runtime.errors import InputError, MeshError
from flexpara.runtime.io.gltf.scene import read_gltf
from flexpara.runtime.io.limits import Limits, limits
from flexpara.runtime.io.obj.read import read_obj
from flexpara.runtime.io.pictures.pictures import decode_image
from flexpara.runtime.io.points.tables import read_npz


def png(width: int, height: int) -> bytes:
    """A grey picture that is all black: a thousandth of its size, as deflate goes no further."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    header = struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)
    rows = zlib.compress(bytes(height * (1 + (width + 7) // 8)), 9)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


def test_the_environment_raises_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    assert limits() == Limits()
    monkeypatch.setenv("FLEXPARA_LIMITS", "faces=7, ratio=5")
    assert limits() == Limits(faces=7, ratio=5)


@pytest.mark.parametrize("words", ["faces", "faces=0", "faces=-1", "planes=3", "faces=1e9"])
def test_a_limit_that_is_none_is_refused(words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FLEXPARA_LIMITS", words)
    with pytest.raises(InputError, match=r"FLEXPARA_LIMITS has .* expected NAME=NUMBER"):
        limits()


def test_a_small_picture_of_many_pixels_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    data = png(10_000, 10_000)
    assert len(data) < 20_000
    with pytest.raises(MeshError, match=r"would take 400000000 bytes .* FLEXPARA_LIMITS=ratio=NUMBER"):
        decode_image(data)
    monkeypatch.setenv("FLEXPARA_LIMITS", "ratio=1")
    assert decode_image(png(64, 64)).shape == (64, 64, 4)


def test_an_archive_that_grows_is_refused() -> None:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_BZIP2) as archive:
        archive.writestr("points.npy", bytes(80 << 20))
    with pytest.raises(MeshError, match="the archive would take"):
        read_npz(stream.getvalue())


def test_an_accessor_of_nothing_is_not_made(tmp_path: Path) -> None:
    tree = {
        "asset": {"version": "2.0"},
        "nodes": [{"mesh": 0}],
        "accessors": [{"componentType": 5126, "count": 50_000_000, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    }
    with pytest.raises(MeshError, match="glTF accessor 0 would take 600000000 bytes"):
        read_gltf(json.dumps(tree).encode(), tmp_path)


def test_many_primitives_of_the_same_vertices_are_refused(tmp_path: Path) -> None:
    points = np.random.default_rng(0).normal(size=(500, 3)).astype(np.float32).tobytes()
    tree = {
        "asset": {"version": "2.0"},
        "nodes": [{"mesh": 0}],
        "buffers": [{"byteLength": 6000}],
        "bufferViews": [{"buffer": 0, "byteLength": 6000}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 500, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}] * 2000}],
    }
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", 6000, 0x004E4942) + points
    with pytest.raises(MeshError, match="the scene's vertices would take"):
        read_gltf(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks, tmp_path)


def test_a_polygon_beyond_reason_is_refused_at_once() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 20_000, endpoint=False)
    radius = 1.0 + 0.5 * (np.arange(len(angle)) % 2)
    lines = [f"v {x} {y} 0" for x, y in zip(radius * np.cos(angle), radius * np.sin(angle), strict=True)]
    text = "\n".join([*lines, "f " + " ".join(map(str, range(1, len(angle) + 1)))])
    with pytest.raises(MeshError, match="20000 corners and is not convex"):
        read_obj(text.encode(), lambda _: None)


def test_many_materials_are_told_apart() -> None:
    """A name was once looked for in the list of all: minutes."""
    lines = ["v 0 0 0", "v 1 0 0", "v 0 1 0", *(f"usemtl m{index}\nf 1 2 3" for index in range(40_000))]
    assert len(read_obj("\n".join(lines).encode(), lambda _: None).materials) == 40_000

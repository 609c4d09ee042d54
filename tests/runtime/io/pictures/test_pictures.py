"""Pictures and names beside a mesh: decoding, limits, and nothing outside the folder."""

from __future__ import annotations

import base64
import io
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from flexpara.runtime.errors import MeshError
from flexpara.runtime.io.gltf.buffers import GltfFile
from flexpara.runtime.io.gltf.materials import read_materials
from flexpara.runtime.io.obj.materials import read_mtl
from flexpara.runtime.io.pictures.colors import linear_to_srgb
from flexpara.runtime.io.pictures.pictures import PNG, decode_image, is_deep, read_in_folder


def png(pixels: np.ndarray) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, format="PNG")
    return stream.getvalue()


def test_every_kind_of_picture_becomes_rgba() -> None:
    grey = np.array([[0, 128], [255, 7]], dtype=np.uint8)
    decoded = decode_image(png(grey))
    assert decoded.shape == (2, 2, 4)
    np.testing.assert_array_equal(decoded[:, :, 0], grey)
    np.testing.assert_array_equal(decoded[:, :, 3], 255)


def deep_png(levels: np.ndarray) -> bytes:
    """(h, w, c) uint16 as a PNG of 16 bits a channel."""

    def chunk(name: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))

    height, width, channels = levels.shape
    head = struct.pack(">IIBBBBB", width, height, 16, {1: 0, 2: 4, 3: 2, 4: 6}[channels], 0, 0, 0)
    rows = b"".join(b"\0" + row.astype(">u2").tobytes() for row in levels)
    return PNG + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_of_16_bits_a_channel_the_upper_8_are_kept(channels: int) -> None:
    levels = np.arange(0, 65536, 257, dtype=np.uint16).reshape(16, 16, 1).repeat(channels, axis=2)
    data = deep_png(levels)
    decoded = decode_image(data)
    np.testing.assert_array_equal(decoded[..., 0], np.arange(256).reshape(16, 16))
    np.testing.assert_array_equal(decoded[..., 3], 255 if channels % 2 else np.arange(256).reshape(16, 16))
    assert is_deep(data)
    assert not is_deep(png(decoded))
    _, changes = read_mtl(b"newmtl a\nmap_Kd a.png\nnewmtl b\nmap_Kd a.png\n", lambda _: data)
    assert changes == {"missing_textures": 0, "textures_to_8_bits": 1}


def test_a_deep_picture_of_a_gltf_file_is_counted_once_though_several_materials_name_it() -> None:
    data = deep_png(np.zeros((2, 2, 3), np.uint16))
    tree = {
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}] * 2,
        "textures": [{"source": 0}],
        "images": [{"uri": "data:image/png;base64," + base64.b64encode(data).decode()}],
    }
    _, changes = read_materials(GltfFile(tree, [], Path()))
    assert changes == {"textures_not_decoded": 0, "textures_of_other_uv": 0, "textures_to_8_bits": 1}


def test_a_picture_too_large_or_damaged_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = png(np.random.default_rng(0).integers(0, 256, (64, 64, 4)).astype(np.uint8))
    with pytest.raises(MeshError, match="damaged"):
        decode_image(whole[: len(whole) // 2])
    with pytest.raises(MeshError, match="no picture that is read"):
        decode_image(b"GIF?")
    monkeypatch.setenv("FLEXPARA_LIMITS", f"texels={64 * 64 - 1}")
    with pytest.raises(MeshError, match="64 × 64 pixels"):
        decode_image(whole)


def test_pictures_of_a_file_are_limited_together(monkeypatch: pytest.MonkeyPatch) -> None:
    data = png(np.zeros((64, 64), np.uint8))
    picture = decode_image(data)
    monkeypatch.setenv("FLEXPARA_LIMITS", f"texels={64 * 64}")
    assert decode_image(data, [picture, None, picture, picture]).shape == (64, 64, 4)
    with pytest.raises(MeshError, match="together"):
        decode_image(data, [picture] * 4)


def test_names_reach_only_files_of_the_folder(tmp_path: Path) -> None:
    folder = tmp_path / "in"
    (folder / "sub").mkdir(parents=True)
    for path in (tmp_path / "out.png", folder / "in.png", folder / "sub" / "deep.png"):
        path.write_text(path.name)
    (folder / "link.png").symlink_to(tmp_path / "out.png")
    assert read_in_folder(folder, " in.png ") == b"in.png"
    assert read_in_folder(folder, "sub/deep.png") == b"deep.png"
    assert read_in_folder(folder, "D:\\art\\in.png") == b"in.png"
    for name in ("../out.png", str(tmp_path / "out.png"), "link.png", "", ".", "..", "sub", "gone.png"):
        assert read_in_folder(folder, name) is None


def test_a_material_library_gives_factors_and_counts_missing_pictures() -> None:
    text = b"junk 1\nnewmtl a b\nKd 0.25\nnewmtl c\nKd 2 -1 0.5\nmap_Kd gone.png\n"
    materials, changes = read_mtl(text, lambda _: None)
    assert changes == {"missing_textures": 1, "textures_to_8_bits": 0}
    assert materials["a b"].base_color_factor == (0.25, 0.25, 0.25, 1.0)
    assert materials["c"].base_color_factor == (1.0, 0.0, 0.5, 1.0)
    with pytest.raises(MeshError, match="expected numbers"):
        read_mtl(b"newmtl a\nKd red\n", lambda _: None)


def test_the_srgb_curve_has_its_known_points_and_no_jump() -> None:
    np.testing.assert_allclose(linear_to_srgb(np.array([0.0, 1.0, 0.5])), [0.0, 1.0, 0.735356983052], atol=1e-12)
    knee = linear_to_srgb(np.array([0.0031308 - 1e-9, 0.0031308 + 1e-9]))
    assert abs(np.diff(knee)[0]) < 1e-6


def test_physically_based_lines_and_clamping_are_read() -> None:
    stream = io.BytesIO()
    Image.new("RGBA", (2, 2), (9, 8, 7, 128)).save(stream, "PNG")
    text = b"newmtl a\nmap_Kd -clamp on a.png\nnorm n.png\nmap_Ke gone.png\nKe 0.5\nPm 1\nPr 0.25\n"
    materials, changes = read_mtl(text, lambda name: None if name == "gone.png" else stream.getvalue())
    material = materials["a"]
    assert changes["missing_textures"] == 1
    assert set(material.pictures) == {"base-color", "normal"}
    assert material.pictures["base-color"].wrap == ("clamp", "clamp")
    assert material.pictures["normal"].wrap == ("repeat", "repeat")
    assert (material.metallic, material.roughness, material.emissive) == (1.0, 0.25, (0.5, 0.5, 0.5))
    assert material.alpha_mode == "BLEND"


@pytest.mark.parametrize("line", [b"Ke red", b"Pm nan", b"Pr inf"])
def test_factors_that_are_no_numbers_are_refused(line: bytes) -> None:
    with pytest.raises(MeshError, match="expected numbers"):
        read_mtl(b"newmtl a\n" + line + b"\n", lambda _: None)

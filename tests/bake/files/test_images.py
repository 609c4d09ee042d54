"""Files hold what they were given: losslessly, without hidden colour transforms, the same bytes each time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexpara.bake.colors.color import byte_to_linear, srgb_exact
from flexpara.bake.files.images import (
    EncodingError,
    bayer_threshold,
    encode_png,
    quantize,
    read_image,
    write_exr,
    write_png,
    write_texture,
)
from flexpara.bake.texture import Bits, Encoding, Texture
from flexpara.runtime.errors import InputError


def texture(pixels: np.ndarray, encoding: Encoding, bits: Bits = 8, *, dither: bool = False) -> Texture:
    return Texture(np.asarray(pixels, np.float32), encoding, bits, "png", dither)


def noise(channels: int, low: float = 0.0, high: float = 1.0) -> np.ndarray:
    return np.random.default_rng(2).uniform(low, high, (19, 23, channels)).astype(np.float32)


def chunk_names(data: bytes) -> list[bytes]:
    names, place = [], 8
    while place < len(data):
        names.append(data[place + 4 : place + 8])
        place += 12 + int.from_bytes(data[place : place + 4], "big")
    return names


@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("bits", [8, 16])
def test_png_levels_come_back_as_they_were(tmp_path: Path, channels: int, bits: Bits) -> None:
    picture = texture(noise(channels), "unit", bits)
    write_png(picture, tmp_path / "a.png")
    stored = np.asarray(read_image(tmp_path / "a.png"), np.uint16)
    np.testing.assert_array_equal(stored, quantize(picture))
    assert read_image(tmp_path / "a.png").dtype == (np.uint8 if bits == 8 else np.uint16)
    assert np.abs(stored / (2.0**bits - 1) - picture.pixels).max() <= 0.51 / (2**bits - 1)


def test_float_exr_is_lossless(tmp_path: Path) -> None:
    picture = texture(noise(3, -1e9, 1e9), "linear", 32)
    write_exr(picture, tmp_path / "a.exr")
    stored = read_image(tmp_path / "a.exr")
    assert stored.dtype == np.float32
    np.testing.assert_array_equal(stored, picture.pixels)


def test_half_exr_is_the_nearest_half(tmp_path: Path) -> None:
    picture = texture(noise(4, -2.0, 2.0), "signed", 16)
    write_exr(picture, tmp_path / "a.exr")
    stored = read_image(tmp_path / "a.exr")
    assert stored.dtype == np.float16
    np.testing.assert_array_equal(stored, picture.pixels.astype(np.float16))


def test_row_0_is_the_top_of_both_formats(tmp_path: Path) -> None:
    pixels = np.zeros((4, 2, 3), np.float32)
    pixels[0] = 1.0
    for name in ("a.png", "a.exr"):
        write_texture(texture(pixels, "unit", 16), tmp_path / name)
        stored = read_image(tmp_path / name).astype(np.float64)
        assert stored[0].min() > 0.9
        assert stored[1:].max() == 0.0


def test_colour_is_srgb_in_png_and_linear_in_exr(tmp_path: Path) -> None:
    levels = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    picture = texture(byte_to_linear()[levels], "srgb", 8)
    np.testing.assert_array_equal(quantize(picture), levels)
    write_exr(picture, tmp_path / "a.exr", bits=32)
    np.testing.assert_array_equal(read_image(tmp_path / "a.exr"), picture.pixels)


def test_16_bit_colour_follows_the_curve() -> None:
    picture = texture(noise(3), "srgb", 16)
    assert np.abs(quantize(picture) - srgb_exact(picture.pixels) * 65535).max() < 0.6


@pytest.mark.parametrize("bits", [8, 16])
def test_alpha_is_not_curved(bits: Bits) -> None:
    stored = quantize(texture(np.full((1, 1, 4), 0.5), "srgb", bits))[0, 0] / (2.0**bits - 1)
    np.testing.assert_allclose(stored, [0.7354, 0.7354, 0.7354, 0.5], atol=0.003)


def test_signed_values_fill_the_range() -> None:
    stored = quantize(texture(np.array([[[-1.0, 0.0, 1.0]]]), "signed", 16))
    np.testing.assert_array_equal(stored[0, 0], [0, 32768, 65535])


def test_values_beyond_the_range_are_clamped() -> None:
    np.testing.assert_array_equal(quantize(texture(np.array([[[-3.0, 2.0, 1.0]]]), "unit"))[0, 0], [0, 255, 255])


def test_dither_keeps_the_mean_and_moves_by_less_than_a_level() -> None:
    for value in (0.1, 0.50196, 0.7):
        pixels = np.full((64, 64, 3), value, np.float32)
        stored = quantize(texture(pixels, "unit", dither=True)).astype(np.float64)
        assert abs(stored.mean() - value * 255) < 0.02
        assert np.abs(stored - value * 255).max() < 1.0
        assert np.ptp(quantize(texture(pixels, "unit"))) == 0


def test_dither_leaves_whole_levels_and_16_bits_alone() -> None:
    whole = texture(np.full((16, 16, 1), 128 / 255), "unit", dither=True)
    assert np.ptp(quantize(whole)) == 0
    assert np.ptp(quantize(texture(np.full((16, 16, 1), 0.123), "unit", 16, dither=True))) == 0


def test_the_dither_pattern_holds_each_of_64_thresholds_once() -> None:
    pattern = bayer_threshold(8, 8)
    np.testing.assert_allclose(np.sort(pattern.reshape(-1)), (np.arange(64) + 0.5) / 64, atol=1e-7)
    np.testing.assert_array_equal(bayer_threshold(11, 20)[8:, 16:], pattern[:3, :4])


def test_png_holds_no_colour_chunk_and_the_same_pixels_give_the_same_bytes() -> None:
    picture = texture(noise(3), "srgb")
    data = encode_png(picture)
    assert set(chunk_names(data)) == {b"IHDR", b"IDAT", b"IEND"}
    assert data == encode_png(picture)


def test_exr_carries_its_metadata_and_repeats_its_bytes(tmp_path: Path) -> None:
    picture = Texture(noise(3), "linear", 32, "exr", metadata={"units": "source units"})
    for name in ("a.exr", "b.exr"):
        write_exr(picture, tmp_path / name)
    assert b"source units" in (tmp_path / "a.exr").read_bytes()
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


@pytest.mark.parametrize(
    ("pixels", "encoding", "bits", "text"),
    [
        (np.zeros((2, 2, 3)), "linear", 16, "write an EXR"),
        (np.zeros((2, 2, 3)), "unit", 32, "32 bits"),
        (np.full((2, 2, 3), np.nan), "unit", 8, "NaN"),
        (np.zeros((2, 2)), "unit", 8, "shape"),
        (np.zeros((2, 2, 5)), "unit", 8, "1 to 4 channels"),
    ],
)
def test_what_png_cannot_hold_is_refused(pixels: np.ndarray, encoding: Encoding, bits: Bits, text: str) -> None:
    with pytest.raises(EncodingError, match=text):
        encode_png(texture(pixels, encoding, bits))


def test_what_half_cannot_hold_is_refused(tmp_path: Path) -> None:
    with pytest.raises(EncodingError, match="32 bits"):
        write_exr(texture(np.full((1, 1, 1), 1e6), "linear", 16), tmp_path / "a.exr")
    assert not (tmp_path / "a.exr").exists()


def test_other_endings_and_unreadable_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(EncodingError, match=r"a\.jpg"):
        write_texture(texture(noise(3), "unit"), tmp_path / "a.jpg")
    (tmp_path / "b.png").write_bytes(b"no image")
    with pytest.raises(InputError, match=r"b\.png"):
        read_image(tmp_path / "b.png")


def test_a_tall_picture_is_dithered_as_one() -> None:
    """Rows are quantized in bands: the pattern and the values go on across them."""
    pixels = np.random.default_rng(6).random((300, 9, 3)).astype(np.float32)
    expected = np.clip(np.floor(pixels * np.float32(255) + bayer_threshold(300, 9)[..., None]), 0, 255)
    np.testing.assert_array_equal(quantize(texture(pixels, "unit", dither=True)), expected)


def test_an_exr_holds_no_clock(tmp_path: Path) -> None:
    write_exr(texture(noise(3), "linear", 32), tmp_path / "a.exr")
    assert b"1970:01:01" in (tmp_path / "a.exr").read_bytes()

"""Colour: the sRGB curve, and distinct colours for charts.

Linear light and sRGB values are in [0, 1]; primaries are those of Rec. 709 in both.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

LEVELS = 1 << 16
GOLDEN_TURN = 0.6180339887498949
LIGHTNESS = (0.74, 0.62, 0.82, 0.54)
"""Oklab lightness of neighbouring chart numbers: charts of near hue still differ."""
CHROMA = 0.125


def linear_from_srgb(srgb: NDArray[np.floating]) -> NDArray[np.float64]:
    """Linear light of sRGB values in [0, 1], same shape, float64 (IEC 61966-2-1)."""
    value = np.asarray(srgb, np.float64)
    return np.where(value <= 0.04045, value / 12.92, ((np.maximum(value, 0.04045) + 0.055) / 1.055) ** 2.4)


def srgb_exact(linear: NDArray[np.floating]) -> NDArray[np.float64]:
    """Linear light in [0, 1] → sRGB, same shape, float64 (IEC 61966-2-1)."""
    value = np.asarray(linear, np.float64)
    return np.where(value <= 0.0031308, value * 12.92, 1.055 * np.maximum(value, 0.0031308) ** (1.0 / 2.4) - 0.055)


def srgb_from_linear(linear: NDArray[np.float32]) -> NDArray[np.float32]:
    """Linear light → sRGB, same shape, float32, clamped to [0, 1]; interpolated in a table of 65,537 entries.

    Differs from `srgb_exact` by less than 1e-6.
    """
    place = np.clip(linear, 0.0, 1.0).astype(np.float32, copy=False) * np.float32(LEVELS)
    index = np.minimum(place.astype(np.int32), LEVELS - 1)
    place -= index
    table = srgb_exact(np.arange(LEVELS + 1) / LEVELS).astype(np.float32)
    result = np.diff(table)[index]
    result *= place
    result += table[index]
    return result


def srgb_bytes_from_linear(linear: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Linear light → 8-bit sRGB levels, same shape, clamped, fast; rounds where ± 0.05 levels lie between."""
    table = np.round(srgb_exact(np.arange(LEVELS + 1) / LEVELS) * 255.0).astype(np.uint8)
    place = linear * np.float32(LEVELS)
    place += np.float32(0.5)
    np.clip(place, 0.0, LEVELS, out=place)
    return table[place.astype(np.int32)]


def byte_to_linear() -> NDArray[np.float32]:
    """(256,) float32: linear light of each 8-bit sRGB level."""
    return linear_from_srgb(np.arange(256) / 255.0).astype(np.float32)


def chart_colors(count: int) -> NDArray[np.float32]:
    """(count, 3) float32 linear light: hues a golden section of the circle apart, lightness in turns of four."""
    number = np.arange(count)
    hue = 2.0 * np.pi * ((0.07 + number * GOLDEN_TURN) % 1.0)
    lightness = np.asarray(LIGHTNESS)[number % len(LIGHTNESS)]
    lab = np.stack([lightness, CHROMA * np.cos(hue), CHROMA * np.sin(hue)], axis=-1)
    return np.clip(linear_from_oklab(lab), 0.0, 1.0).astype(np.float32)


def linear_from_oklab(lab: NDArray[np.float64]) -> NDArray[np.float64]:
    """(…, 3) Oklab → linear light, not clamped (Ottosson 2020, bottosson.github.io/posts/oklab)."""
    to_cone = np.array(
        [[1.0, 0.3963377774, 0.2158037573], [1.0, -0.1055613458, -0.0638541728], [1.0, -0.0894841775, -1.2914855480]]
    )
    to_linear = np.array(
        [
            [4.0767416621, -3.3077115913, 0.2309699292],
            [-1.2684380046, 2.6097574011, -0.3413193965],
            [-0.0041960863, -0.7034186147, 1.7076147010],
        ]
    )
    return ((lab @ to_cone.T) ** 3) @ to_linear.T

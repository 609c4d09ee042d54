"""Several samples per texel: maps made on a finer image, then averaged over what each texel holds of the surface.

h w texels · k samples along a texel's side, k² in all · c channels.  Maps are linear in memory, so the mean is taken in
linear space.  Samples beside the surface don't count, so borders don't darken.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...runtime.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

SAMPLES = (1, 4, 16)


def samples_along(samples: int) -> int:
    """1, 2 or 4 along the side of a texel for 1, 4 or 16 samples in it.  Raises: InputError for other numbers."""
    if samples not in SAMPLES:
        raise InputError(f"samples {samples}: expected one of {', '.join(map(str, SAMPLES))} per texel")
    return {1: 1, 4: 2, 16: 4}[samples]


def covered_texels(covered: NDArray[np.bool_], along: int) -> NDArray[np.bool_]:
    """(k h, k w) → (h, w) bool: whether a sample of the texel holds a surface."""
    return np.asarray(_blocks(covered[..., None], along).any(axis=(1, 3)))[..., 0]


def averaged(
    pixels: NDArray[np.float32], covered: NDArray[np.bool_], along: int, *, unit: bool = False
) -> NDArray[np.float32]:
    """(k h, k w, c) → (h, w, c) float32: mean over the covered samples of each texel, 0 where there is none.

    unit: the channels are a vector of length 1, and so they stay; a mean of length 0 becomes the first sample.
    """
    weight = _blocks(covered[..., None].astype(np.float32), along)
    mean = (_blocks(pixels, along) * weight).sum(axis=(1, 3))
    mean /= np.maximum(weight.sum(axis=(1, 3)), 1.0)
    if not unit:
        return mean
    length = np.linalg.norm(mean, axis=-1, keepdims=True)
    return np.where(length > 1e-6, mean / np.maximum(length, 1e-6), first_covered(pixels, covered, along))


def first_covered(pixels: NDArray[np.float32], covered: NDArray[np.bool_], along: int) -> NDArray[np.float32]:
    """(k h, k w, c) → (h, w, c): the first covered sample of each texel, 0 without one; for values that don't mix."""
    height, width, channels = pixels.shape[0] // along, pixels.shape[1] // along, pixels.shape[2]
    order = (0, 2, 1, 3, 4)
    values = _blocks(pixels, along).transpose(order).reshape(height, width, along * along, channels)
    held = _blocks(covered[..., None], along).transpose(order).reshape(height, width, along * along)
    chosen = np.take_along_axis(values, held.argmax(axis=2)[..., None, None], axis=2)[:, :, 0]
    return np.where(np.asarray(held.any(axis=2))[..., None], chosen, np.float32(0.0))


def _blocks(values: NDArray[Any], along: int) -> NDArray[Any]:
    """(k h, k w, c) → view (h, k, w, k, c)."""
    height, width, channels = values.shape
    return values.reshape(height // along, along, width // along, along, channels)

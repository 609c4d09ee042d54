"""Pictures of the source looked up through its old uv: wrapped, decoded and filtered by the footprint of each texel.

t texels · f faces · h w source texels.  Both atlases lie on the same faces, so no search is needed: the G-buffer names
face and place, the old uv follow.  uv are v up, row 0 of a picture is its top.

A new texel is a parallelogram in the old picture, the same for all texels of a face.  It is averaged over a grid of up
to `MOST` × `MOST` points, one or two along its shorter side, with spacing of about one texel of a picture that is
halved as often as that needs.  Where the new texel is the smaller one, it takes the bilinear value at its centre less
up to `SHARPEN` times the second differences to its four neighbours: a reader's bilinear filter blurs by about as much.
Colours are averaged in linear light, normals as vectors.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from ...runtime.geometry.triangles import cross_2d
from ...runtime.pagesize import PageSize
from ..colors.color import byte_to_linear

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.material import Picture, Wrap
    from ...runtime.pagesize import Size

ROUNDING = 0.01
"""Powers of 2 by which a footprint may exceed a grid: uv in float32 make texels that are copied one by one uneven."""
MOST = 8
"""Points along each side of a texel's footprint."""
SHARPEN = 1.0 / 8.0
"""1/12 is the least-squares answer for a parabola; 1/8 measured best on pictures, whose bilinear kinks are sharper."""
Decoding = Literal["color", "data", "signed"]


@dataclass(frozen=True, eq=False)
class SourceTexture:
    """A picture that is ready to be sampled.

    picture: pixels, wrap modes, placement.  decoding: color is sRGB → linear light, data is [0, 1], signed is [−1, 1];
    the fourth channel is [0, 1] in all.  channels: those that are read, as numbers; the others stay 0.
    """

    picture: Picture
    decoding: Decoding
    channels: tuple[int, ...] = (0, 1, 2, 3)

    @cached_property
    def curves(self) -> NDArray[np.float32]:
        """(4, 256) float32: value of each level of each channel."""
        level = np.arange(256, dtype=np.float32) / np.float32(255.0)
        curve = {"color": byte_to_linear(), "data": level, "signed": level * 2 - 1}[self.decoding]
        return np.stack([curve, curve, curve, level])

    @cached_property
    def _smaller(self) -> list[NDArray[np.float32]]:
        """Halved pictures made so far, the first one half the size: a cache of `level`."""
        return []

    @cached_property
    def _packed(self) -> NDArray[np.uint32]:
        """(h · w,) texels of four bytes, so that one look-up gets all channels."""
        return np.ascontiguousarray(self.picture.pixels).view(np.uint32).reshape(-1)

    def level(self, number: int) -> NDArray[np.float32]:
        """(4, h, w) float32 values of the picture halved `number` ≥ 1 times by 2 × 2 means, down to one texel."""
        while len(self._smaller) < number:
            pixels = self.picture.pixels
            whole = [curve[pixels[..., channel]] for channel, curve in enumerate(self.curves)]
            last = self._smaller[-1] if self._smaller else np.stack(whole)
            self._smaller.append(halved(last))
        return self._smaller[number - 1]

    def sample(self, u: NDArray[np.float64], v: NDArray[np.float64], number: int) -> NDArray[np.float32]:
        """(4, t) float32 at picture uv (t,), (t,), bilinear on a level (nearest where the picture is not smooth)."""
        height, width = self.picture.pixels.shape[:2] if number == 0 else self.level(number).shape[1:]
        x, y = u * width - 0.5, (1.0 - v) * height - 0.5
        if not self.picture.smooth:
            row, column = self._wrapped(np.rint(y), 1, height), self._wrapped(np.rint(x), 0, width)
            return self._texels(row * width + column, number)
        left, top = np.floor(x), np.floor(y)
        across, down = (x - left).astype(np.float32), (y - top).astype(np.float32)
        first, second = (self._wrapped(left + step, 0, width) for step in (0, 1))
        rows = [self._wrapped(top + step, 1, height) * width for step in (0, 1)]
        upper, lower = (
            _between(self._texels(row + first, number), self._texels(row + second, number), across) for row in rows
        )
        return _between(upper, lower, down)

    def _wrapped(self, index: NDArray[np.float64], axis: int, count: int) -> NDArray[np.int64]:
        """(t,) texel numbers of whole numbers that may lie outside [0, count)."""
        return wrapped(index, count, self.picture.wrap[axis])

    def _texels(self, index: NDArray[np.int64], number: int) -> NDArray[np.float32]:
        """(4, t) float32 values of single texels of a level."""
        values = np.zeros((4, len(index)), np.float32)
        if number > 0:
            flat = self.level(number).reshape(4, -1)
            for channel in self.channels:
                flat[channel].take(index, out=values[channel], mode="clip")
            return values
        levels = self._packed.take(index).view(np.uint8).reshape(-1, 4)
        for channel in self.channels:
            self.curves[channel].take(levels[:, channel], out=values[channel], mode="clip")
        return values


def _between(
    first: NDArray[np.float32], second: NDArray[np.float32], share: NDArray[np.float32]
) -> NDArray[np.float32]:
    """(4, t) first + share · (second − first); second is used up."""
    second -= first
    second *= share
    second += first
    return second


class FootprintSampler:
    """A texture with the footprints that the new texels of each face have in it."""

    def __init__(self, texture: SourceTexture, axes: NDArray[np.float64]) -> None:
        """Prepare.  axes: (f, 2, 2) float64 as from `texel_axes`."""
        place = np.asarray(texture.picture.placement)
        height, width = texture.picture.pixels.shape[:2]
        self.texture, self.place = texture, place
        self.steps = axes @ place[:, :2].T
        in_texels = self.steps * np.array([width, height], np.float64)
        self.counts, self.levels = footprint_grids(in_texels)
        length = np.linalg.norm(in_texels, axis=2).max(axis=1)
        self.gain = SHARPEN * np.clip(2.0 * (1.0 - length), 0.0, 1.0).astype(np.float32)
        self.kind = np.log2(self.counts).astype(np.int64) @ np.array([1, 8]) + 64 * self.levels

    def make_levels(self, faces: NDArray[np.int64]) -> None:
        """Make the smaller pictures that these faces (m,) need, so that threads only read them."""
        number = int(self.levels[faces].max(initial=0))
        if number > 0:
            self.texture.level(number)

    def sample(self, uv: NDArray[np.float64], face: NDArray[np.int64]) -> NDArray[np.float32]:
        """(t, 4) float32 means over the footprints of texels with centres at old uv (t, 2) on faces (t,)."""
        u, v = self.place[:, :2] @ uv.T + self.place[:, 2:]
        kind = self.kind[face]
        result = np.zeros((4, len(uv)), np.float32)
        for key in np.unique(kind):
            chosen = np.flatnonzero(kind == key)
            faces = face[chosen]
            step, grid = self.steps[faces].transpose(1, 2, 0), self.counts[faces[0]]
            if key == 0 and self.texture.picture.smooth:
                result[:, chosen] = self._sharpened(u[chosen], v[chosen], step, self.gain[faces])
            else:
                result[:, chosen] = self._averaged(u[chosen], v[chosen], step, grid, int(key) // 64)
        return result.T

    def _averaged(
        self,
        u: NDArray[np.float64],
        v: NDArray[np.float64],
        step: NDArray[np.float64],
        grid: NDArray[np.int64],
        level: int,
    ) -> NDArray[np.float32]:
        """(4, t) means of grid[0] × grid[1] points of the parallelograms spanned by step (2, 2, t)."""
        (right_u, right_v), (down_u, down_v) = step
        total = np.zeros((4, len(u)), np.float32)
        for right in (np.arange(grid[0]) + 0.5) / grid[0] - 0.5:
            for down in (np.arange(grid[1]) + 0.5) / grid[1] - 0.5:
                total += self.texture.sample(
                    u + right * right_u + down * down_u, v + right * right_v + down * down_v, level
                )
        return total / np.float32(grid.prod())

    def _sharpened(
        self, u: NDArray[np.float64], v: NDArray[np.float64], step: NDArray[np.float64], gain: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """(4, t) values whose bilinear interpolation is near the picture everywhere, not only at texel centres.

        gain: (t,), 0 where texels are as large as those of the picture: what is copied texel by texel stays as it is.
        """
        total = self.texture.sample(u, v, 0)
        if not gain.any():
            return total
        total *= 1.0 + 4.0 * gain
        for step_u, step_v in step:
            for side in (-1.0, 1.0):
                total -= gain * self.texture.sample(u + side * step_u, v + side * step_v, 0)
        return total


def texel_axes(new_uv: NDArray[np.float64], old_uv: NDArray[np.float64], size: Size | PageSize) -> NDArray[np.float64]:
    """(f, 2, 2) float64: change of the old uv by one texel to the right (row 0) and one down (row 1), per face.

    new_uv, old_uv: (f, 3, 2) float64, v up.  size: of the new atlas.  Zero for a face that has no area
    in the new uv.
    """
    page = PageSize.of(size)
    new = (new_uv[:, 1:] - new_uv[:, :1]) * np.array([page.width, -page.height], np.float64)
    old = old_uv[:, 1:] - old_uv[:, :1]
    area = cross_2d(new[:, 0], new[:, 1])
    inverse = np.stack([new[:, 1, 1], -new[:, 0, 1], -new[:, 1, 0], new[:, 0, 0]], axis=1).reshape(-1, 2, 2)
    usable = np.abs(area) > 1e-12
    return np.where(usable[:, None, None], inverse / np.where(usable, area, 1.0)[:, None, None], 0.0) @ old


def footprint_grids(axes: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """How footprints (f, 2, 2), in source texels, are sampled: points per side (f, 2), powers of 2, and level (f,)."""
    length = np.linalg.norm(axes, axis=2)
    coarse = np.floor(np.log2(np.maximum(length.min(axis=1), 1.0)) + ROUNDING)
    length = length / np.exp2(coarse)[:, None]
    wanted = np.ceil(np.log2(np.maximum(length, 1.0)) - ROUNDING)
    counts = np.exp2(np.minimum(wanted, np.log2(MOST))).astype(np.int64)
    spacing = (length / counts).max(axis=1)
    further = np.rint(np.log2(np.maximum(spacing, 1.0)))
    return counts, np.clip(coarse + further, 0, 32).astype(np.int64)


def wrapped(index: NDArray[np.float64], count: int, wrap: Wrap) -> NDArray[np.int64]:
    """(t,) int64 in [0, count) of any whole numbers (glTF 2.0, samplers; OpenGL's wrap modes of the same names)."""
    if wrap == "clamp":
        return np.clip(index, 0, count - 1).astype(np.int64)
    whole = index.astype(np.int64)
    if wrap == "repeat":
        return _remainder(whole, count)
    turn = _remainder(whole, 2 * count)
    return np.minimum(turn, 2 * count - 1 - turn)


def _remainder(whole: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Whole modulo count, in [0, count); much faster for a power of two, which most pictures have."""
    return whole & (count - 1) if count & (count - 1) == 0 else np.mod(whole, count)


def halved(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """(c, ⌈h/2⌉, ⌈w/2⌉) float32 means of 2 × 2 texels; an odd last row or column stands for two."""
    height, width = image.shape[1:]
    even = np.pad(image, ((0, 0), (0, height % 2), (0, width % 2)), mode="edge")
    total = even[:, ::2, ::2] + even[:, 1::2, ::2]
    total += even[:, ::2, 1::2]
    total += even[:, 1::2, 1::2]
    return total / np.float32(4.0)


def linear_colors(colors: NDArray[np.uint8]) -> NDArray[np.float32]:
    """(…, 4) uint8 sRGB with straight alpha → float32 linear RGBA in [0, 1]."""
    linear = byte_to_linear()[colors]
    linear[..., 3] = colors[..., 3] / np.float32(255.0)
    return linear

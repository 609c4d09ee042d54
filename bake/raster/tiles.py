"""Maps window by window: what is drawn at once is bounded, whatever the size of the image.

h w texels · k samples along a texel's side.  The arrays that windows are drawn into are used again for the next window.
"""

from __future__ import annotations

import warnings
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np

from ...runtime.errors import InputError, MissingDependencyError
from .context import max_texture_size, open_context
from .gbuffer import DeviceRasterizer, GBuffer
from .layout import Layout, Planes, Window, check_size, windows
from .software import SoftwareRasterizer
from .supersample import averaged, covered_texels, first_covered, samples_along

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from ...runtime.mesh import Asset, Atlas
    from ..maps.maps import BakeMap

Device = Literal["auto", "opengl", "software"]
DEVICES: tuple[Device, ...] = ("auto", "opengl", "software")

WINDOW = 1 << 21
"""Samples drawn at once, about: 150 MB of targets and arrays, and what maps make in between stays small."""


class SoftwareWarning(UserWarning):
    """OpenGL cannot be had: numpy draws, with the same result, slower."""


class Rasterizer(Protocol):
    """What draws windows: `DeviceRasterizer` or `SoftwareRasterizer`."""

    def draw(self, window: Window, planes: Planes | None = None, *, clear: bool = True) -> GBuffer:
        """The G-buffer of a window."""
        ...


@dataclass(frozen=True)
class Plan:
    """How an image is cut into windows.

    size: texels per side.  samples: 1, 4 or 16 per texel.
    limit: the largest side that is drawn at once, in samples; None leaves it to the device.
    tile: the UDIM tile (a, b), uv [a, a + 1] × [b, b + 1]; None is the unit square, and uv must be inside.

    Raises: InputError for a value out of range.
    """

    size: int
    samples: int = 1
    limit: int | None = None
    tile: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        check_size(self.size)
        check_size(self.size * self.along)

    @property
    def along(self) -> int:
        """Samples along the side of a texel."""
        return samples_along(self.samples)

    def windows(self, device_limit: int) -> list[Window]:
        """Windows of the image, in texels.  Raises: InputError where the limit is less than a texel."""
        most = min(self.limit or device_limit, device_limit)
        if most < self.along:
            raise InputError(f"limit {most}: expected at least {self.along}, the samples along a texel")
        return windows(self.size, most // self.along, max(WINDOW // self.along**2, 1))

    def capacity(self, pieces: Sequence[Window]) -> tuple[int, int]:
        """Height and width of the largest window, in samples."""
        return self.along * max(w.height for w in pieces), self.along * max(w.width for w in pieces)


@contextmanager
def open_rasterizer(
    atlas: Atlas, plan: Plan, *, device: Device = "auto", warn: Callable[[str], None] | None = None
) -> Iterator[tuple[Rasterizer, list[Window]]]:
    """A rasterizer of the atlas and the windows to draw.

    device: "opengl", "software" (numpy: the same result, slower), or "auto": numpy where no OpenGL device answers.
    warn: called with one line when "auto" had to take numpy; without it a `SoftwareWarning` is issued.
    Raises: InputError as `gbuffer.rasterize`; MissingDependencyError when "opengl" cannot be had.
    """
    if device not in DEVICES:
        raise InputError(f"device {device!r}: expected one of {', '.join(DEVICES)}")
    layout = Layout.of(atlas, plan.size * plan.along, plan.tile)
    with ExitStack() as stack:
        if device != "software":
            try:
                context = stack.enter_context(open_context())
            except MissingDependencyError as error:
                if device == "opengl":
                    raise
                _say(f"baking without OpenGL, which is slower, since {error}", warn)
            else:
                limit = max_texture_size(context)
                pieces = plan.windows(limit)
                yield DeviceRasterizer(context, stack, atlas, layout, plan.capacity(pieces)), pieces
                return
        yield SoftwareRasterizer(atlas, layout), plan.windows(plan.size * plan.along)


def map_windows(
    rasterizer: Rasterizer,
    pieces: Sequence[Window],
    plan: Plan,
    entries: Sequence[BakeMap],
    atlas: Atlas,
    asset: Asset,
    progress: Callable[[str], None] | None = None,
) -> Iterator[BakedWindow]:
    """Window by window, every map.  What was yielded is not changed by the next window.

    progress: called with each map's name before it is made the first time.
    Raises: InputError when a map's function returns another shape than (h, w, 1 to 4).
    """
    planes = Planes.of(*plan.capacity(pieces))
    for number, window in enumerate(pieces):
        fine = window.scaled(plan.along)
        gbuffer = rasterizer.draw(fine, planes.shaped(fine.height, fine.width), clear=False)  # the rest is background
        held = gbuffer.face >= 0
        covered = covered_texels(held, plan.along) if plan.along > 1 else held
        maps: dict[str, NDArray[np.float32]] = {}
        for entry in entries:
            if progress is not None and number == 0:
                progress(entry.name)
            pixels = _reduced(computed(entry, gbuffer, atlas, asset), held, plan.along, entry)
            kept = any(np.may_share_memory(pixels, plane) for plane in planes)
            maps[entry.name] = pixels.copy() if kept else pixels
        inside = gbuffer.inside if plan.along == 1 else ~covered_texels(~gbuffer.inside, plan.along)
        yield BakedWindow(window, covered, inside, maps)


@dataclass(frozen=True, eq=False)
class BakedWindow:
    """The maps of a window.

    covered: (h, w) bool, which texels hold a surface.  inside: (h, w) bool, those whose samples all lie in faces.
    maps: name → (h, w, c) pixels, before gutters.
    """

    window: Window
    covered: NDArray[np.bool_]
    inside: NDArray[np.bool_]
    maps: dict[str, NDArray[np.float32]]


def computed(entry: BakeMap, gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
    """(h, w, c) float32 of one map.  Raises: InputError when its function returns another shape."""
    pixels = entry.compute(gbuffer, atlas, asset)
    if pixels.ndim != 3 or pixels.shape[:2] != gbuffer.shape or not 1 <= pixels.shape[2] <= 4:
        raise InputError(f"map {entry.name}: its function returned {pixels.shape}; expected (*{gbuffer.shape}, 1 to 4)")
    return np.asarray(pixels, np.float32)


def blank_gbuffer(size: int) -> GBuffer:
    """A G-buffer of size × size texels without a surface and without memory, for maps that need none."""
    nothing = np.broadcast_to(np.float32(0.0), (size, size))
    vector = np.broadcast_to(np.float32(0.0), (size, size, 3))
    face = np.broadcast_to(np.int32(-1), (size, size))
    return GBuffer(vector, vector, nothing, nothing, face, size=size)


def _reduced(pixels: NDArray[np.float32], held: NDArray[np.bool_], along: int, entry: BakeMap) -> NDArray[np.float32]:
    """Samples → texels."""
    if along == 1:
        return pixels
    if entry.value_range == "whole":
        return first_covered(pixels, held, along)
    return averaged(pixels, held, along, unit=entry.units == "unit vector")


def _say(message: str, warn: Callable[[str], None] | None) -> None:
    if warn is None:
        warnings.warn(message, SoftwareWarning, stacklevel=4)
    else:
        warn(message)

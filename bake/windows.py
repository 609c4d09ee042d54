"""Maps window by window, put together into images: what is drawn at once is bounded, whatever the size of the image.

h w texels · k samples along a texel's side.  The arrays that windows are drawn into are used again for the next window.
"""

from __future__ import annotations

import tempfile
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..runtime.errors import InputError
from .raster.gbuffer import GBuffer
from .raster.layout import Planes
from .raster.supersample import averaged, covered_texels, first_covered

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from ..runtime.mesh import Asset, Atlas
    from ..runtime.pagesize import PageSize
    from .bakemap import BakeMap
    from .raster.layout import Window
    from .raster.plan import Plan, Rasterizer


class Ground(NamedTuple):
    """What maps are made of: the atlas that is drawn, and the asset whose faces it has."""

    atlas: Atlas
    asset: Asset


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


def map_windows(
    rasterizer: Rasterizer,
    pieces: Sequence[Window],
    plan: Plan,
    entries: Sequence[BakeMap],
    ground: Ground,
    progress: Callable[[str], None],
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
            if number == 0:
                progress(entry.name)
            pixels = _reduced(computed(entry, gbuffer, ground), held, plan.along, entry)
            kept = any(np.may_share_memory(pixels, plane) for plane in planes)
            maps[entry.name] = pixels.copy() if kept else pixels
        inside = gbuffer.inside if plan.along == 1 else ~covered_texels(~gbuffer.inside, plan.along)
        yield BakedWindow(window, covered, inside, maps)


def put_together(
    windows: Iterable[BakedWindow], page: PageSize, scratch: Path | None
) -> tuple[dict[str, NDArray[np.float32]], NDArray[np.bool_], NDArray[np.bool_]]:
    """Windows → name → image (h, w, c), and which texels hold a surface and lie inside of it, (h, w) bool.

    One window is put into the images while the next is made.
    """
    images: dict[str, NDArray[np.float32]] = {}
    covered, inside = np.zeros((2, *page.shape), np.bool_)
    with ThreadPoolExecutor(1) as filler:
        filled: Future[None] | None = None
        for baked in windows:
            if filled is not None:
                filled.result()
            for name, part in baked.maps.items():
                images[name] = with_channels(images.get(name), part.shape[2], page, scratch)
            covered[baked.window.rows, baked.window.columns] = baked.covered
            inside[baked.window.rows, baked.window.columns] = baked.inside
            filled = filler.submit(put_window, baked, dict(images))
        if filled is not None:
            filled.result()
    return images, covered, inside


def computed(entry: BakeMap, gbuffer: GBuffer, ground: Ground) -> NDArray[np.float32]:
    """(h, w, c) float32 of one map.  Raises: InputError when its function returns another shape."""
    pixels = entry.compute(gbuffer, ground.atlas, ground.asset)
    if pixels.ndim != 3 or pixels.shape[:2] != gbuffer.shape or not 1 <= pixels.shape[2] <= 4:
        raise InputError(f"map {entry.name}: its function returned {pixels.shape}; expected (*{gbuffer.shape}, 1 to 4)")
    return np.asarray(pixels, np.float32)


def blank_gbuffer(page: PageSize) -> GBuffer:
    """A G-buffer of a whole image without a surface and without memory, for maps that need none."""
    nothing = np.broadcast_to(np.float32(0.0), page.shape)
    vector = np.broadcast_to(np.float32(0.0), (*page.shape, 3))
    face = np.broadcast_to(np.int32(-1), page.shape)
    return GBuffer(vector, vector, nothing, nothing, face, size=page)


def _reduced(pixels: NDArray[np.float32], held: NDArray[np.bool_], along: int, entry: BakeMap) -> NDArray[np.float32]:
    """Samples → texels."""
    if along == 1:
        return pixels
    if entry.value_range == "whole":
        return first_covered(pixels, held, along)
    return averaged(pixels, held, along, unit=entry.units == "unit vector")


def put_window(baked: BakedWindow, images: Mapping[str, NDArray[np.float32]]) -> None:
    """The maps of a window into the images; alpha is 1 where the window has none."""
    for name, part in baked.maps.items():
        target = images[name][baked.window.rows, baked.window.columns]
        target[..., : part.shape[2]] = part
        target[..., part.shape[2] :] = 1.0


def background_of(entry: BakeMap, image: NDArray[np.float32]) -> NDArray[np.float32]:
    """(c,) float32: what lies beyond gutters, in as many channels as the image has."""
    return np.asarray((*entry.background, 1.0)[: image.shape[2]], np.float32)


def with_channels(
    image: NDArray[np.float32] | None, channels: int, page: PageSize, scratch: Path | None = None
) -> NDArray[np.float32]:
    """An image (h, w, c) of at least so many channels: new, as it is, or with alpha 1 added.

    The number of channels may differ from window to window: a map leaves out alpha where it is 1.
    """
    if image is not None and image.shape[2] >= channels:
        return image
    wider = new_image((*page.shape, channels), scratch)
    if image is not None:
        wider[..., : image.shape[2]] = image
        wider[..., image.shape[2] :] = 1.0
    return wider


def new_image(shape: tuple[int, int, int], scratch: Path | None) -> NDArray[np.float32]:
    """Zeros (h, w, c) float32 in memory, or in a file without a name in a folder, which goes when the array goes."""
    if scratch is None:
        return np.zeros(shape, np.float32)
    with tempfile.TemporaryFile(dir=scratch) as file:
        return np.memmap(file, np.float32, "w+", shape=shape)

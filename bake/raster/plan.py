"""How an image is cut into windows, and what draws them: OpenGL, or numpy where there is none.

h w texels · k samples along a texel's side.
"""

from __future__ import annotations

import warnings
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol

from ...runtime.errors import InputError, MissingDependencyError
from .context import max_texture_size, open_context
from .gbuffer import DeviceRasterizer, GBuffer
from .layout import Layout, Planes, Window, check_size, windows
from .software import SoftwareRasterizer
from .supersample import samples_along

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from ...runtime.mesh import Atlas
    from ...runtime.pagesize import PageSize

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

    size: of the image.  samples: 1, 4 or 16 per texel.
    limit: the largest side that is drawn at once, in samples; None leaves it to the device.
    tile: the UDIM tile (a, b), uv [a, a + 1] × [b, b + 1]; None is the unit square, and uv must be inside.

    Raises: InputError for a value out of range.
    """

    size: PageSize
    samples: int = 1
    limit: int | None = None
    tile: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        check_size(self.size)
        check_size(self.fine)

    @property
    def fine(self) -> PageSize:
        """Size of the image in samples."""
        return self.size.times(self.along)

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
    layout = Layout.of(atlas, plan.fine, plan.tile)
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
        yield SoftwareRasterizer(atlas, layout), plan.windows(plan.fine.side)


def _say(message: str, warn: Callable[[str], None] | None) -> None:
    if warn is None:
        warnings.warn(message, SoftwareWarning, stacklevel=4)
    else:
        warn(message)

"""The size of an atlas page in texels: a square by its side, or width × height.

Users, files and reports name it by one number or as "2048x1024" (`Size`); what computes with it takes a `PageSize`.
uv run from 0 to 1 along both sides whatever their lengths, so lengths are compared in sides of the page: its longer
side is 1 (`PageSize.even`).
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from .errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

Size: TypeAlias = int | str
"""Texels of a square page's side, or WIDTHxHEIGHT."""
LARGEST = 65536
"""Texels of an image's side: the exact decisions of the rasterizers hold up to it, supersampling included."""


class PageSize(NamedTuple):
    """Width and height in texels."""

    width: int
    height: int

    @classmethod
    def of(cls, size: Size | PageSize) -> PageSize:
        """What a `Size` says.  Raises: InputError for text that is no WIDTHxHEIGHT."""
        if isinstance(size, PageSize):
            return size
        if not isinstance(size, str):
            return cls(int(size), int(size))
        found = re.fullmatch(r"(\d{1,9})(?:[x×](\d{1,9}))?", size.strip().lower())
        if found is None:
            raise InputError(f"size is {size!r}, expected texels as 2048 or 2048x1024; pass for instance --size 2048")
        return cls(int(found[1]), int(found[2] or found[1]))

    @property
    def stored(self) -> Size:
        """As files and reports name it: one number for a square."""
        return self.width if self.is_square else f"{self.width}x{self.height}"

    @property
    def is_square(self) -> bool:
        """Whether both sides are alike."""
        return self.width == self.height

    @property
    def is_possible(self) -> bool:
        """Whether an image can be so large, and so small."""
        return min(self) >= 1 and self.side <= LARGEST

    @property
    def side(self) -> int:
        """The longer side."""
        return max(self)

    @property
    def extent(self) -> NDArray[np.float64]:
        """(2,) width and height in sides of the page: the longer one is 1; both of a page of unknown size, 0."""
        return np.ones(2) if self.is_square else np.array(self, dtype=np.float64) / self.side

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of an image."""
        return self.height, self.width

    def times(self, factor: float) -> PageSize:
        """A page of the same form, so many times as large, at least a texel."""
        return PageSize(max(round(self.width * factor), 1), max(round(self.height * factor), 1))

    def even(self, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """Uv (…, 2) in sides of the page, in which both axes have one scale; the very array for a square."""
        return uv if self.is_square else uv * self.extent

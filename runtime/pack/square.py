"""What is asked of an atlas, square or not.   Sizes in texels."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from ..pagesize import PageSize
from .config import PackConfig

if TYPE_CHECKING:
    from ..options.atlas import AtlasOptions
    from ..pagesize import Size
    from .config import Rotation, Stack


class Square(NamedTuple):
    """Size and padding in texels; texels per unit of the source, None as many as fit; the rest as in `PackConfig`."""

    size: Size
    padding: int
    texel_density: float | None = None
    rotation: Rotation = "any"
    stack: Stack = "off"
    whole_texels: bool = False

    @property
    def page(self) -> PageSize:
        """Width and height."""
        return PageSize.of(self.size)

    def config(self, config: PackConfig | None = None) -> PackConfig:
        """The numbers of packing with what is asked for among them."""
        start = config or PackConfig()
        return replace(start, rotation=self.rotation, stack=self.stack, whole_texels=self.whole_texels)


def square_of(options: AtlasOptions) -> Square:
    """The atlas that options ask for."""
    asked = options.rotation, options.stack, options.whole_texels
    return Square(options.page.stored, options.margin, options.texel_density, *asked)

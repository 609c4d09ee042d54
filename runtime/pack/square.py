"""What is asked of an atlas, square or not.   Sizes in texels."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from ..pagesize import PageSize
from .config import PackConfig
from .growing.outlines import outline_edges
from .room import Outlines, spared_padding

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..mesh import Charts
    from ..options.atlas import AtlasOptions
    from ..pagesize import Size
    from .config import Rotation, Stack


class Square(NamedTuple):
    """Size and padding in texels; texels per unit of the source, None as many as fit; the rest as in `PackConfig`.

    spares: nobody asked for that padding, and it may be less where charts have long outlines for what they cover.
    """

    size: Size
    padding: int
    texel_density: float | None = None
    rotation: Rotation = "any"
    stack: Stack = "off"
    whole_texels: bool = False
    spares: bool = False

    @property
    def page(self) -> PageSize:
        """Width and height."""
        return PageSize.of(self.size)

    def of(self, faces: NDArray[np.int64], charts: Charts, pages: int = 1) -> Square:
        """The same with the padding that these charts of faces (f, 3) get, on so many pages."""
        if not self.spares:
            return self
        outlines = Outlines.of(charts, outline_edges(faces, charts))
        return self._replace(padding=spared_padding(outlines, self.page, self.padding, pages), spares=False)

    def spared(self, own: Square) -> dict[str, int]:
        """What a report says of `of`: the padding that few charts get, where these get less."""
        return {"usual_padding": self.padding} if own.padding < self.padding else {}

    def facts(self, padding: int) -> dict[str, Any]:
        """What a report says of it, with the padding in force."""
        return {**{name: value for name, value in self._asdict().items() if name != "spares"}, "padding": padding}

    def config(self, config: PackConfig | None = None) -> PackConfig:
        """The numbers of packing with what is asked for among them."""
        start = config or PackConfig()
        return replace(start, rotation=self.rotation, stack=self.stack, whole_texels=self.whole_texels)


def square_of(options: AtlasOptions) -> Square:
    """The atlas that options ask for."""
    asked = options.rotation, options.stack, options.whole_texels
    return Square(options.page.stored, options.margin, options.texel_density, *asked, spares=options.padding is None)

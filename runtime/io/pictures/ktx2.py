"""KTX 2 pictures of Basis Universal (ETC1S, UASTC), as KHR_texture_basisu asks for them → pixels.   h w texels.

Decoded by opengl_basisu, which holds Binomial's own transcoder and comes with flexpara[formats].
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...errors import MeshError
from ...extras import requires
from ..limits import limits
from .pictures import demand_texels

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray


def decode_ktx2(data: bytes, beside: Iterable[NDArray[np.uint8]] = ()) -> NDArray[np.uint8]:
    """The largest level of a KTX 2 file: (h, w, 4) uint8 as stored, row 0 = top.  beside: as decode_image.

    Raises:
        MeshError: damaged, not of Basis Universal, of high dynamic range, or of more texels than are read.
        MissingDependencyError: flexpara[formats] is absent.
    """
    with requires("formats"):
        import opengl_basisu

    try:
        texture = opengl_basisu.open(data)
        demand_texels(texture.width, texture.height, beside)
        limits().demand_unpacked(4 * texture.width * texture.height, len(data), "a texture")
        return np.ascontiguousarray(texture.transcode(opengl_basisu.Target.RGBA8).data, dtype=np.uint8)
    except opengl_basisu.BasisuError as error:
        raise MeshError(f"{error}, expected KTX 2 of Basis Universal with 8 bits; encode it again") from error

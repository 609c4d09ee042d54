"""The maps: each a value that says what it holds and how it is stored, and a function of the G-buffer.

h w texels, row 0 = top.  A map's function takes (GBuffer, Atlas, Asset) and returns (h, w, c) float32; what it
returns where no surface lies is replaced by the background.  Colours are linear light in memory.  Gutters, dithering
and encoding come later, in baker.py and images.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.errors import InputError
from ..color import chart_colors
from .checker import uv_card
from .curvature import curvature_map
from .marks import distortion_map, face_id_map, material_id_map, orm_map
from .material import base_color_map, emissive_map, metallic_roughness_map, occlusion_map
from .normals import FLAT, NormalFormat, object_normal_map, tangent_normal_map
from .raymaps import ao_map, bent_normal_map, bent_normal_object_map, height_map, thickness_map
from .rays import RaySettings
from .resample import linear_colors

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Asset, Atlas
    from ..files.images import Bits, Encoding, FileType
    from ..raster.gbuffer import GBuffer

NORMAL_FORMATS: tuple[NormalFormat, ...] = ("opengl", "directx")

BLACK, GREY, WHITE = (0.0, 0.0, 0.0), (0.5, 0.5, 0.5), (1.0, 1.0, 1.0)
RANGE_01, RANGE_11 = "[0, 1]", "[-1, 1]"

Compute = Callable[["GBuffer", "Atlas", "Asset"], "NDArray[np.float32]"]


@dataclass(frozen=True)
class BakeMap:
    """A kind of texture.

    name: as on the command line and in file names.  space, units, value_range: what the numbers mean, in words.
    encoding, file_type, bits: how they are stored (see images.py).  compute: the map itself.
    background: values of the first three channels where no surface lies; a fourth, alpha, is 1 there.  dither:
    whether 8-bit files are dithered. everywhere: True when the map covers the whole image, so that it needs neither
    background nor gutter.
    """

    name: str
    space: str
    units: str
    value_range: str
    encoding: Encoding
    file_type: FileType
    bits: Bits
    compute: Compute
    background: tuple[float, ...]
    dither: bool = False
    everywhere: bool = False


def position_map(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
    """Surface point.  Object space, source units, any range; linear, EXR float by default (3 channels)."""
    del atlas, asset
    return np.ascontiguousarray(gbuffer.position)


def chart_map(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
    """Colour of the chart, distinct for neighbouring numbers.

    No space, linear light in [0, 1]; srgb, PNG 8 bits by default (3 channels).
    """
    del asset
    colors = chart_colors(int(atlas.face_chart.max(initial=0)) + 1)
    return np.take(colors[atlas.face_chart], gbuffer.face, axis=0, mode="clip")


def uv_checker_map(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
    """The test card of checker.py over the whole image.

    Space uv, linear light in [0, 1]; srgb, PNG 8 bits by default (3 channels).
    """
    del atlas, asset
    return uv_card(gbuffer.shape[0])


def vertex_color_map(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
    """Interpolated vertex colour.

    No space, linear light in [0, 1]; srgb, PNG 8 bits by default (3 channels, 4 where alpha varies from 1).

    Raises: InputError when the mesh has no vertex colours.
    """
    if asset.colors is None:
        raise InputError(f"{asset.stem} has no vertex colours to bake; choose other maps than vertex-color")
    height, width = gbuffer.shape
    result = np.zeros((height * width, 4), np.float32)
    colors = linear_colors(asset.colors)
    corners = atlas.source_vertex[atlas.faces]
    for texels in gbuffer.chunks():
        result[texels] = gbuffer.interpolate(colors, corners, texels)
    return without_opaque_alpha(result.reshape(height, width, 4), gbuffer)


def opaque_color_map() -> Compute:
    """The source's base colour, see `material.base_color_map`, without alpha if it is 1 all over (3 or 4 channels)."""
    color = base_color_map()

    def compute(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
        return without_opaque_alpha(color(gbuffer, atlas, asset), gbuffer)

    return compute


def without_opaque_alpha(color: NDArray[np.float32], gbuffer: GBuffer) -> NDArray[np.float32]:
    """(h, w, 4) → (h, w, 3) when alpha is 1 wherever a surface lies (to 1/510), else unchanged."""
    alpha = color.reshape(-1, 4)[gbuffer.texels, 3]
    return color if (alpha < 1.0 - 1.0 / 510.0).any() else np.ascontiguousarray(color[..., :3])


def all_maps(normal_format: NormalFormat = "opengl", rays: RaySettings | None = None) -> dict[str, BakeMap]:
    """Every map by name, in the order they are listed to users.

    rays: how those are cast that need any.
    Raises: InputError for another normal format than opengl or directx.
    """
    if normal_format not in NORMAL_FORMATS:
        raise InputError(f"normal format {normal_format!r}: expected one of {', '.join(NORMAL_FORMATS)}")
    up = "tangent, Y up" if normal_format == "opengl" else "tangent, Y down"
    tangent = tangent_normal_map(normal_format)
    color, part, unit = "linear light", "share", "unit vector"
    rays = rays or RaySettings()
    bent, bent_object = bent_normal_map(rays, normal_format), bent_normal_object_map(rays)
    maps = (
        BakeMap("normal", up, "unit vector", RANGE_11, "signed", "png", 8, tangent, FLAT, dither=True),
        BakeMap("normal-object", "object", "unit vector", RANGE_11, "signed", "exr", 16, object_normal_map(), BLACK),
        BakeMap("position", "object", "source units", "any", "linear", "exr", 32, position_map, BLACK),
        BakeMap("chart", "none", color, RANGE_01, "srgb", "png", 8, chart_map, BLACK),
        BakeMap("uv-checker", "uv", color, RANGE_01, "srgb", "png", 8, uv_checker_map, BLACK, everywhere=True),
        BakeMap("vertex-color", "none", color, RANGE_01, "srgb", "png", 8, vertex_color_map, BLACK),
        BakeMap("base-color", "none", color, RANGE_01, "srgb", "png", 8, opaque_color_map(), BLACK),
        BakeMap("metallic-roughness", "none", part, RANGE_01, "unit", "png", 8, metallic_roughness_map(), (1, 1, 0)),
        BakeMap("occlusion", "none", part, RANGE_01, "unit", "png", 8, occlusion_map(), WHITE),
        BakeMap("orm", "none", part, RANGE_01, "unit", "png", 8, orm_map(), (1, 1, 0)),
        BakeMap("emissive", "none", color, RANGE_01, "srgb", "png", 8, emissive_map(), BLACK),
        BakeMap("face-id", "none", "face number", "whole", "linear", "exr", 32, face_id_map, (-1, -1, -1)),
        BakeMap("material-id", "none", color, RANGE_01, "srgb", "png", 8, material_id_map, BLACK),
        BakeMap("ao", "none", part, RANGE_01, "unit", "png", 8, ao_map(rays), WHITE, dither=True),
        BakeMap("bent-normal", up, unit, RANGE_11, "signed", "png", 8, bent, FLAT, dither=True),
        BakeMap("bent-normal-object", "object", unit, RANGE_11, "signed", "exr", 16, bent_object, BLACK),
        BakeMap("thickness", "none", "radii", RANGE_01, "unit", "png", 8, thickness_map(rays), BLACK, dither=True),
        BakeMap("curvature", "none", "shaped", RANGE_01, "unit", "png", 8, curvature_map(), GREY, dither=True),
        BakeMap("height", "ray", "source units", "any", "linear", "exr", 32, height_map, BLACK),
        BakeMap("distortion", "none", color, RANGE_01, "srgb", "png", 8, distortion_map(), BLACK),
    )
    return {entry.name: entry for entry in maps}


MAP_NAMES = tuple(all_maps())


def find_map(name: str, *, normal_format: NormalFormat = "opengl", rays: RaySettings | None = None) -> BakeMap:
    """The map of that name.  normal_format, rays: see `all_maps`.

    Raises: InputError that lists the names there are.
    """
    maps = all_maps(normal_format, rays)
    if name not in maps:
        raise InputError(f"unknown map {name!r}: expected one of {', '.join(maps)}")
    return maps[name]

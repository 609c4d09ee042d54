"""The maps: each a value that says what it holds and how it is stored, and a function of the G-buffer.

h w texels, row 0 = top.  A map's function takes (GBuffer, Atlas, Asset) and returns (h, w, c) float32; what it
returns where no surface lies is replaced by the background.  Colours are linear light in memory.  Gutters, dithering
and encoding come later, in baker.py and images.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from ..runtime.errors import InputError
from .checker import uv_card
from .color import chart_colors
from .resample import linear_colors, source_color
from .tangents import vertex_tangents

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..runtime.mesh import Asset, Atlas
    from .gbuffer import GBuffer
    from .images import Bits, Encoding, FileType

NormalFormat = Literal["opengl", "directx"]
NORMAL_FORMATS: tuple[NormalFormat, ...] = ("opengl", "directx")

BLACK = (0.0, 0.0, 0.0)
FLAT = (0.0, 0.0, 1.0)
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


def object_normal_map(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
    """Source normal.  Object space, unit vectors, [−1, 1]; signed, EXR half by default (3 channels)."""
    height, width = gbuffer.shape
    result = np.zeros((height * width, 3), np.float32)
    for texels in gbuffer.chunks():
        result[texels] = source_normals(gbuffer, atlas, asset, texels)
    return result.reshape(height, width, 3)


def tangent_normal_map(normal_format: NormalFormat) -> Compute:
    """Source normal in the frame of the tangents that are written to the file.

    Tangent space, unit vectors, [−1, 1] with z > 0 facing out, (0, 0, 1) = flat; green up (+Y, opengl: glTF, Unity,
    Godot, Blender) or down (−Y, directx: Unreal); signed, PNG 8 bits dithered by default (3 channels).
    The frame is interpolated, not normalised, and inverted exactly, as MikkTSpace asks.  So where the atlas' normals
    are the source's own, the map is flat without more ado.
    """

    def compute(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
        height, width = gbuffer.shape
        if has_source_normals(atlas, asset):
            return np.broadcast_to(np.array(FLAT, np.float32), (height, width, 3))
        result = np.zeros((height * width, 3), np.float32)
        tangents = vertex_tangents(atlas)
        for texels in gbuffer.chunks():
            frame = gbuffer.interpolate(np.column_stack([atlas.normals, tangents]), atlas.faces, texels)
            result[texels] = to_tangent_space(source_normals(gbuffer, atlas, asset, texels), frame)
        if normal_format == "directx":
            result[:, 1] *= -1.0
        return result.reshape(height, width, 3)

    return compute


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


def base_color_map(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
    """The source's texture resampled through its old uv, else its vertex colours, else its material's factor.

    No space, linear light in [0, 1]; srgb, PNG 8 bits by default (3 channels, 4 where alpha varies from 1).
    """
    return without_opaque_alpha(source_color(gbuffer, atlas, asset), gbuffer)


def has_source_normals(atlas: Atlas, asset: Asset) -> bool:
    """Whether the atlas' vertex normals are the source's (to 1e-6), or all there is."""
    if asset.normals is None:
        return True
    return bool(np.allclose(atlas.normals, asset.normals[atlas.source_vertex], rtol=0, atol=1e-6))


def source_normals(gbuffer: GBuffer, atlas: Atlas, asset: Asset, texels: NDArray[np.int64]) -> NDArray[np.float32]:
    """(t, 3) float32 unit: the source's own vertex normals interpolated, the atlas' where the source has none."""
    if asset.normals is None:
        return gbuffer.normal.reshape(-1, 3)[texels]
    normal = gbuffer.interpolate(asset.normals, atlas.source_vertex[atlas.faces], texels)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.where(length > 1e-12, normal / np.maximum(length, 1e-12), gbuffer.normal.reshape(-1, 3)[texels])


def to_tangent_space(normal: NDArray[np.float32], frame: NDArray[np.float32]) -> NDArray[np.float32]:
    """(t, 3) float32 unit: object-space normals in the frames (t, 7) of normal N, tangent T and w; (0, 0, 1) if N ∥ T.

    With B = w N × T the rows of the inverse of (T B N) are, up to a common positive factor,
    T (N·N) − N (N·T),  w N × T,  N (T·T) − T (N·T).
    """
    axis, tangent = frame[:, :3], frame[:, 3:6]
    along, out, mixed = _dot(normal, tangent), _dot(normal, axis), _dot(axis, tangent)
    handedness = np.where(frame[:, 6] < 0.0, -1.0, 1.0).astype(np.float32)
    local = np.zeros_like(normal)
    local[:, 0] = along * _dot(axis, axis) - out * mixed
    local[:, 1] = handedness * _triple(normal, axis, tangent)
    local[:, 2] = out * _dot(tangent, tangent) - along * mixed
    length = np.sqrt(_dot(local, local))
    local[length <= 1e-12] = FLAT
    length[length <= 1e-12] = 1.0
    local /= length[:, None]
    return local


def _dot(a: NDArray[np.float32], b: NDArray[np.float32]) -> NDArray[np.float32]:
    """(t,) inner products of rows."""
    return np.einsum("ti,ti->t", a, b)


def _triple(a: NDArray[np.float32], b: NDArray[np.float32], c: NDArray[np.float32]) -> NDArray[np.float32]:
    """(t,) determinants a · (b × c) of rows."""
    x, y, z = (b[:, i] * c[:, j] - b[:, j] * c[:, i] for i, j in ((1, 2), (2, 0), (0, 1)))
    return np.asarray(a[:, 0] * x + a[:, 1] * y + a[:, 2] * z, np.float32)


def without_opaque_alpha(color: NDArray[np.float32], gbuffer: GBuffer) -> NDArray[np.float32]:
    """(h, w, 4) → (h, w, 3) when alpha is 1 wherever a surface lies (to 1/510), else unchanged."""
    alpha = color.reshape(-1, 4)[gbuffer.texels, 3]
    return color if (alpha < 1.0 - 1.0 / 510.0).any() else np.ascontiguousarray(color[..., :3])


def all_maps(normal_format: NormalFormat = "opengl") -> dict[str, BakeMap]:
    """Every map by name, in the order they are listed to users.

    Raises: InputError for another normal format than opengl or directx.
    """
    if normal_format not in NORMAL_FORMATS:
        raise InputError(f"normal format {normal_format!r}: expected one of {', '.join(NORMAL_FORMATS)}")
    up = "tangent, Y up" if normal_format == "opengl" else "tangent, Y down"
    tangent = tangent_normal_map(normal_format)
    color = "linear light"
    maps = (
        BakeMap("normal", up, "unit vector", RANGE_11, "signed", "png", 8, tangent, FLAT, dither=True),
        BakeMap("normal-object", "object", "unit vector", RANGE_11, "signed", "exr", 16, object_normal_map, BLACK),
        BakeMap("position", "object", "source units", "any", "linear", "exr", 32, position_map, BLACK),
        BakeMap("chart", "none", color, RANGE_01, "srgb", "png", 8, chart_map, BLACK),
        BakeMap("uv-checker", "uv", color, RANGE_01, "srgb", "png", 8, uv_checker_map, BLACK, everywhere=True),
        BakeMap("vertex-color", "none", color, RANGE_01, "srgb", "png", 8, vertex_color_map, BLACK),
        BakeMap("base-color", "none", color, RANGE_01, "srgb", "png", 8, base_color_map, BLACK),
    )
    return {entry.name: entry for entry in maps}


MAP_NAMES = tuple(all_maps())


def find_map(name: str, *, normal_format: NormalFormat = "opengl") -> BakeMap:
    """The map of that name.

    Raises: InputError that lists the names there are.
    """
    maps = all_maps(normal_format)
    if name not in maps:
        raise InputError(f"unknown map {name!r}: expected one of {', '.join(maps)}")
    return maps[name]

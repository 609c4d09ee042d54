"""The maps that have a name: what each holds, how it is stored, and where its function is."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ...runtime.errors import InputError
from ..bakemap import NORMAL_FORMATS, BakeMap, NormalFormat
from .checker import uv_checker_map
from .colors import opaque_color_map, vertex_color_map
from .curvature import curvature_map
from .faces import chart_map, distortion_map, face_id_map, material_id_map
from .material import emissive_map, metallic_roughness_map, occlusion_map, orm_map
from .normals import FLAT, object_normal_map, tangent_normal_map
from .occlusion import ao_map, bent_normal_map, bent_normal_object_map, thickness_map
from .rays import RaySettings
from .surface import position_map

if TYPE_CHECKING:
    from ..bakemap import Compute

HEIGHT = "height"
"""The one map that is measured between two meshes: see highpoly/highmaps.py."""
BLACK, GREY, WHITE = (0.0, 0.0, 0.0), (0.5, 0.5, 0.5), (1.0, 1.0, 1.0)
RANGE_01, RANGE_11 = "[0, 1]", "[-1, 1]"


def all_maps(normal_format: NormalFormat = "opengl", rays: RaySettings | None = None) -> dict[str, BakeMap]:
    """Every map of one mesh by name, in the order they are listed to users.

    rays: how those are cast that need any.
    Raises: InputError for another normal format than opengl or directx.
    """
    if normal_format not in NORMAL_FORMATS:
        raise InputError(f"normal format {normal_format!r}: expected one of {', '.join(NORMAL_FORMATS)}")
    rays = rays or RaySettings()
    tangent, bent = tangent_normal_map(normal_format), bent_normal_map(rays, normal_format)
    maps = (
        in_tangent_space("normal", tangent, normal_format),
        in_object_space("normal-object", object_normal_map()),
        BakeMap("position", "object", "source units", "any", "linear", "exr", 32, position_map, BLACK),
        colored("chart", chart_map),
        replace(colored("uv-checker", uv_checker_map), space="uv", everywhere=True),
        colored("vertex-color", vertex_color_map),
        colored("base-color", opaque_color_map()),
        share("metallic-roughness", metallic_roughness_map(), (1, 1, 0)),
        share("occlusion", occlusion_map(), WHITE),
        share("orm", orm_map(), (1, 1, 0)),
        colored("emissive", emissive_map()),
        BakeMap("face-id", "none", "face number", "whole", "linear", "exr", 32, face_id_map, (-1, -1, -1)),
        colored("material-id", material_id_map),
        replace(share("ao", ao_map(rays), WHITE), dither=True, estimated=True),
        replace(in_tangent_space("bent-normal", bent, normal_format), estimated=True),
        replace(in_object_space("bent-normal-object", bent_normal_object_map(rays)), estimated=True),
        replace(share("thickness", thickness_map(rays), BLACK), units="radii", dither=True, estimated=True),
        replace(share("curvature", curvature_map(), GREY), units="shaped", dither=True),
        colored("distortion", distortion_map()),
    )
    return {entry.name: entry for entry in maps}


def colored(name: str, compute: Compute) -> BakeMap:
    """A map of colours in linear light, black where there is no surface."""
    return BakeMap(name, "none", "linear light", RANGE_01, "srgb", "png", 8, compute, BLACK)


def share(name: str, compute: Compute, background: tuple[float, ...]) -> BakeMap:
    """A map of numbers from 0 to 1."""
    return BakeMap(name, "none", "share", RANGE_01, "unit", "png", 8, compute, background)


def in_tangent_space(name: str, compute: Compute, normal_format: NormalFormat) -> BakeMap:
    """A map of unit vectors in the frame of the tangents; normal_format: what its green channel means."""
    space = "tangent, Y up" if normal_format == "opengl" else "tangent, Y down"
    return BakeMap(name, space, "unit vector", RANGE_11, "signed", "png", 8, compute, FLAT, dither=True)


def in_object_space(name: str, compute: Compute) -> BakeMap:
    """A map of unit vectors in the axes of the source."""
    return BakeMap(name, "object", "unit vector", RANGE_11, "signed", "exr", 16, compute, BLACK)


MAP_NAMES = (*all_maps(), HEIGHT)


def find_map(name: str, *, normal_format: NormalFormat = "opengl", rays: RaySettings | None = None) -> BakeMap:
    """The map of that name.  normal_format, rays: see `all_maps`.

    Raises: InputError that lists the names there are; for height, which is baked from a high-poly mesh.
    """
    if name == HEIGHT:
        raise InputError("the map height is baked from a high-poly mesh, expected one; pass --high, or leave it out")
    maps = all_maps(normal_format, rays)
    if name not in maps:
        raise InputError(f"unknown map {name!r}: expected one of {', '.join(MAP_NAMES)}")
    return maps[name]

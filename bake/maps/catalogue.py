"""The maps that have a name: what each holds, how it is stored, and where its function is."""

from __future__ import annotations

from typing import Any

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
    up = "tangent, Y up" if normal_format == "opengl" else "tangent, Y down"
    tangent = tangent_normal_map(normal_format)
    color, part, unit = "linear light", "share", "unit vector"
    rays = rays or RaySettings()
    bent, bent_object = bent_normal_map(rays, normal_format), bent_normal_object_map(rays)
    noisy: dict[str, Any] = {"estimated": True}
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
        BakeMap("ao", "none", part, RANGE_01, "unit", "png", 8, ao_map(rays), WHITE, dither=True, **noisy),
        BakeMap("bent-normal", up, unit, RANGE_11, "signed", "png", 8, bent, FLAT, dither=True, **noisy),
        BakeMap(
            "bent-normal-object", "object", unit, RANGE_11, "signed", "exr", 16, bent_object, BLACK, estimated=True
        ),
        BakeMap(
            "thickness",
            "none",
            "radii",
            RANGE_01,
            "unit",
            "png",
            8,
            thickness_map(rays),
            BLACK,
            dither=True,
            estimated=True,
        ),
        BakeMap("curvature", "none", "shaped", RANGE_01, "unit", "png", 8, curvature_map(), GREY, dither=True),
        BakeMap("distortion", "none", color, RANGE_01, "srgb", "png", 8, distortion_map(), BLACK),
    )
    return {entry.name: entry for entry in maps}


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

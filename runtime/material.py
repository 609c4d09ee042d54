"""Materials with all their textures, as a mesh file describes them: what readers make and baking shows.

Words are those of glTF 2.0 (metallic-roughness model): a slot is what a texture is for.  Pictures are (h, w, 4) uint8
as stored, row 0 = top: sRGB in the slots base-color and emissive, data in the others.  Factors are linear.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from .errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .mesh import Asset

Wrap = Literal["repeat", "mirror", "clamp"]
Slot = Literal["base-color", "metallic-roughness", "normal", "emissive", "occlusion"]
AlphaMode = Literal["OPAQUE", "MASK", "BLEND"]
Placement = tuple[tuple[float, float, float], tuple[float, float, float]]
SLOTS: tuple[Slot, ...] = ("base-color", "metallic-roughness", "normal", "emissive", "occlusion")
READ_BY: Mapping[Slot, tuple[str, ...]] = {
    "base-color": ("base-color",),
    "metallic-roughness": ("metallic-roughness", "orm"),
    "normal": ("normal",),
    "emissive": ("emissive",),
    "occlusion": ("occlusion", "orm"),
}
"""Maps that each texture goes into."""
UNTURNED: Placement = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


@dataclass(frozen=True, eq=False)
class Picture:
    """A texture as a material uses it.

    pixels: (h, w, 4) uint8 as stored, row 0 = top.  wrap: what lies outside [0, 1] along u and along v.
    placement: rows (a, b, c) of picture uv = (a u + b v + c, …), both v up: what KHR_texture_transform asks.
    smooth: whether it is filtered; False is nearest texel (pixel art).
    """

    pixels: NDArray[np.uint8]
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    placement: Placement = UNTURNED
    smooth: bool = True


@dataclass(frozen=True, eq=False)
class Material:
    """One material of the source file; what a format can't say has the value of a matt, opaque surface.

    name: as in the file.  base_color_factor: linear RGBA in [0, 1].  pictures: the textures by slot.
    metallic, roughness, occlusion_strength: [0, 1].  normal_scale: any number.
    emissive: linear RGB factor ≥ 0, above 1 where the file asks for more (KHR_materials_emissive_strength).
    alpha_mode: OPAQUE ignores alpha, MASK cuts at alpha_cutoff.  double_sided: seen from behind too.
    tinted: vertex colours multiply the base colour's texture, as glTF asks; otherwise they show only without one.
    unread: slots that have a picture which is not among the pictures → why, as words that follow "its texture"; ""
        where it could be read and lies on another uv set.
    """

    name: str = "material"
    base_color_factor: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    pictures: Mapping[Slot, Picture] = field(default_factory=dict)
    metallic: float = 0.0
    roughness: float = 0.8
    normal_scale: float = 1.0
    occlusion_strength: float = 1.0
    emissive: tuple[float, float, float] = (0.0, 0.0, 0.0)
    alpha_mode: AlphaMode = "OPAQUE"
    alpha_cutoff: float = 0.5
    double_sided: bool = False
    tinted: bool = True
    unread: Mapping[Slot, str] = field(default_factory=dict)

    @property
    def finish(self) -> tuple[float, float]:
        """Metallic and roughness factors."""
        return self.metallic, self.roughness


def seen_through(factor: tuple[float, float, float, float], picture: Picture | None) -> bool:
    """Whether the alpha of a base colour, factor or texture, is below 1 anywhere."""
    return factor[3] < 1.0 or (picture is not None and int(picture.pixels[..., 3].min(initial=255)) < 255)


def used_materials(asset: Asset) -> list[Material]:
    """The materials that some face has; the first one where faces do not say."""
    if asset.face_material is None:
        return list(asset.materials[:1])
    return [asset.materials[int(index)] for index in np.unique(asset.face_material)]


def source_maps(asset: Asset) -> tuple[str, ...]:
    """The maps that together make the output look like the source; () for a bare surface.

    normal where there is a normal texture (vertex normals are written as they are), base-color where there is colour,
    orm where both occlusion and a metallic-roughness that varies are there, else the one that is, emissive where
    something glows.  What is the same all over needs no map: it stays a factor.
    """
    used = used_materials(asset)
    has = {
        slot: any((asset.uv is not None and slot in entry.pictures) or entry.unread.get(slot) for entry in used)
        for slot in SLOTS
    }
    finish = has["metallic-roughness"] or len({entry.finish for entry in used}) > 1
    colors = {entry.base_color_factor for entry in used}
    names = ["normal"] if has["normal"] else []
    names += ["base-color"] if has["base-color"] or asset.colors is not None or len(colors) > 1 else []
    if finish and has["occlusion"]:
        names.append("orm")
    else:
        names += [name for name, there in (("metallic-roughness", finish), ("occlusion", has["occlusion"])) if there]
    return (*names, *(["emissive"] if has["emissive"] or len({entry.emissive for entry in used}) > 1 else []))


def refuse_unread(asset: Asset, maps: Sequence[str]) -> None:
    """Refuse maps of textures that could not be read.  maps: their names.

    Raises: InputError that names the first of them.
    """
    for entry in used_materials(asset):
        for slot, why in entry.unread.items():
            wanted = [name for name in maps if name in READ_BY[slot]]
            if why and wanted:
                raise InputError(
                    f"the {slot} texture of material {entry.name} {why}, and the map {wanted[0]} is made of it; save "
                    "it as PNG, or pass --maps none, which leaves all materials as they are"
                )

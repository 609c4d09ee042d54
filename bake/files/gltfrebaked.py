"""Materials of a glTF document that is kept: baked maps take the place of its textures, all else stays as it is.

| maps | glTF |
|---|---|
| the first of `BASE_COLOR_MAPS` | base colour |
| normal | normal texture |
| orm, else metallic-roughness | metallic-roughness |
| ao, else occlusion, else orm | occlusion |
| emissive | emissive, where the material glows |

A texture that was not baked anew keeps its picture and reads the uv set that its old uv have become.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ...runtime.io.gltf.references import texture_infos
from .gltfmaterial import BASE_COLOR_MAPS, STRENGTH

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ...runtime.io.gltf.editing import Editing

TRANSFORM = "KHR_texture_transform"
SPECULAR = "KHR_materials_pbrSpecularGlossiness"
SHADOWS = ("ao", "occlusion", "orm")
FINISHES = ("orm", "metallic-roughness")


@dataclass(frozen=True)
class Baked:
    """What was baked onto the new uv.

    name: of the atlas, each has another.  textures: map → number of its texture in the document.
    coordinates: the uv set that they are read with.  moved: by how many the old uv sets are further up.
    strength: what the emissive map is to be multiplied by.
    """

    name: str
    textures: Mapping[str, int]
    coordinates: int = 0
    moved: int = 1
    strength: float = 1.0

    def first(self, *names: str) -> int | None:
        """The texture of the first of these maps that was baked."""
        return next((self.textures[name] for name in names if name in self.textures), None)

    def info(self, texture: int) -> dict[str, int]:
        """The textureInfo of one of them."""
        return {"index": texture, **({"texCoord": self.coordinates} if self.coordinates else {})}


@dataclass
class Materials:
    """The materials of a document while its meshes get new ones: each is changed in place, or copied, once a purpose.

    kept: materials that something else uses as they are, which are copied.
    """

    editing: Editing
    kept: frozenset[int]
    known: dict[tuple[int | None, str], int] = field(default_factory=dict)
    taken: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.original = copy.deepcopy(self.editing.tree.get("materials", []))

    def number(self, index: int | None, baked: Baked, unread: frozenset[str]) -> int | None:
        """The material to use in place of index.  unread: slots whose picture could not be read, which stay.

        A primitive without one gets glTF's own default by name: trimesh passes over uv of a primitive without material.
        """
        key = (index, baked.name)
        if key not in self.known:
            plain = index is None and not baked.textures
            if plain and not baked.moved:  # further uv sets leave materials as they are
                return None
            source = {"name": "material"} if index is None else self.original[index]
            self.known[key] = self._place(index, source if plain else rebaked(source, baked, unread))
        return self.known[key]

    def _place(self, index: int | None, entry: dict[str, Any]) -> int:
        if index is None or index in self.kept or index in self.taken:
            return self.editing.add("materials", entry)
        self.taken.add(index)
        self.editing.tree["materials"][index] = entry
        return index


def rebaked(source: Mapping[str, Any], baked: Baked, unread: frozenset[str] = frozenset()) -> dict[str, Any]:
    """The material with the baked textures in the place of its own; source stays as it is."""
    entry: dict[str, Any] = copy.deepcopy(dict(source))
    for info in texture_infos(entry):
        _move(info, baked.moved)
    if SPECULAR not in entry.get("extensions", {}):
        _set_surface(entry, baked, unread)
    normal, shadow = baked.first("normal"), baked.first(*SHADOWS)
    if normal is not None and "normal" not in unread:
        entry["normalTexture"] = baked.info(normal)
    if shadow is not None and ("occlusion" not in unread or "ao" in baked.textures):
        entry["occlusionTexture"] = baked.info(shadow)
    _set_emission(entry, baked, unread)
    return entry


def _move(info: dict[str, Any], steps: int) -> None:
    """Let a textureInfo read a uv set further up."""
    if steps == 0:
        return
    info["texCoord"] = info.get("texCoord", 0) + steps
    transform = info.get("extensions", {}).get(TRANSFORM, {})
    if "texCoord" in transform:
        transform["texCoord"] += steps


def _set_surface(entry: dict[str, Any], baked: Baked, unread: frozenset[str]) -> None:
    color, finish = baked.first(*BASE_COLOR_MAPS), baked.first(*FINISHES)
    surface = entry.setdefault("pbrMetallicRoughness", {})
    if color is not None and "base-color" not in unread:
        surface["baseColorTexture"] = baked.info(color)
        surface.pop("baseColorFactor", None)
        if entry.get("alphaMode") == "MASK" and "base-color" in baked.textures:
            entry["alphaCutoff"] = 0.5  # the map is scaled so that the cut lies there
    if finish is not None and "metallic-roughness" not in unread:
        surface["metallicRoughnessTexture"] = baked.info(finish)
        for name in ("metallicFactor", "roughnessFactor"):
            surface.pop(name, None)
    if not surface:
        del entry["pbrMetallicRoughness"]


def _set_emission(entry: dict[str, Any], baked: Baked, unread: frozenset[str]) -> None:
    glows = any(entry.get("emissiveFactor", (0.0,)))
    if "emissive" not in baked.textures or "emissive" in unread or not glows:
        return
    entry["emissiveTexture"] = baked.info(baked.textures["emissive"])
    entry["emissiveFactor"] = [1.0, 1.0, 1.0]
    extensions = entry.get("extensions", {})
    extensions.pop(STRENGTH, None)
    if baked.strength > 1.0:
        extensions[STRENGTH] = {"emissiveStrength": baked.strength}
    entry.pop("extensions", None)
    if extensions:
        entry["extensions"] = extensions

"""Names in an OBJ file that is written anew: objects for the nodes of a scene, and the materials of its faces.

f faces as they are written, every instance of a scene's meshes among them · m polygons.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...material import Material, used_materials
from ..gltf.instances import faces_at_places

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...mesh import Asset

MADE_UP = "atlas"
"""Name of the material for a mesh that has none."""


class Named(NamedTuple):
    """What stands between the faces: polygon → lines before it; and the lines of the material library, () for none."""

    marks: dict[int, list[str]]
    library: tuple[str, ...]


def plain_names(texture: str | None) -> Named:
    """One material that shows the texture; nothing without one."""
    if texture is None:
        return Named({}, ())
    return Named({0: [f"usemtl {MADE_UP}"]}, tuple(_material(Material(MADE_UP), MADE_UP, texture)))


def named(asset: Asset, faces: NDArray[np.int64], polygon: NDArray[np.int64], texture: str | None) -> Named:
    """The names of a mesh.

    Args:
        asset: what is written.
        faces: (f,) which of the asset's faces each written one is.
        polygon: (m,) the first of the written faces of each polygon.
        texture: name of the picture with the base colour, which all materials show; None for their own factors.
    """
    marks: dict[int, list[str]] = {}
    places = faces_at_places(asset)
    if places and asset.document is not None:
        nodes = asset.document.file.tree.get("nodes", [])
        at = np.concatenate([np.full(len(own), entry.node) for entry, own in places])
        if len(faces) == len(asset.faces):
            at[np.concatenate([own for _, own in places])] = at.copy()
        _mark(marks, at[polygon], {node: f"o {_word(nodes[node].get('name', f'node {node}'))}" for node in at.tolist()})
    if not asset.materials:
        plain = plain_names(texture)
        for first, lines in plain.marks.items():
            marks.setdefault(first, []).extend(lines)
        return Named(marks, plain.library)
    number = np.zeros(len(asset.faces), np.int64) if asset.face_material is None else asset.face_material
    words = _distinct(asset)
    _mark(marks, number[faces[polygon]], {index: f"usemtl {word}" for index, word in words.items()})
    entries = zip(words.values(), used_materials(asset), strict=True)
    return Named(marks, tuple(line for word, entry in entries for line in _material(entry, word, texture)))


def _mark(marks: dict[int, list[str]], label: NDArray[np.int64], lines: dict[int, str]) -> None:
    """Before each polygon whose label (m,) is another than that of the one before it, the line of its label."""
    for first in np.flatnonzero(np.concatenate([[True], np.diff(label) != 0])).tolist():
        marks.setdefault(first, []).append(lines[int(label[first])])


def _distinct(asset: Asset) -> dict[int, str]:
    """A name for each material that faces have: its own, with a number where another has the same."""
    numbers = [0] if asset.face_material is None else np.unique(asset.face_material).tolist()
    found: dict[int, str] = {}
    for number in numbers:
        word = _word(asset.materials[number].name) or MADE_UP
        found[number] = word if word not in found.values() else f"{word}_{number}"
    return found


def _word(name: object) -> str:
    """A name on one line."""
    return " ".join("".join(letter if letter.isprintable() else " " for letter in str(name)).split())


def _material(source: Material, word: str, texture: str | None) -> list[str]:
    """The lines of a material."""
    red, green, blue, alpha = source.base_color_factor
    color = "1 1 1" if texture is not None else f"{red:.6g} {green:.6g} {blue:.6g}"
    opaque = texture is not None or source.alpha_mode == "OPAQUE"
    lines = [f"newmtl {word}", f"Kd {color}", f"d {1.0 if opaque else alpha:.6g}", "illum 1"]
    if texture is None:
        metallic, roughness = source.finish
        lines += [f"Pm {metallic:.6g}", f"Pr {roughness:.6g}"]
        lines += ["Ke {:.6g} {:.6g} {:.6g}".format(*source.emissive)] if any(source.emissive) else []
    return [*lines, *([] if texture is None else [f"map_Kd {texture}"])]

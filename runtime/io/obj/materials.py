"""OBJ material libraries (.mtl) → materials."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import TYPE_CHECKING

from ...errors import MeshError
from ...material import Material, Picture, seen_through
from ..pictures.pictures import decoded_if_known, is_deep
from ..text import finite, lines_of, shown

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy as np
    from numpy.typing import NDArray

    from ...material import Slot, Wrap

SLOTS: dict[str, Slot] = {"map_kd": "base-color", "map_ke": "emissive", "norm": "normal"}


def read_mtl(data: bytes, read_sibling: Callable[[str], bytes | None]) -> tuple[dict[str, Material], dict[str, int]]:
    """OBJ material library → materials by name, and changes: textures not found, or of 16 bits.

    Read are Kd, d, map_Kd, and of the physically based additions Pm, Pr, Ke, map_Ke and norm; of options -clamp on.
    Kd is a linear factor; beside a texture it is ignored, as exporters leave their default grey there.

    Raises: MeshError for a texture that is no picture.
    """
    raw: dict[str, dict[str, str]] = {}
    current: dict[str, str] = {}
    for line in lines_of(data):
        key, _, rest = line.replace("\t", " ").strip().partition(" ")
        if key.lower() == "newmtl":
            current = raw.setdefault(rest.strip(), {})
        else:
            current[key.lower()] = rest.strip()
    materials: dict[str, Material] = {}
    known: dict[str, NDArray[np.uint8] | None] = {}  # many materials may name one picture
    changes = {"missing_textures": 0, "textures_to_8_bits": 0}
    for name, fields in raw.items():
        pictures: dict[Slot, Picture] = {}
        for key, slot in SLOTS.items():
            picture = _pixels(_map_name(fields[key]), read_sibling, known, changes) if fields.get(key) else None
            changes["missing_textures"] += bool(fields.get(key)) and picture is None
            if picture is not None:
                pictures[slot] = Picture(picture, _mtl_wrap(fields[key]))
        materials[name] = _mtl_material(name, fields, pictures)
    return materials, changes


def _pixels(
    name: str,
    read_sibling: Callable[[str], bytes | None],
    known: dict[str, NDArray[np.uint8] | None],
    changes: dict[str, int],
) -> NDArray[np.uint8] | None:
    """A picture beside the file, decoded once; None where it is absent.  known and changes grow."""
    if name not in known:
        data = read_sibling(name)
        if data is None and (plain := _uncommented(name)) != name:
            data = read_sibling(plain)
        known[name] = decoded_if_known(data, known.values())
        changes["textures_to_8_bits"] += data is not None and is_deep(data)
    return known[name]


def _mtl_material(name: str, fields: Mapping[str, str], pictures: Mapping[Slot, Picture]) -> Material:
    base = pictures.get("base-color")
    factor = _factor(fields, base is not None)
    red, green, blue = _numbers(fields.get("ke", "1 1 1" if "emissive" in pictures else "0 0 0"))
    return Material(
        name=name,
        base_color_factor=factor,
        pictures=pictures,
        metallic=_numbers(fields.get("pm", "0"))[0],
        roughness=_numbers(fields.get("pr", "0.8"))[0],
        emissive=(red, green, blue),
        alpha_mode="BLEND" if seen_through(factor, base) else "OPAQUE",
        tinted=False,
    )


def _mtl_wrap(text: str) -> tuple[Wrap, Wrap]:
    """Clamped where the options say "-clamp on", else repeated."""
    words = text.lower().split()
    clamped = any(pair == ("-clamp", "on") for pair in pairwise(words))
    return ("clamp", "clamp") if clamped else ("repeat", "repeat")


def _numbers(text: str) -> list[float]:
    """Three numbers in [0, 1]; a single one stands for all.  Raises: MeshError for what is no number."""
    try:
        found = [min(max(finite(word), 0.0), 1.0) for word in _uncommented(text).split()]
    except ValueError as error:
        raise MeshError(
            f"a material has the factor {shown(text)}, expected numbers; mend or delete the .mtl file"
        ) from error
    return (found * 3)[:3] if len(found) == 1 else [*found, 0.0, 0.0, 0.0][:3]


def _uncommented(text: str) -> str:
    """Without a comment at its end; names may hold a #, so that of files they are tried whole first."""
    return re.split(r"(?:^|\s)#", text, maxsplit=1)[0].strip()


def _map_name(text: str) -> str:
    """The file name after options such as '-s 1 1 1' (a name with spaces stays whole when there are no options)."""
    return _uncommented(text).split()[-1] if text.startswith("-") else text


def _factor(fields: Mapping[str, str], textured: bool) -> tuple[float, float, float, float]:
    red, green, blue = (1.0, 1.0, 1.0) if textured else _numbers(_uncommented(fields.get("kd", "")) or "1 1 1")
    return red, green, blue, _numbers((_uncommented(fields.get("d", "")) or "1").split()[-1])[0]

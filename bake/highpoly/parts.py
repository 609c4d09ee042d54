"""Parts by name: which faces of a low-poly mesh belong to which faces of the high-poly meshes.

Bakers agree on a convention: `wheel_low` takes its details from `wheel_high` (and `wheel_high_bolts`), from nothing
else.  A face's name is that of its material where the mesh has several, else the file's.  Case does not matter.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...runtime.cli.partnames import part_name
from ...runtime.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ...runtime.mesh import Asset


def face_parts(asset: Asset) -> tuple[tuple[str, ...], NDArray[np.int64]]:
    """Names of an asset's parts, sorted, and which one each face (f,) is of."""
    if len(asset.materials) < 2 or asset.face_material is None:
        return (part_name(asset.stem),), np.zeros(len(asset.faces), np.int64)
    names = [part_name(material.name) for material in asset.materials]
    used = sorted({names[index] for index in np.unique(asset.face_material)})
    of_material = np.array([used.index(name) if name in used else -1 for name in names], np.int64)
    return tuple(used), of_material[asset.face_material]


def matching_faces(low: Asset, highs: Sequence[Asset]) -> list[tuple[NDArray[np.bool_], NDArray[np.int64]]]:
    """Per part of the low-poly mesh: its faces (f,) bool, and the faces it sees, numbered through all high meshes.

    Raises: InputError that names the parts of the low-poly mesh without a partner.
    """
    low_names, low_part = face_parts(low)
    seen: dict[str, list[NDArray[np.int64]]] = {}
    first = 0
    for high in highs:
        names, part = face_parts(high)
        for index, name in enumerate(names):
            seen.setdefault(name, []).append(first + np.flatnonzero(part == index))
        first += len(high.faces)
    lonely = [name for name in low_names if name not in seen]
    if lonely:
        raise InputError(
            f"no high-poly part is named like {', '.join(lonely)} (there are {', '.join(sorted(seen))}): expected"
            " names like wheel_low and wheel_high; rename them, or bake without matching names"
        )
    return [(low_part == index, np.concatenate(seen[name])) for index, name in enumerate(low_names)]

"""The vertex data of a primitive as they are stored, all of them: attributes and morph targets.   n vertices."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from .buffers import COMPONENTS, GltfFile, buffer_view, stored_accessor
from .compression import DRACO, decode_draco
from .damage import damage_is_named

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Column:
    """One attribute: rows (n, c) of the component type stored; normalized: integers that stand for [0, 1], [−1, 1]."""

    rows: NDArray[Any]
    normalized: bool


def primitive_columns(file: GltfFile, primitive: dict[str, Any]) -> tuple[dict[str, Column], list[dict[str, Column]]]:
    """The attributes by name, and those of each morph target.

    Raises: MeshError where the file is damaged.
    """
    with damage_is_named():
        return _columns(file, primitive)


def _columns(file: GltfFile, primitive: dict[str, Any]) -> tuple[dict[str, Column], list[dict[str, Column]]]:
    names = primitive["attributes"]
    packed = primitive.get("extensions", {}).get(DRACO)
    decoded: dict[str, NDArray[Any]] = {}
    if packed is not None:
        decoded, _ = decode_draco(bytes(buffer_view(file, packed["bufferView"])[0]), packed["attributes"])
    columns = {
        name: _column(file, number) if name not in decoded else _as(file, number, decoded[name])
        for name, number in names.items()
    }
    targets = [{name: _column(file, number) for name, number in t.items()} for t in primitive.get("targets", [])]
    return columns, targets


def _column(file: GltfFile, number: int) -> Column:
    return _as(file, number, stored_accessor(file, number))


def _as(file: GltfFile, number: int, rows: NDArray[Any]) -> Column:
    accessor = file.tree["accessors"][number]
    return Column(rows.astype(COMPONENTS[accessor["componentType"]]), bool(accessor.get("normalized")))

"""PLY → RawMesh, or the points of a cloud.

n vertices · f triangles.  Faces are polygons or triangle strips (ended by −1, every second triangle turned).  Taken are
x y z, nx ny nz, red green blue [alpha] (also with diffuse_ before them), s t (or u v, or texture_u texture_v), and of
faces their corners, colours, texcoord (uv per corner) and texnumber, whatever their order and type.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import expit

from ...errors import InputError, MeshError
from ...material import Material, Picture, seen_through
from ...mesh import Polygons, Stored
from ..pictures.colors import as_rgba
from ..pictures.pictures import decoded_if_known, is_deep
from ..polygons import Triangles, strip_triangles, triangles_of
from ..rawmesh import RawMesh, split_at_corners, to_float64
from .body import Lists, read_body
from .header import FACES, ply_header
from .leftout import COLORS, CORNERS, USED, UV, left_out

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from .body import Table
    from .header import PlyHeader

HARMONIC = 0.5 / math.sqrt(math.pi)
"""Value of the constant spherical harmonic."""


def read_ply(data: bytes, read_sibling: Callable[[str], bytes | None]) -> RawMesh:
    """Read a PLY mesh.

    Args:
        data: the bytes of the file.
        read_sibling: name of a file beside it → its bytes, or None where there is none.

    Raises:
        MeshError: damaged, shorter than its header says, or without vertices or faces.
    """
    header = ply_header(data)
    tables = read_body(data, header, ("vertex", *FACES))
    if "vertex" not in tables or not header.count(*FACES):
        names = [element.name for element in header.elements if element.count]
        raise MeshError(f"the PLY file holds {names}, expected vertices and faces; check the export")
    vertices = tables["vertex"]
    positions = _group(vertices, ("x", "y", "z"))
    if positions is None:
        raise MeshError(f"the PLY vertices have {[*vertices]}, expected x y z; check the export")
    uv = next((found for names in UV if (found := _group(vertices, names)) is not None), None)
    colors = _colors(vertices)
    raw = RawMesh(
        positions=positions,
        faces=np.zeros((0, 3), dtype=np.int64),
        normals=_group(vertices, ("nx", "ny", "nz")),
        colors=colors,
        uv=uv,
        changes=left_out(header),
        stored=_stored(vertices, positions),
    )
    if "tristrips" in tables:
        return replace(raw, faces=_strips(tables["tristrips"], len(positions)))
    return _with_faces(raw, tables["face"], header, read_sibling)


def read_ply_points(data: bytes) -> dict[str, NDArray[Any]]:
    """Positions, normals and colours of the vertices of a PLY file.

    Returns:
        "points" (n, 3) float64, and where the file has them "normals" (n, 3) float64 and "colors" (n, 4) uint8.

    Raises:
        InputError: damaged, shorter than its header says, or without x y z.
    """
    header = ply_header(data)
    vertices = read_body(data, header, ("vertex",)).get("vertex")
    if vertices is None:
        raise InputError(
            f"the PLY file holds {[element.name for element in header.elements]}, expected an element vertex; "
            "check the export"
        )
    points = _group(vertices, ("x", "y", "z"))
    if points is None:
        raise InputError(f"the PLY vertices have {[*vertices]}, expected x y z; check the export")
    more = {"normals": _group(vertices, ("nx", "ny", "nz")), "colors": _colors(vertices)}
    return {"points": points, **{name: values for name, values in more.items() if values is not None}}


def _group(table: Table, names: tuple[str, ...]) -> NDArray[np.float64] | None:
    """(n, c) float64 of columns, or None where one is absent or a list."""
    columns = [table.get(name) for name in names]
    if any(column is None or isinstance(column, Lists) for column in columns):
        return None
    return np.stack([to_float64(np.asarray(column)) for column in columns], axis=1)


def _stored(table: Table, positions: NDArray[np.float64]) -> Stored | None:
    """Numbers that the mesh itself has no use for, by the names of their properties."""
    values = {name: np.asarray(column) for name, column in table.items() if not isinstance(column, Lists)}
    own = {name: column for name, column in values.items() if name not in USED and column.dtype.kind in "iuf"}
    return Stored(positions, own) if own else None


def _colors(table: Table) -> NDArray[np.uint8] | None:
    """(n, 4) uint8 sRGB of red green blue [alpha]; 16-bit levels are brought to 8."""
    for prefix in ("", "diffuse_"):
        columns = [table[f"{prefix}{name}"] for name in COLORS if f"{prefix}{name}" in table]
        if len(columns) >= 3 and not any(isinstance(column, Lists) for column in columns):
            kinds = {np.asarray(column).dtype for column in columns}
            scale = 65535.0 if kinds == {np.dtype("u2")} else 1.0 if {kind.kind for kind in kinds} == {"f"} else 255.0
            stacked = np.stack([to_float64(np.asarray(column)) for column in columns], axis=1) / scale
            return as_rgba(stacked)
    return _splat_colors(table)


def _splat_colors(table: Table) -> NDArray[np.uint8] | None:
    """(n, 4) uint8 sRGB of Gaussian splats: the first band of their harmonics, and opacity as alpha where there is one.

    Kerbl et al. 2023 fit both against pictures as stored, the one as a factor of the constant harmonic around ½, the
    other before a sigmoid.
    """
    first = _group(table, ("f_dc_0", "f_dc_1", "f_dc_2"))
    if first is None:
        return None
    colors, opacity = 0.5 + HARMONIC * first, _group(table, ("opacity",))
    if opacity is not None:
        colors = np.hstack([colors, expit(opacity)])
    return as_rgba(np.clip(colors, 0.0, 1.0))


def _strips(table: Table, vertex_count: int) -> NDArray[np.int64]:
    """(f, 3) int64 of triangle strips; triangles that repeat a corner join strips and are no triangles."""
    lists = next((table[name] for name in CORNERS if isinstance(table.get(name), Lists)), None)
    if not isinstance(lists, Lists):
        raise MeshError(f"the PLY strips have {[*table]}, expected a list vertex_indices; check the export")
    values = lists.values.astype(np.int64)
    ends = np.flatnonzero(values == -1)
    pieces = np.split(values, np.union1d(np.cumsum(lists.size)[:-1], np.concatenate([ends, ends + 1])))
    faces = [strip_triangles(piece) for piece in pieces if len(piece) >= 3]
    joined = np.concatenate([np.zeros((0, 3), dtype=np.int64), *faces])
    kept = joined[(joined != np.roll(joined, 1, axis=1)).all(axis=1)]
    if len(kept) == 0:
        raise MeshError(f"the PLY strips over {vertex_count} vertices hold no triangle; check the export")
    return kept


def _with_faces(raw: RawMesh, table: Table, header: PlyHeader, read_sibling: Callable[[str], bytes | None]) -> RawMesh:
    """The mesh with its polygons as triangles; vertices are split where colours or uv of faces differ."""
    lists = next((table[name] for name in CORNERS if isinstance(table.get(name), Lists)), None)
    if not isinstance(lists, Lists):
        raise MeshError(f"the PLY faces have {[*table]}, expected a list vertex_indices; check the export")
    found = triangles_of(raw.positions, lists.values.astype(np.int64), lists.size, "PLY")
    changes = {**raw.changes, "faces_under_three_corners": found.left_out}
    materials, face_material = _materials(table, found.polygon, header, read_sibling, changes)
    part = replace(raw, faces=found.faces, materials=materials, face_material=face_material, changes=changes)
    part = replace(part, polygons=Polygons(found.corner, lists.size))
    return _with_face_colors(_with_corner_uv(part, table, lists.size, found), table, found)


def _with_corner_uv(part: RawMesh, table: Table, size: NDArray[np.int64], found: Triangles) -> RawMesh:
    """With the uv that faces have for each corner, where they have as many as corners: size (p,)."""
    uv = table.get("texcoord")
    if not isinstance(uv, Lists) or not uv.size.any():
        return part
    if (uv.size != 2 * size).any():
        return replace(part, uv=None, changes={**part.changes, "faces_without_uv": len(part.faces)})
    return split_at_corners(part, uv=to_float64(uv.values).reshape(-1, 2)[found.corner])


def _with_face_colors(part: RawMesh, table: Table, found: Triangles) -> RawMesh:
    """With the colours of faces, where vertices have none."""
    colors = _colors(table)
    if colors is None or (colors == 255).all():  # MeshLab writes white where there are none
        return part
    if part.colors is not None:
        return replace(part, changes={**part.changes, "dropped_face_colors": len(part.faces)})
    return split_at_corners(part, colors=np.repeat(colors[found.polygon][:, None], 3, axis=1))


def _materials(
    table: Table,
    face: NDArray[np.int64],
    header: PlyHeader,
    read_sibling: Callable[[str], bytes | None],
    changes: dict[str, int],
) -> tuple[tuple[Material, ...], NDArray[np.int64] | None]:
    """A material for each texture named in the header, and the (f,) one of each triangle; changes grow."""
    if not header.textures:
        return (), None
    materials = []
    known: dict[str, NDArray[np.uint8]] = {}
    for name in header.textures:
        data = None if name in known else read_sibling(name)
        pixels = decoded_if_known(data, known.values())
        if data is not None and pixels is not None:
            known[name] = pixels
            changes["textures_to_8_bits"] = changes.get("textures_to_8_bits", 0) + is_deep(data)
        picture = Picture(known[name]) if name in known else None
        changes["missing_textures"] = changes.get("missing_textures", 0) + (picture is None)
        materials.append(
            Material(
                name=name,
                pictures={} if picture is None else {"base-color": picture},
                alpha_mode="BLEND" if seen_through((1.0, 1.0, 1.0, 1.0), picture) else "OPAQUE",
                tinted=False,
            )
        )
    numbers = table.get("texnumber")
    if numbers is None or isinstance(numbers, Lists):
        return tuple(materials), np.zeros(len(face), dtype=np.int64)
    return tuple(materials), np.clip(numbers[face].astype(np.int64), 0, len(materials) - 1)

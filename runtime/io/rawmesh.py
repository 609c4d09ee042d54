"""Triangles as a file holds them: what readers return and cleaning takes.

n file vertices · f faces.  Positions are float64 in source units, uv is v up, colours are uint8 sRGB.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import MeshError
from ..material import Material
from .limits import limits, raised

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..mesh import Polygons, Stored
    from .gltf.document import Document
    from .obj.text import ObjText

LARGEST_DIAGONAL = 1e100  # beyond, areas leave the range of float64


@dataclass(frozen=True, eq=False)
class RawMesh:
    """One mesh or one part of it, unchecked.

    positions: (n, 3) float64.  faces: (f, 3) int64 into positions.  normals: (n, 3) float64 or None.
    colors: (n, 4) uint8 sRGB or None.  uv: (n, 2) float64 v up, or None.
    face_material: (f,) int64 into materials, or None.  changes: what reading could not keep, name → count.
    document: the scene that these triangles are of.  part: (f,) int64, the part of it that each face is in.  origin:
    (n,) int64, the vertex of that part that each vertex is.  body: (n,) int64, the object that each vertex belongs to;
    vertices of two bodies are never one.  polygons: what the triangles are in the file, where it holds polygons.  obj:
    the text of an OBJ file.  smoothing: (f,) int64, the smoothing group of each face, 0 for a flat one, or None.
    stored: what a PLY file says of its vertices beside these.
    """

    positions: NDArray[np.float64]
    faces: NDArray[np.int64]
    normals: NDArray[np.float64] | None = None
    colors: NDArray[np.uint8] | None = None
    uv: NDArray[np.float64] | None = None
    materials: tuple[Material, ...] = ()
    face_material: NDArray[np.int64] | None = None
    changes: dict[str, int] = field(default_factory=dict)
    part: NDArray[np.int64] | None = None
    origin: NDArray[np.int64] | None = None
    body: NDArray[np.int64] | None = None
    document: Document | None = None
    polygons: Polygons | None = None
    obj: ObjText | None = None
    smoothing: NDArray[np.int64] | None = None
    stored: Stored | None = None


def check(raw: RawMesh) -> None:
    """Refuse what can't be a surface.

    Raises: MeshError for no faces, too many, indices out of range, coordinates that are not finite or out of range.
    """
    vertex_count, face_count = len(raw.positions), len(raw.faces)
    if vertex_count == 0 or face_count == 0:
        raise MeshError(
            f"the mesh is empty ({vertex_count} vertices, {face_count} faces), expected triangles; check the export"
        )
    demand_few(face_count, vertex_count)
    outside = ((raw.faces < 0) | (raw.faces >= vertex_count)).any(axis=1)
    if outside.any():
        first = int(np.argmax(outside))
        raise MeshError(
            f"face {first} refers to vertices {raw.faces[first].tolist()}, expected 0 to {vertex_count - 1}; "
            "the mesh is damaged: export it again"
        )
    used = np.zeros(vertex_count, dtype=np.bool_)
    used[raw.faces] = True
    broken = used & ~np.isfinite(raw.positions).all(axis=1)
    if broken.any():
        raise MeshError(
            f"{np.count_nonzero(broken)} of {vertex_count} vertices have NaN or infinite coordinates and belong to "
            f"faces (first: vertex {int(np.argmax(broken))}), expected finite numbers; delete or repair them"
        )
    largest = float(np.abs(raw.positions[used]).max())
    if largest > LARGEST_DIAGONAL:
        raise MeshError(f"coordinates reach {largest:.3g}, expected at most {LARGEST_DIAGONAL:g}; choose another unit")


def demand_few(faces: int, vertices: int) -> None:
    """Raises: MeshError for more faces or vertices than the limits in force allow."""
    most = limits()
    for name, count, allowed in (("faces", faces, most.faces), ("vertices", vertices, most.vertices)):
        if count > allowed:
            raise MeshError(f"{count} {name}, at most {allowed} are read; decimate the mesh, or {raised(name)}")


def with_vertices(part: RawMesh, chosen: NDArray[np.int64], faces: NDArray[np.int64]) -> RawMesh:
    """The part with the vertices chosen, (m,) int64 of those it has (repeated ones are split), and faces into them."""
    return replace(
        part,
        positions=part.positions[chosen],
        faces=faces,
        normals=None if part.normals is None else part.normals[chosen],
        colors=None if part.colors is None else part.colors[chosen],
        uv=None if part.uv is None else part.uv[chosen],
        origin=None if part.origin is None else part.origin[chosen],
        body=None if part.body is None else part.body[chosen],
    )


def transformed(part: RawMesh, world: NDArray[np.float64]) -> RawMesh:
    """The part under a (4, 4) matrix for column vectors; a mirroring one turns the winding: outside stays outside."""
    linear = world[:3, :3]
    mirrored = bool(np.linalg.det(linear) < 0.0)
    normals = None
    if part.normals is not None:
        cofactor = np.stack([np.cross(linear[(i + 1) % 3], linear[(i + 2) % 3]) for i in range(3)])
        with np.errstate(invalid="ignore", over="ignore"):  # of a scale beyond reason; they become zero
            normals = unit_vectors(part.normals @ (-cofactor if mirrored else cofactor).T)
    with np.errstate(invalid="ignore", over="ignore"):  # positions that are not finite are refused when they are used
        positions = part.positions @ linear.T + world[:3, 3]
    return replace(
        part,
        positions=positions,
        faces=part.faces[:, [0, 2, 1]] if mirrored else part.faces,
        normals=normals,
    )


def split_at_corners(
    part: RawMesh, *, uv: NDArray[np.float64] | None = None, colors: NDArray[np.uint8] | None = None
) -> RawMesh:
    """The part with uv (f, 3, 2) or colours (f, 3, 4) given per corner: split where they differ, in vertex order."""
    given = uv if uv is not None else colors
    if given is None:
        return part
    vertex, value = part.faces.ravel(), given.reshape(3 * len(part.faces), -1)
    order = np.lexsort((*value.T[::-1], vertex))
    differs = (np.diff(vertex[order]) != 0) | (value[order][1:] != value[order][:-1]).any(axis=1)
    first = np.concatenate([[True], differs])
    faces = np.zeros(len(vertex), dtype=np.int64)
    faces[order] = np.cumsum(first) - 1
    split, own = with_vertices(part, vertex[order][first], faces.reshape(-1, 3)), value[order][first]
    return replace(split, colors=own.astype(np.uint8)) if uv is None else replace(split, uv=own.astype(np.float64))


def merge(parts: Sequence[RawMesh]) -> RawMesh:
    """All parts as one mesh, in their order; equal Material objects become one.

    Where only some parts have uv or colours, the others get (0, 0) and white; where only some have normals, none are
    kept.  Each of these is counted in changes.
    """
    offsets = np.cumsum([0, *(len(part.positions) for part in parts)])
    materials, face_material = _joined_materials(parts)
    changes: dict[str, int] = {}
    for part in parts:
        for name, count in part.changes.items():
            changes[name] = changes.get(name, 0) + count
    has_normals = all(part.normals is not None for part in parts)
    if not has_normals:
        changes["dropped_normals"] = sum(len(part.normals) for part in parts if part.normals is not None)
    return RawMesh(
        positions=np.concatenate([part.positions for part in parts]),
        faces=np.concatenate([part.faces + start for part, start in zip(parts, offsets[:-1], strict=True)]),
        normals=np.concatenate([part.normals for part in parts if part.normals is not None]) if has_normals else None,
        colors=_joined_colors(parts, changes),
        uv=_joined_uv(parts, changes),
        materials=materials,
        face_material=face_material,
        changes=changes,
        part=_joined_numbers([part.part for part in parts]),
        origin=_joined_numbers([part.origin for part in parts]),
        body=_joined_numbers([part.body for part in parts]),
    )


def _joined_numbers(columns: Sequence[NDArray[np.int64] | None]) -> NDArray[np.int64] | None:
    given = [column for column in columns if column is not None]
    return np.concatenate(given) if len(given) == len(columns) else None


def _joined_colors(parts: Sequence[RawMesh], changes: dict[str, int]) -> NDArray[np.uint8] | None:
    if all(part.colors is None for part in parts):
        return None
    changes["faces_without_colors"] = sum(len(part.faces) for part in parts if part.colors is None)
    white = [np.full((len(part.positions), 4), 255, dtype=np.uint8) for part in parts]
    return np.concatenate(
        [plain if part.colors is None else part.colors for part, plain in zip(parts, white, strict=True)]
    )


def _joined_uv(parts: Sequence[RawMesh], changes: dict[str, int]) -> NDArray[np.float64] | None:
    if all(part.uv is None for part in parts):
        return None
    missing = sum(len(part.faces) for part in parts if part.uv is None)
    changes["faces_without_uv"] = changes.get("faces_without_uv", 0) + missing
    return np.concatenate([np.zeros((len(part.positions), 2)) if part.uv is None else part.uv for part in parts])


def _joined_materials(
    parts: Sequence[RawMesh],
) -> tuple[tuple[Material, ...], NDArray[np.int64] | None]:
    """Each Material object once, and the (f,) one of each face; parts without any share a default one, the last."""
    materials = list({id(material): material for part in parts for material in part.materials}.values())
    if not materials:
        return (), None
    place = {id(material): index for index, material in enumerate(materials)}
    columns = []
    for part in parts:
        own = np.array([place[id(material)] for material in part.materials], dtype=np.int64)
        bare = np.full(len(part.faces), len(materials), dtype=np.int64)
        columns.append(bare if part.face_material is None else own[part.face_material])
    if any(part.face_material is None for part in parts):
        materials.append(Material(name="default"))
    return tuple(materials), np.concatenate(columns)


def to_float64(values: NDArray[Any]) -> NDArray[np.float64]:
    """The numbers as float64, without a warning about NaN that signal: those are refused where they count."""
    with np.errstate(invalid="ignore"):
        return values.astype(np.float64)


def unit_vectors(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows of unit length (a zero row stays zero, not-finite numbers become zero)."""
    finite = np.nan_to_num(vectors, posinf=0.0, neginf=0.0)
    return finite / np.maximum(np.linalg.norm(finite, axis=1, keepdims=True), np.finfo(np.float64).tiny)

"""Raw triangles → Asset: weld, leave out what is no triangle, take second sides apart, orient.

n file vertices · v surface vertices · f faces.  Positions are float64 in source units.  Faces that stay keep their
order and their first corner; a turned face swaps its corners 1 and 2.  Every change is counted.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...errors import MeshError
from ...geometry.normals import smooth_normals
from ...geometry.rows import by_first_appearance, compacted, equal_rows, first_of_each
from ...geometry.topology import vertices_used
from ...mesh import Asset, Surface
from ..rawmesh import RawMesh, check, with_vertices
from .orient import connected_labels, face_edges, inconsistent_faces
from .sheets import separate_sheets, twins
from .weld import degenerate_faces, weld_vertices

if TYPE_CHECKING:
    from numpy.typing import NDArray


def clean(raw: RawMesh, *, stem: str = "mesh", sha256: str = "") -> Asset:
    """Weld, leave out degenerate faces and unused vertices, take faces that lie on each other apart, orient.

    Raises: MeshError for a mesh that is empty, not finite, out of range, too large, or degenerate in all its faces.
    """
    check(raw)
    part = with_vertices(raw, *compacted(raw.faces))
    weld = weld_vertices(part.positions, part.faces, part.body)
    proper = ~degenerate_faces(part.positions[first_of_each(weld)], weld[part.faces])
    if not proper.any():
        raise MeshError(
            f"all {len(proper)} faces are degenerate (repeated corners, no area), expected triangles; export it again"
        )
    kept = np.flatnonzero(proper)
    welded = compacted(weld[part.faces[kept]])[1]
    twin = twins(welded)
    lies_on = np.bincount(twin)[twin] > 1
    sheets = separate_sheets(welded, twin)[0] if lies_on.any() else welded
    flip = inconsistent_faces(sheets)
    counts = {
        "unreferenced_vertices": len(raw.positions) - vertices_used(part.faces[kept]),
        "welded_vertices": len(weld) - len(first_of_each(weld)),
        "degenerate_faces": int(np.count_nonzero(~proper)),
        "coincident_faces": int(np.count_nonzero(lies_on)),
        "flipped_faces": int(np.count_nonzero(flip)),
    }
    whole = replace(_with_faces(part, kept, flip), changes={**part.changes, **counts})
    return _asset(whole, _turned(sheets, flip), stem=stem, sha256=sha256)


def _with_faces(raw: RawMesh, kept: NDArray[np.int64], flip: NDArray[np.bool_]) -> RawMesh:
    """The faces kept (m,), some of them turned, with all that is said of each."""
    polygons = raw.polygons
    return replace(
        raw,
        faces=_turned(raw.faces[kept], flip),
        face_material=None if raw.face_material is None else raw.face_material[kept],
        part=None if raw.part is None else raw.part[kept],
        smoothing=None if raw.smoothing is None else raw.smoothing[kept],
        polygons=None if polygons is None else replace(polygons, corner=_turned(polygons.corner[kept], flip)),
    )


def _turned(faces: NDArray[np.int64], flip: NDArray[np.bool_]) -> NDArray[np.int64]:
    return np.where(flip[:, None], faces[:, [0, 2, 1]], faces)


def _asset(raw: RawMesh, sheets: NDArray[np.int64], *, stem: str, sha256: str) -> Asset:
    """The asset; sheets (f, 3) are its faces as surface vertices."""
    part, weld = _split_at_sheets(raw, sheets)
    surface = Surface(vertices=part.positions[first_of_each(weld)], faces=weld[part.faces])
    normals, repaired = _repaired_normals(part.normals, surface, weld)
    uv, moved = _finite_uv(part.uv)
    counts = {**raw.changes, "repaired_normals": repaired, "uv_not_finite": moved, **_edge_counts(surface.faces)}
    return Asset(
        positions=part.positions,
        faces=part.faces,
        weld=weld,
        surface=surface,
        normals=normals,
        colors=part.colors,
        uv=uv,
        materials=part.materials,
        face_material=part.face_material,
        changes={name: count for name, count in counts.items() if count},
        sha256=sha256,
        stem=stem,
        part=part.part,
        origin=part.origin,
        document=part.document,
        polygons=part.polygons,
        obj=part.obj,
        smoothing=part.smoothing,
        stored=part.stored,
    )


def _split_at_sheets(raw: RawMesh, sheets: NDArray[np.int64]) -> tuple[RawMesh, NDArray[np.int64]]:
    """The mesh with each vertex in one sheet only, and the surface vertex (n,) of each.

    A file vertex that belongs to several sheets is split: the first stays in its place, the others go to the end.
    """
    sheet = np.full(len(raw.positions), -1)
    sheet[raw.faces] = sheets
    if np.array_equal(sheet[raw.faces], sheets):  # as nearly always: none is split
        used = np.flatnonzero(sheet >= 0)
        number = np.cumsum(sheet >= 0) - 1
        return with_vertices(raw, used, number[raw.faces]), by_first_appearance(sheet[used])
    pair = equal_rows(np.stack([raw.faces.ravel(), sheets.ravel()], axis=1))
    first = first_of_each(pair)
    vertex = raw.faces.ravel()[first]
    _, earliest = np.unique(vertex[np.argsort(first)], return_index=True)
    later = np.ones(len(first), dtype=np.bool_)
    later[np.argsort(first)[earliest]] = False
    order = np.lexsort((first, vertex, later))
    number = np.zeros(len(order), dtype=np.int64)
    number[order] = np.arange(len(order))
    part = with_vertices(raw, vertex[order], number[pair].reshape(-1, 3))
    return part, by_first_appearance(sheets.ravel()[first][order])


def _repaired_normals(
    normals: NDArray[np.float64] | None, surface: Surface, weld: NDArray[np.int64]
) -> tuple[NDArray[np.float64] | None, int]:
    """Normals, those that are zero or not finite replaced by the surface's own, and how many these were."""
    if normals is None:
        return None, 0
    broken = np.logical_not(np.isfinite(normals).all(axis=1) & normals.any(axis=1))
    if not broken.any():
        return normals, 0
    return np.where(broken[:, None], smooth_normals(surface)[weld], normals), int(np.count_nonzero(broken))


def _finite_uv(uv: NDArray[np.float64] | None) -> tuple[NDArray[np.float64] | None, int]:
    """The uv, (0, 0) where they are not finite, and how many these were."""
    if uv is None or np.isfinite(uv).all():
        return uv, 0
    broken = np.logical_not(np.isfinite(uv).all(axis=1))
    return np.where(broken[:, None], 0.0, uv), int(np.count_nonzero(broken))


def _edge_counts(faces: NDArray[np.int64]) -> dict[str, int]:
    """Edges with three faces or more, and pieces joined by edges where there are several."""
    edges = face_edges(faces)
    components = int(connected_labels(edges.links, len(faces)).max()) + 1
    return {"non_manifold_edges": edges.non_manifold, "components": components if components > 1 else 0}

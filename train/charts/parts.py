"""The parts of a surface: what manifold edges join, each at a size of its own, and which of them are copies.

Every part is charted at area 1, so that a ball of radius 0.1 gets the same charts as one of radius 10.  A part that is
another one moved, turned or mirrored is not charted again.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.geometry.rows import by_first_appearance, first_of_each
from ...runtime.geometry.topology import edge_table, face_components, split_non_manifold_vertices, stable_order
from ...runtime.mesh import Surface
from ..finish.slits import Flat

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..finish.pieces import Piece


class Part(NamedTuple):
    """Faces that hang together.

    ids: (m,) int64 of the surface, ascending.  surface: those faces at area 1 around their mean, a manifold.
    scale: lengths there × scale are lengths of the whole surface.  origin: (3,) its place there.
    copy_of: number of the part it is a copy of, or −1; mirrored: whether that copy is a mirror image.
    """

    ids: NDArray[np.int64]
    surface: Surface
    scale: float
    origin: NDArray[np.float64]
    copy_of: int = -1
    mirrored: bool = False


def split_parts(surface: Surface, tolerance: float) -> list[Part]:
    """The parts of a surface, numbered by their lowest face.

    Args:
        surface: any welded surface; it is cut at edges that are not manifold.
        tolerance: distance, as a share of the part's size, up to which the vertices of a copy coincide.
    """
    faces, old = split_non_manifold_vertices(surface.faces)
    table = edge_table(faces)
    opened = Surface(surface.vertices[old], faces, calm=None if surface.calm is None else surface.calm[old])
    component = face_components(len(faces), table.edge_faces[table.manifold])
    order = stable_order(component, len(faces))
    size = np.bincount(component)
    twins = np.bincount(size)  # by number of faces: parts that have so many
    parts: list[Part] = []
    known: dict[bytes, list[Known]] = {}
    for ids in np.split(order, np.cumsum(size)[:-1]):
        part = extracted(opened, ids)
        if twins[len(ids)] > 1:
            part = compared(part, parts, known, tolerance)
        parts.append(part)
    return parts


class Known(NamedTuple):
    """The number of a part that is no copy, and how widely its corners are spread, which is that of its copies too."""

    number: int
    spread: float


def compared(part: Part, parts: list[Part], known: dict[bytes, list[Known]], tolerance: float) -> Part:
    """A part, named a copy where it is one of those before it.  known: those that are none, by pattern."""
    corners = part.surface.triangles.reshape(-1, 3)
    spread = float(np.linalg.norm(corners - corners.mean(axis=0)))
    for mirrored in (False, True):
        key = pattern(part.surface.faces, mirrored=mirrored)
        # no corner of a copy is farther off than the tolerance: so far may their spread differ
        off = 2.0 * tolerance * spread * np.sqrt(3.0 * len(corners))
        alike = (each.number for each in known.get(key, []) if abs(each.spread - spread) <= off)
        same = next((n for n in alike if is_copy(parts[n], part, tolerance, mirrored=mirrored)), -1)
        if same >= 0:
            return part._replace(copy_of=same, mirrored=mirrored)
    known.setdefault(pattern(part.surface.faces, mirrored=False), []).append(Known(len(parts), spread))
    return part


def extracted(surface: Surface, ids: NDArray[np.int64]) -> Part:
    """Faces ids (m,) as a surface of area 1 around its mean, its vertices numbered as its faces first name them."""
    corner = surface.faces[ids].reshape(-1)
    number = named(corner)
    old = corner[first_of_each(number)]
    points = surface.vertices[old]
    origin = points.mean(axis=0)
    points = points - origin
    renumbered = number.reshape(-1, 3)
    area = float(Surface(points, renumbered).face_areas().sum())
    extent = float(np.ptp(points, axis=0).max())
    scale = float(np.sqrt(area)) if area > 0.0 else (extent or 1.0)
    calm = None if surface.calm is None else (surface.calm[old] - origin) / scale
    return Part(ids, Surface(points / scale, renumbered, calm=calm), scale, origin)


def pattern(faces: NDArray[np.int64], *, mirrored: bool) -> bytes:
    """The connectivity of a part whose vertices are numbered as faces name them; of its mirror image where asked."""
    if mirrored:
        faces = named(faces[:, [0, 2, 1]].reshape(-1)).reshape(-1, 3)
    return faces.astype(np.int32).tobytes()


def named(corner: NDArray[np.int64]) -> NDArray[np.int64]:
    """Vertices (n,) numbered as they are first named; where they are few among many, in the time that few take."""
    least = int(corner.min())
    if int(corner.max()) - least > 4 * len(corner):
        corner, least = np.unique(corner, return_inverse=True)[1].reshape(-1), 0
    return by_first_appearance(corner - least)


def is_copy(first: Part, second: Part, tolerance: float, *, mirrored: bool) -> bool:
    """True where one motion (with a reflection, where mirrored) brings each corner onto its like."""
    if len(first.ids) != len(second.ids):
        return False
    a = first.surface.triangles
    b = second.surface.triangles[:, [0, 2, 1]] if mirrored else second.surface.triangles
    a, b = a.reshape(-1, 3), b.reshape(-1, 3)
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    u, _, v = np.linalg.svd(b.T @ a)
    sign = np.array([1.0, 1.0, (-1.0 if mirrored else 1.0) * np.sign(np.linalg.det(u @ v))])
    gap = np.abs(b @ (u * sign) @ v - a).max(initial=0.0)
    return bool(gap <= tolerance * float(np.ptp(a, axis=0).max(initial=0.0)))


def placed(piece: Piece, part: Part, surface: Surface, total: float) -> Piece:
    """A chart of a part, or of the one it is a copy of, as a chart of the whole surface."""
    ids = part.ids[piece.ids]
    uv, faces = piece.flat.uv * part.scale, piece.flat.surface.faces
    if part.mirrored:
        uv, faces = uv * [-1.0, 1.0], faces[:, [0, 2, 1]]
    vertices = np.zeros((len(uv), 3))
    vertices[faces.reshape(-1)] = surface.vertices[surface.faces[ids]].reshape(-1, 3)
    share = part.scale**2 / total
    return replace(
        piece,
        ids=ids,
        flat=Flat(Surface(vertices, faces), uv, {}),
        energy=piece.energy * share,
        slit_length=piece.slit_length * float(np.sqrt(share)),
        slits=(),
    )

"""The parts of a surface: what manifold edges join, each at a size of its own, and which of them are copies.

Every part is charted at area 1, so that a ball of radius 0.1 gets the same charts as one of radius 10.  A part that is
another one moved, turned or mirrored is not charted again.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.geometry.rows import by_first_appearance, first_of_each, grouped
from ...runtime.geometry.topology import edge_table, face_components, split_non_manifold_vertices
from ...runtime.mesh import Surface
from ..finish.slits import Flat

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..finish.pieces import Piece


SAMPLED = 32
"""Corners of a part at which lengths are compared before all of it is."""


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
    return with_copies([extracted(opened, ids) for ids in grouped(component)], tolerance)


def with_copies(parts: list[Part], tolerance: float) -> list[Part]:
    """The same parts, each named a copy of the first one before it that it is one of, and that is none itself."""
    twins = np.bincount([len(part.ids) for part in parts])  # by number of faces: parts that have so many
    asked = [number for number, part in enumerate(parts) if twins[len(part.ids)] > 1]
    alike: dict[bytes, list[int]] = {}
    for number in asked:
        alike.setdefault(pattern(parts[number].surface.faces, mirrored=False), []).append(number)
    shelves = {key: shelf_of(parts, numbers, tolerance) for key, numbers in alike.items()}
    found = list(parts)
    for number in asked:
        found[number] = compared(parts, number, shelves, tolerance)
        if found[number].copy_of < 0:
            shelves[pattern(parts[number].surface.faces, mirrored=False)].add(number)
    return found


def compared(parts: list[Part], number: int, shelves: dict[bytes, Shelf], tolerance: float) -> Part:
    """That part, named a copy where it is one of those known.  shelves: of parts by pattern."""
    part = parts[number]
    for mirrored in (False, True):
        shelf = shelves.get(pattern(part.surface.faces, mirrored=mirrored))
        near = [] if shelf is None else shelf.near(shape_of(part, mirrored=mirrored))
        same = next((known for known in near if is_copy(parts[known], part, tolerance, mirrored=mirrored)), -1)
        if same >= 0:
            return part._replace(copy_of=same, mirrored=mirrored)
    return part


class Shape(NamedTuple):
    """Lengths in a part that no motion changes.

    spread: root of the summed squares of its corners' distances from their mean.  lengths: (s,) of those distances, and
    of edges, at some of the corners.  corners: how many there are.  extent: the longest side of its box.
    """

    spread: float
    lengths: NDArray[np.float64]
    corners: int
    extent: float


def shape_of(part: Part, *, mirrored: bool) -> Shape:
    """Its lengths; those of its mirror image in the order in which that has them, where asked."""
    triangles = part.surface.triangles[:, [0, 2, 1]] if mirrored else part.surface.triangles
    points = triangles.reshape(-1, 3)
    from_mean = points - points.mean(axis=0)
    radius = np.sqrt((from_mean**2).sum(axis=1))
    some = np.unique(np.linspace(0, len(points) - 1, SAMPLED).astype(np.int64))
    after = some - some % 3 + (some + 1) % 3
    edge = np.sqrt(((points[after] - points[some]) ** 2).sum(axis=1))
    return Shape(
        float(np.sqrt((radius**2).sum())),
        np.concatenate([radius[some], edge]),
        len(points),
        float(np.ptp(points, axis=0).max()),
    )


class Shelf(NamedTuple):
    """Parts of one pattern (k,), by ascending spread: their numbers and lengths, and which are known to be no copies.

    reach: (k,) how far the lengths of a copy may be off.  place: of each number its row.
    """

    number: NDArray[np.int64]
    spread: NDArray[np.float64]
    lengths: NDArray[np.float64]
    reach: NDArray[np.float64]
    tolerance: float
    place: dict[int, int]
    known: NDArray[np.bool_]

    def near(self, shape: Shape) -> list[int]:
        """Those known, ascending, of which a part of that shape may be a copy; of no other is it one."""
        # no corner of a copy is farther off than the tolerance along an axis: so far may their spread differ
        off = 2.0 * self.tolerance * shape.spread * np.sqrt(3.0 * shape.corners)
        first, end = np.searchsorted(self.spread, [shape.spread - off, shape.spread + off]).tolist()
        row = first + np.flatnonzero(self.known[first:end])
        fits = (np.abs(self.lengths[row] - shape.lengths) <= self.reach[row, None]).all(axis=1)
        return np.sort(self.number[row[fits]]).tolist()

    def add(self, number: int) -> None:
        """From now on this part is known to be no copy."""
        self.known[self.place[number]] = True


def shelf_of(parts: list[Part], numbers: list[int], tolerance: float) -> Shelf:
    """The shelf of parts of one pattern, none of them known."""
    shapes = [shape_of(parts[number], mirrored=False) for number in numbers]
    spread = np.array([shape.spread for shape in shapes])
    order = np.argsort(spread, kind="stable")
    ordered = [shapes[row] for row in order.tolist()]
    extent = np.array([shape.extent for shape in ordered])
    place = {numbers[row]: rank for rank, row in enumerate(order.tolist())}
    return Shelf(
        np.array(numbers)[order],
        spread[order],
        np.array([shape.lengths for shape in ordered]),
        2.0 * np.sqrt(3.0) * tolerance * extent + 1e-12 * spread[order],  # an edge has two ends
        tolerance,
        place,
        np.zeros(len(numbers), dtype=bool),
    )


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

"""Mirrored charts: a part that is its own mirror image is charted in half, and the other half gets the mirror image.

The plane lies across x, y or z, through the mean of the vertices or the middle of their box.  Charts that meet at the
plane are joined where that lowers the objective: such a chart is symmetric too.   v vertices · f faces · a part has
area 1.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial import KDTree

from ...runtime.geometry.topology import edge_table
from ...runtime.mesh import Surface
from ...runtime.process.deadline import Late, never
from ..carry.carry import carried_ways, carry_piece
from ..finish.pieces import Piece
from ..finish.slits import Flat
from ..search.labels import connected_pieces, dual_graph
from ..search.search import Merge, Search

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ..config import FinishConfig, SymmetryConfig

    Solve = Callable[[Surface, int, FinishConfig], list[Piece]]

AXES = "xyz"


class Mirror(NamedTuple):
    """A plane across an axis that mirrors a surface onto itself.

    axis: 0, 1 or 2.  middle: its place there.  half: (h,) faces on its upper side.  like: (f,) for each other face the
    row in half of the face that lies nearest to its mirror image; −1 for those in half.  exact: (f,) whether it is that
    mirror image, corner by corner.  turn: (f, 3) which corner of that face each corner is the image of, where exact.
    """

    axis: int
    middle: float
    half: NDArray[np.int64]
    like: NDArray[np.int64]
    exact: NDArray[np.bool_]
    turn: NDArray[np.int64]

    def image(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (…, 3) mirrored."""
        return _image(points, self.axis, self.middle)

    @property
    def unlike(self) -> int:
        """Faces beyond the plane that are no mirror image."""
        return int(np.count_nonzero((self.like >= 0) & ~self.exact))


def _image(points: NDArray[np.float64], axis: int, middle: float) -> NDArray[np.float64]:
    """Points (…, 3) mirrored in a plane across an axis."""
    image = points.copy()
    image[..., axis] = 2.0 * middle - points[..., axis]
    return image


def mirror_of(surface: Surface, config: SymmetryConfig) -> Mirror | None:
    """The plane that is asked for, or the best of three; None where too few vertices have a mirror image."""
    points = surface.vertices
    size, found = float(np.ptp(points, axis=0).max()), list[tuple[float, int, float]]()
    axes = range(3) if config.axis == "auto" else (AXES.index(config.axis),)
    reach, share = (config.exact, 1.0) if config.axis == "auto" else (config.near, config.share)
    tree = KDTree(points)
    for axis in axes:
        column = points[:, axis]
        for middle in (float(column.mean()), float(column.min() + column.max()) / 2.0):
            image = _image(points, axis, middle)
            distance = tree.query(image, distance_upper_bound=2.0 * reach * size)[0]
            found.append((float(np.mean(distance <= reach * size)), axis, middle))
    best = max(found, key=lambda entry: entry[0])
    return _mirror(surface, *best[1:], reach * size) if best[0] >= share else None


def _mirror(surface: Surface, axis: int, middle: float, reach: float) -> Mirror | None:
    """What lies where, for a plane; None where one side has no face."""
    places = surface.triangles.mean(axis=1)
    upper = places[:, axis] >= middle
    half, rest = np.flatnonzero(upper), np.flatnonzero(~upper)
    if not len(half) or not len(rest):
        return None
    like, exact = np.full(len(places), -1, dtype=np.int64), np.zeros(len(places), dtype=bool)
    turn = np.zeros((len(places), 3), dtype=np.int64)
    like[rest] = KDTree(places[half]).query(_image(places[rest], axis, middle))[1]
    distance, twin = KDTree(surface.vertices).query(_image(surface.vertices, axis, middle))
    twin = np.where(distance <= reach, twin, -1)
    own, other = surface.faces[rest], twin[surface.faces[half[like[rest]]]]
    same = own[:, :, None] == other[:, None, :]
    exact[rest], turn[rest] = same.any(axis=2).all(axis=1), same.argmax(axis=2)
    return Mirror(axis, middle, half, like, exact, turn)


def mirrored_charts(
    surface: Surface, mirror: Mirror, charts: int, config: FinishConfig, solve: Solve, late: Late = never
) -> list[Piece]:
    """Charts of a part that are each other's mirror images, or their own.

    solve: (surface, most charts, config) → charts of a half, proven.
    """
    half, _ = surface.part(mirror.half)
    area = float(half.face_areas().sum())
    # the half counts its seams in its own √area, and they will be there twice
    slit = replace(config.slit, price=config.slit.price * 2.0 * float(np.sqrt(area)))
    # by the search's own energy, in which charts are compared; another that is asked for finishes the whole
    energy, symmetry = replace(config.energy, kind="isometric"), replace(config.symmetry, axis="none")
    own = replace(config, slit=slit, energy=energy, symmetry=symmetry)
    found = [
        replace(
            piece,
            ids=mirror.half[piece.ids],
            energy=piece.energy * area,
            slit_length=piece.slit_length * float(np.sqrt(area)),
        )
        for piece in solve(half, max((charts + 1) // 2, 1), own)
    ]
    search = Search(surface, dual_graph(surface, edge_table(surface.faces), config.labels.seams), config)
    pairs = [(search.add(piece), *with_image(search, mirror, piece)) for piece in found]
    search.place_loose()
    joined(search, [pair[:2] for pair in pairs if len(pair) == 2], charts, late)
    return list(search.pieces.values())


def with_image(search: Search, mirror: Mirror, piece: Piece) -> list[int]:
    """Add the mirror image of a chart of the upper half; the keys of what came of it, one where all fits."""
    row = np.full(len(search.surface.faces) + 1, -1, dtype=np.int64)
    row[piece.ids] = np.arange(len(piece.ids))
    of_face = np.where(mirror.like >= 0, row[mirror.half[mirror.like]], -1)
    ids = np.flatnonzero(of_face >= 0)
    source = mirrored(mirror, piece)
    before = set(search.pieces)
    if mirror.exact[ids].all() and len(ids) == len(piece.ids):
        search.add(exact_image(search.surface, mirror, piece, ids, of_face[ids]))
    else:
        label = connected_pieces((of_face >= 0).astype(np.int64), search.graph)
        for number in np.unique(label[ids]).tolist():
            own = np.flatnonzero(label == number)
            carry_piece(search, own, source, carried_ways(search, own, source))
    return [key for key in search.pieces if key not in before]


def mirrored(mirror: Mirror, piece: Piece) -> Piece:
    """The mirror image of a chart in space, as something to lay faces out like; its ids are the chart's own."""
    flat = piece.flat
    image = Surface(mirror.image(flat.surface.vertices), flat.surface.faces[:, [0, 2, 1]])
    slits = tuple(slit._replace(points=mirror.image(slit.points)) for slit in piece.slits)
    return replace(piece, flat=Flat(image, flat.uv * [-1.0, 1.0], {}), slits=slits)


def exact_image(
    surface: Surface, mirror: Mirror, piece: Piece, ids: NDArray[np.int64], rows: NDArray[np.int64]
) -> Piece:
    """The chart on the faces ids (m,), the mirror images of its faces rows (m,)."""
    faces = np.take_along_axis(piece.flat.surface.faces[rows], mirror.turn[ids], axis=1)
    vertices = np.zeros((len(piece.flat.uv), 3))
    vertices[faces.reshape(-1)] = surface.vertices[surface.faces[ids]].reshape(-1, 3)
    slits = tuple(slit._replace(points=mirror.image(slit.points)) for slit in piece.slits)
    return replace(piece, ids=ids, flat=Flat(Surface(vertices, faces), piece.flat.uv * [-1.0, 1.0], {}), slits=slits)


def joined(search: Search, pairs: list[tuple[int, int]], charts: int, late: Late) -> None:
    """Join charts with their images where that pays, or where there are too many: those first that cost least."""
    if late():
        return
    borders, merges = search.borders(), list[Merge]()
    touching = [pair for pair in pairs if pair in borders]
    search.try_merges(touching)
    for pair in touching:
        merged = search.tried[pair]
        if merged is not None:
            apart = sum(search.cost_of(search.pieces[key]) for key in pair) + search.price * borders[pair]
            merges.append(Merge(apart - search.cost(merged), pair, merged))
    for merge in sorted(merges, key=lambda each: -each.gain):
        many = len(search.pieces) > charts and search.energy() - merge.gain <= search.config.most_excess
        if (merge.gain > 0.0 or many) and set(merge.pair) <= set(search.pieces):
            search.apply_merge(merge, -np.inf if many else 0.0)

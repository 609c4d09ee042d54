"""Where an atlas lies in an image: corners in texels, borders of charts, windows, and what they are drawn into.

f faces · e border edges · h w texels.  Image row 0 is the top, uv is v up: a corner at (u, v) lies at
x = u · width, y = (1 − v) · height texels, the centre of texel (row, column) at (column + ½, row + ½).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.errors import InputError
from ...runtime.geometry.triangles import signed_areas
from ...runtime.pagesize import LARGEST, PageSize

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Atlas
    from ...runtime.pagesize import Size

UV_SLACK = 1e-4
"""How far uv may leave [0, 1] (rounding of other tools) before it is an error."""


@dataclass(frozen=True)
class Window:
    """A rectangle of texels of the image: rows row to row + height, columns column to column + width."""

    row: int
    column: int
    height: int
    width: int

    @property
    def rows(self) -> slice:
        """Its rows of the image."""
        return slice(self.row, self.row + self.height)

    @property
    def columns(self) -> slice:
        """Its columns of the image."""
        return slice(self.column, self.column + self.width)

    def scaled(self, by: int) -> Window:
        """The same window of an image `by` times as large."""
        return Window(by * self.row, by * self.column, by * self.height, by * self.width)


def windows(size: Size | PageSize, side: int, texels: int) -> list[Window]:
    """An image of that size in windows, row by row: at most `side` wide and high, about `texels` texels each.

    They are as wide as the image where that is allowed, since whole rows lie together in memory.
    """
    page = PageSize.of(size)
    width = min(page.width, side)
    height = min(page.height, side, max(1, texels // width))
    return [
        Window(row, column, min(height, page.height - row), min(width, page.width - column))
        for row in range(0, page.height, height)
        for column in range(0, page.width, width)
    ]


@dataclass(frozen=True, eq=False)
class Layout:
    """An atlas laid into an image of page.width × page.height texels.

    texel: (f, 3, 2) float32 places of the corners, x right, y down.  edges: (e, 2) int32 as `border_edges`.
    face_bounds: (4, f) float32 left, top, right, bottom.  edge_bounds: (4, e) float32, likewise.
    radius: (f,) float32 radius of the inscribed circle, texels.
    """

    page: PageSize
    texel: NDArray[np.float32]
    edges: NDArray[np.int32]
    face_bounds: NDArray[np.float32]
    edge_bounds: NDArray[np.float32]
    radius: NDArray[np.float32]

    @classmethod
    def of(cls, atlas: Atlas, size: Size | PageSize, tile: tuple[int, int] | None = None) -> Layout:
        """Lay out the unit square, or the UDIM tile of uv [a, a + 1] × [b, b + 1] for tile (a, b).

        Raises: InputError for a size out of range, or uv outside [0, 1] where no tile is given.
        """
        page = PageSize.of(size)
        check_size(page)
        if tile is None:
            check_uv(atlas.uv)
        place = (atlas.uv.astype(np.float64) - (tile or (0, 0))) * page
        place[:, 1] = page.height - place[:, 1]
        texel, edges = place.astype(np.float32)[atlas.faces], border_edges(atlas.faces, atlas.uv)
        face, corner = edges.T
        ends = (texel[face, corner], texel[face, (corner + 1) % 3])
        bounds = _bounds(texel[:, 0], texel[:, 1], texel[:, 2])
        return cls(page, texel, edges, bounds, _bounds(*ends), _inscribed_radius(texel))

    def faces_in(self, window: Window) -> NDArray[np.int32]:
        """(a,) int32 faces whose bounds meet the window, ascending."""
        return np.flatnonzero(_meets(self.face_bounds, window, 1.0)).astype(np.int32)

    def edges_in(self, window: Window, reach: float) -> NDArray[np.int32]:
        """(b, 2) int32 border edges that come within `reach` texels (and one) of the window, in order."""
        return self.edges[_meets(self.edge_bounds, window, reach + 1.0)]


class Planes(NamedTuple):
    """Arrays that a window is read into.

    position, normal: (h, w, 4) float32, the fourth channel a barycentric weight.  face: (h, w) int32.
    """

    position: NDArray[np.float32]
    normal: NDArray[np.float32]
    face: NDArray[np.int32]

    @classmethod
    def of(cls, height: int, width: int) -> Planes:
        """New arrays."""
        four = (height, width, 4)
        return cls(np.zeros(four, np.float32), np.zeros(four, np.float32), np.full((height, width), -1, np.int32))

    def shaped(self, height: int, width: int) -> Planes:
        """The first height · width texels as planes of that shape: memory used again."""
        position, normal = (plane.reshape(-1, 4)[: height * width] for plane in (self.position, self.normal))
        face = self.face.reshape(-1)[: height * width].reshape(height, width)
        return Planes(position.reshape(height, width, 4), normal.reshape(height, width, 4), face)

    def part(self, rows: slice, columns: slice) -> Planes:
        """A view of some rows and columns."""
        return Planes(self.position[rows, columns], self.normal[rows, columns], self.face[rows, columns])


def check_size(size: Size | PageSize) -> None:
    """Raise InputError unless an image of that size can be made."""
    page = PageSize.of(size)
    if not page.is_possible:
        raise InputError(f"size {page.stored}: expected 1 to {LARGEST} texels a side; choose a size in that range")


def check_uv(uv: NDArray[np.floating]) -> None:
    """Raise InputError unless all uv (n, 2) are finite and in [0, 1]."""
    if not np.isfinite(uv).all():
        raise InputError("uv holds NaN or infinite values; expected values in [0, 1]; unwrap the mesh anew")
    low, high = float(uv.min(initial=0.0)), float(uv.max(initial=1.0))
    if low < -UV_SLACK or high > 1.0 + UV_SLACK:
        raise InputError(
            f"uv span {low:.4g} to {high:.4g}; expected 0 to 1 (no repeats; UDIM tiles only where asked for);"
            " unwrap or repack the mesh, or bake it as UDIM"
        )


def border_edges(faces: NDArray[np.int64], uv: NDArray[np.floating]) -> NDArray[np.int32]:
    """(e, 2) int32 rows (face, corner): the edge from that corner to the next one has no neighbour beyond it in uv.

    A neighbour is the one other face at the edge, running along it the other way, of the same non-zero orientation in
    uv.
    So the edges of faces of zero uv area, of folds and of non-manifold fans are borders too.  Rows ascend.
    """
    sign = np.sign(signed_areas(uv[faces].astype(np.float64))).astype(np.int64)
    start, end = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    key = np.minimum(start, end) * (int(faces.max(initial=0)) + 1) + np.maximum(start, end)
    _, edge, count = np.unique(key, return_inverse=True, return_counts=True)
    edge = edge.reshape(-1)
    direction = np.bincount(edge, weights=np.sign(end - start))
    orientation = np.bincount(edge, weights=np.repeat(sign, 3))
    joined = (count == 2) & (direction == 0.0) & (np.abs(orientation) == 2.0)
    half_edges = np.flatnonzero(~joined[edge])
    return np.stack([half_edges // 3, half_edges % 3], axis=1).astype(np.int32)


def _bounds(*places: NDArray[np.float32]) -> NDArray[np.float32]:
    """(4, i) float32 left, top, right, bottom of places (i, 2) each."""
    low, high = places[0], places[0]
    for place in places[1:]:
        low, high = np.minimum(low, place), np.maximum(high, place)
    return np.ascontiguousarray(np.column_stack([low, high]).T)


def _inscribed_radius(texel: NDArray[np.float32]) -> NDArray[np.float32]:
    """(f,) float32 twice the area by the perimeter of triangles (f, 3, 2); 0 for a point."""
    (ax, ay), (bx, by), (cx, cy) = texel.astype(np.float64).transpose(1, 2, 0)
    perimeter = np.hypot(bx - ax, by - ay) + np.hypot(cx - bx, cy - by) + np.hypot(ax - cx, ay - cy)
    double = np.abs((bx - ax) * (cy - ay) - (by - ay) * (cx - ax))
    return (double / np.maximum(perimeter, np.finfo(np.float64).tiny)).astype(np.float32)


def _meets(bounds: NDArray[np.float32], window: Window, slack: float) -> NDArray[np.bool_]:
    """(i,) whether bounds (4, i), grown by slack texels, meet the window."""
    left, top, right, bottom = bounds
    met = (bottom >= window.row - slack) & (top <= window.row + window.height + slack)
    return met & (right >= window.column - slack) & (left <= window.column + window.width + slack)

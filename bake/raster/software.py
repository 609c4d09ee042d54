"""The rasterizer without OpenGL: the same G-buffer in numpy, slower; the reference of the tests.

f faces · e border edges · s spans (the texels of one row that a face holds) · t texels.
Which texel belongs to which face is decided by the integers of shaders/exact.glsl: places are snapped to 1/256 texel,
cross products are exact in 64 bits.  So the faces are equal to the device's, values to rounding.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...runtime.errors import InputError
from ...runtime.geometry.triangles import cross_2d
from .gbuffer import LEAST, REACH, WINDOW, GBuffer
from .layout import Layout, Planes, Window, windows

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Atlas
    from ...runtime.pagesize import PageSize, Size

ONE = 256
"""Units of snapped places in a texel."""
SPANS = 1 << 20
"""(face, row) pairs looked at together: bounds the memory of temporaries."""
FAR = np.iinfo(np.int64).max


def rasterize_in_software(atlas: Atlas, size: Size | PageSize, *, limit: int | None = None) -> GBuffer:
    """The whole image, as `gbuffer.rasterize`.  Raises: InputError for a size out of range, or as the rasterizer."""
    layout = Layout.of(atlas, size)
    drawn, planes = SoftwareRasterizer(atlas, layout), Planes.of(*layout.page.shape)
    for window in windows(layout.page, limit or layout.page.side, WINDOW):
        drawn.draw(window, planes.part(window.rows, window.columns))
    return GBuffer.of(planes, size=layout.page)


class SoftwareRasterizer:
    """An atlas laid into an image; draws any window of it, as `gbuffer.DeviceRasterizer` does."""

    def __init__(self, atlas: Atlas, layout: Layout) -> None:
        """Raises: InputError for no face."""
        if len(atlas.faces) == 0:
            raise InputError("0 faces: expected at least one; check the mesh")
        self.layout = layout
        self._positions, self._normals, self._faces = atlas.positions, atlas.normals, atlas.faces
        self._snapped = np.floor(self.layout.texel * np.float32(ONE) + np.float32(0.5)).astype(np.int64)

    def draw(self, window: Window, planes: Planes | None = None, *, clear: bool = True) -> GBuffer:
        """The G-buffer of a window, written into planes of its shape where given; always clear."""
        del clear
        into = Planes.of(window.height, window.width) if planes is None else planes
        into.position[...], into.normal[...], into.face[...] = 0.0, 0.0, -1
        face = np.full(window.height * window.width, -1, np.int32)
        self._fill_faces(face, window)
        texels = np.flatnonzero(face >= 0)
        self._write(into, texels, face[texels], self._inside_weights(face[texels], texels, window))
        texels, owner, corner = self._nearest_edges(face, window)
        self._write(into, texels, owner, self._edge_weights(owner, corner, texels, window))
        return GBuffer.of(into, window.row, window.column, self.layout.page)

    def _fill_faces(self, face: NDArray[np.int32], window: Window) -> None:
        """Each texel of face (h · w,) whose centre a face holds becomes the lowest such face."""
        chosen = self.layout.faces_in(window).astype(np.int64)
        for faces in _pieces(chosen, self._rows_of(chosen, window)[1], SPANS):
            owner, row, first, last = self._spans(faces, window)
            held = np.repeat(owner, last - first)
            texels = _ranges(row * window.width + first, last - first)
            free = face[texels] < 0
            held, texels = held[free][::-1], texels[free][::-1]
            face[texels] = held  # of equal indices the last one stays: the lowest face

    def _rows_of(self, faces: NDArray[np.int64], window: Window) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """First row and number of rows of the window whose centres lie between top and bottom of the faces."""
        y = self._snapped[faces][..., 1]
        first = np.maximum(-((ONE // 2 - y.min(axis=1)) // ONE), window.row)
        last = np.minimum((y.max(axis=1) - ONE // 2) // ONE + 1, window.row + window.height)
        return first - window.row, np.maximum(last - first, 0)

    def _spans(
        self, faces: NDArray[np.int64], window: Window
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """(s,) face, row, first and one after the last column of the window, by ascending face."""
        first_row, count = self._rows_of(faces, window)
        owner, row = np.repeat(faces, count), _ranges(first_row, count)
        first, last = np.zeros(len(owner), np.int64), np.full(len(owner), window.width, np.int64)
        a, b, c = self._snapped[owner].transpose(1, 0, 2)
        turn = np.sign(cross_2d(b - a, c - a))
        centre_y, centre_x = ONE * (row + window.row) + ONE // 2, ONE * window.column + ONE // 2
        for start, end in ((a, b), (b, c), (c, a)):
            along = (end - start) * turn[:, None]
            # the centre of column x is inside where  rest ≥ step · x
            rest = along[:, 0] * (centre_y - start[:, 1]) - along[:, 1] * (centre_x - start[:, 0])
            step = ONE * along[:, 1]
            divisor = np.where(step == 0, 1, np.abs(step))
            last = np.where(step > 0, np.minimum(last, rest // divisor + 1), last)
            first = np.where(step < 0, np.maximum(first, -(rest // divisor)), first)
            last = np.where((step == 0) & (rest < 0), 0, last)
        kept = (turn != 0) & (last > first)
        return owner[kept], row[kept], first[kept], last[kept]

    def _nearest_edges(
        self, face: NDArray[np.int32], window: Window
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """(t,) texels that no face holds within `REACH` of a border, and the face and corner of the nearest edge."""
        edges = self.layout.edges_in(window, REACH).astype(np.int64)
        nearest, winner = np.full(len(face), FAR, np.int64), np.zeros(len(face), np.int64)
        start, end = self._snapped[edges[:, 0], edges[:, 1]], self._snapped[edges[:, 0], (edges[:, 1] + 1) % 3]
        row, count = _edge_rows(start, end, window)
        for index in _pieces(np.arange(len(edges)), count, SPANS // 4):
            edge, texels = _near_texels(index, start, end, row, count, window)
            free = face[texels] < 0
            edge, texels = edge[free], texels[free]
            square = _square_distance(start[edge], end[edge], _centres(texels, window))
            close = (square >= 0.0) & (square <= np.float32(ONE * ONE) * np.float32(REACH) * np.float32(REACH))
            edge, texels, key = edge[close], texels[close], np.floor(8.0 * square[close]).astype(np.int64)
            order = np.lexsort((edge, key, texels))
            texels, edge, key = texels[order], edge[order], key[order]
            best = np.flatnonzero(np.diff(texels, prepend=-1))
            best = best[key[best] < nearest[texels[best]]]
            nearest[texels[best]], winner[texels[best]] = key[best], edge[best]
        texels = np.flatnonzero(nearest < FAR)
        return texels, edges[winner[texels], 0], edges[winner[texels], 1]

    def _inside_weights(
        self, faces: NDArray[np.integer], texels: NDArray[np.int64], window: Window
    ) -> NDArray[np.float64]:
        """(t, 3) barycentric weights of the centres, clamped into the face, each at least `LEAST`."""
        centre = _centres(texels, window) / ONE
        a, b, c = (self.layout.texel[faces, i].astype(np.float64) - centre for i in range(3))
        raw = np.stack([cross_2d(b, c), cross_2d(c, a), cross_2d(a, b)], axis=1)
        weight = np.maximum(raw * np.sign(cross_2d(b - a, c - a))[:, None], 0.0)
        total = weight.sum(axis=1, keepdims=True)
        weight = np.maximum(np.where(total > 0.0, weight / np.where(total > 0.0, total, 1.0), 1.0 / 3.0), LEAST)
        return weight / weight.sum(axis=1, keepdims=True)

    def _edge_weights(
        self, faces: NDArray[np.int64], corner: NDArray[np.int64], texels: NDArray[np.int64], window: Window
    ) -> NDArray[np.float64]:
        """(t, 3) barycentric weights of the points of the edges nearest to the centres."""
        following = (corner + 1) % 3
        start = self.layout.texel[faces, corner].astype(np.float64)
        along = self.layout.texel[faces, following].astype(np.float64) - start
        square = (along * along).sum(axis=1)
        part = ((_centres(texels, window) / ONE - start) * along).sum(axis=1) / np.where(square > 0.0, square, 1.0)
        part = np.clip(part, 0.0, 1.0)
        weight, place = np.zeros((len(faces), 3)), np.arange(len(faces))
        weight[place, corner], weight[place, following] = 1.0 - part, part
        return weight

    def _write(
        self, into: Planes, texels: NDArray[np.int64], faces: NDArray[np.integer], weight: NDArray[np.float64]
    ) -> None:
        """Position, normal, weights and face of the texels."""
        place = np.unravel_index(texels, into.face.shape)
        corners = self._faces[faces]
        normal = np.einsum("tc,tci->ti", weight, self._normals[corners].astype(np.float64))
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        normal = np.where(length > 1e-12, normal / np.maximum(length, 1e-12), self._normals[corners[:, 0]])
        position = np.einsum("tc,tci->ti", weight, self._positions[corners])
        into.position[place] = np.column_stack([position, weight[:, 1]])
        into.normal[place] = np.column_stack([normal, weight[:, 2]])
        into.face[place] = faces


def _edge_rows(
    start: NDArray[np.int64], end: NDArray[np.int64], window: Window
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(e,) first row and number of rows of the window that come within a texel of the edges."""
    low, high = np.minimum(start[:, 1], end[:, 1]) // ONE - 1, np.maximum(start[:, 1], end[:, 1]) // ONE + 2
    first = np.maximum(low, window.row)
    return first - window.row, np.maximum(np.minimum(high, window.row + window.height) - first, 0)


def _near_texels(
    index: NDArray[np.int64],
    start: NDArray[np.int64],
    end: NDArray[np.int64],
    row: NDArray[np.int64],
    count: NDArray[np.int64],
    window: Window,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(t,) edge and flat texel: all texels of the window within a texel of the edges of that index, and a few more."""
    edge, rows = np.repeat(index, count[index]), _ranges(row[index], count[index])
    a, along = start[edge] / ONE, (end - start)[edge] / ONE
    top = rows + window.row - 0.5
    slope = np.where(along[:, 1] == 0.0, 1.0, along[:, 1])
    ends = [np.clip((y - a[:, 1]) / slope, 0.0, 1.0) for y in (top - 1.0, top + 3.0)]
    level = along[:, 1] == 0.0
    x = np.sort([a[:, 0] + np.where(level, flat, t) * along[:, 0] for t, flat in zip(ends, (0.0, 1.0), strict=True)], 0)
    first = np.clip(np.floor(x[0]).astype(np.int64) - 1 - window.column, 0, window.width)
    last = np.clip(np.floor(x[1]).astype(np.int64) + 2 - window.column, first, window.width)
    return np.repeat(edge, last - first), _ranges(rows * window.width + first, last - first)


def _square_distance(
    start: NDArray[np.int64], end: NDArray[np.int64], centre: NDArray[np.int64]
) -> NDArray[np.float32]:
    """(t,) float32 squared distance of centres to edges, rounded as shaders/border.frag.glsl rounds it."""
    along = end - start
    before = (along * (centre - start)).sum(axis=1) <= 0
    after = (along * (centre - end)).sum(axis=1) >= 0
    height = cross_2d(along, centre - start).astype(np.float32)
    length = _square(along)
    across = height * height / np.where(length > 0.0, length, np.float32(1.0))
    return np.where(before, _square(centre - start), np.where(after, _square(centre - end), across))


def _square(place: NDArray[np.int64]) -> NDArray[np.float32]:
    """(t,) float32 squared lengths."""
    x, y = place.astype(np.float32).T
    return x * x + y * y


def _centres(texels: NDArray[np.int64], window: Window) -> NDArray[np.int64]:
    """(t, 2) snapped centres (x, y) in the image."""
    row, column = np.divmod(texels, window.width)
    return ONE * np.stack([column + window.column, row + window.row], axis=1) + ONE // 2


def _ranges(first: NDArray[np.int64], count: NDArray[np.int64]) -> NDArray[np.int64]:
    """Of each range the numbers first, first + 1, …, count of them, one range after the other."""
    end = np.cumsum(count)
    return np.arange(int(end[-1]) if len(end) else 0) + np.repeat(first - (end - count), count)


def _pieces(items: NDArray[np.int64], weight: NDArray[np.int64], most: int) -> list[NDArray[np.int64]]:
    """The items in order, cut into pieces of about `most` weight each."""
    if len(items) == 0:
        return []
    piece = np.cumsum(weight) // most
    return np.split(items, np.flatnonzero(np.diff(piece)) + 1)

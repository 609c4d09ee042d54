"""Seams under bilinear filtering: where they are, and how far their two sides differ.

f faces · e seam edges · s samples along them · c channels.  A seam edge is one edge of the surface that lies in uv
twice.  Sampled through either chart it should give one value; closing.py moves texels so that it does.

Creases (the normals of the two sides differ) are left out: what depends on the normal differs there by right.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...runtime.geometry.rows import equal_rows, first_of_each
from ...runtime.pagesize import PageSize
from ..raster.layout import border_edges

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ...runtime.mesh import Atlas
    from ...runtime.pagesize import Size
    from ..texture import Texture

PER_TEXEL = 2.0
"""Samples per texel of a seam's length."""
SMOOTH = 1e-3
"""Normals of the two sides that differ by less are one normal."""
WELD = 1e-8
"""Share of the mesh's extent by which one point of a seam may differ from side to side."""
PER_FACE = frozenset({"chart", "face-id", "material-id", "distortion"})
"""Maps that jump from face to face."""


@dataclass(frozen=True)
class SeamError:
    """Differences between the two sides of seams, as shares of the map's range (1/255 is one step of 8 bits).

    maximum, p99: over the samples.  samples: how many there were.
    """

    maximum: float
    p99: float
    samples: int


@dataclass(frozen=True, eq=False)
class SeamSamples:
    """Bilinear footprints of points on seams, from either side.

    texel: (s, 8) int64 flat texels, four of the one side, four of the other.  weight: (s, 8) float64, each four sum
    to 1, those of the other side to −1: the product with the texels' values is the difference of the sides.
    """

    texel: NDArray[np.int64]
    weight: NDArray[np.float64]

    def differences(self, pixels: NDArray[np.float32]) -> NDArray[np.float64]:
        """(s, c) differences of the sides in an image (h, w, c)."""
        flat = pixels.reshape(-1, pixels.shape[2])
        return np.einsum("sj,sjc->sc", self.weight, flat[self.texel])


def agrees_across_seams(name: str, space: str) -> bool:
    """Whether a map of that name and space is one function of the surface, the same on both sides of a seam."""
    return not (name in PER_FACE or space.startswith(("tangent", "uv")))


def chart_outlines(atlas: Atlas) -> NDArray[np.float64]:
    """(b, 2, 2) float64 uv: ends of the edges at which the uv end, those of holes and of the mesh's border included."""
    return _border_uv(atlas, _uv_borders(atlas)[1])


def seam_edges(atlas: Atlas) -> NDArray[np.float64]:
    """(e, 2, 3) float64: ends of the edges of the surface that lie in uv more than once."""
    welded, borders = _uv_borders(atlas)
    order, start, count = _groups_of_edges(welded[borders[:, 0]], borders[:, 1])
    first = borders[order[start[count > 1]]]
    return atlas.positions[np.stack([atlas.faces[first[:, 0], (first[:, 1] + i) % 3] for i in (0, 1)], axis=1)]


def find_seams(atlas: Atlas) -> NDArray[np.float64]:
    """(e, 2, 2, 2) float64 uv: edge, side, end.  Both sides run the same way along the edge; creases are left out."""
    welded, borders = _uv_borders(atlas)
    order, start, count = _groups_of_edges(welded[borders[:, 0]], borders[:, 1])
    pair = borders[np.stack([order[start[count == 2]], order[start[count == 2] + 1]], axis=1)]
    ends = np.stack([atlas.faces[pair[..., 0], (pair[..., 1] + i) % 3] for i in (0, 1)], axis=2)
    joint = np.stack([welded[pair[..., 0], (pair[..., 1] + i) % 3] for i in (0, 1)], axis=2)
    ends = np.where((joint[..., 0] > joint[..., 1])[..., None], ends[..., ::-1], ends)
    uv, normal = atlas.uv[ends].astype(np.float64), atlas.normals[ends]
    smooth = np.abs(normal[:, 0] - normal[:, 1]).max(axis=(1, 2), initial=0.0) < SMOOTH
    return uv[smooth & (uv[:, 0] != uv[:, 1]).any(axis=(1, 2))]


def _uv_borders(atlas: Atlas) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Faces (f, 3) over vertices welded by position, and borders (b, 2), rows of face and corner.

    Vertices that differ by their normals alone are one for the borders, so those are edges at which the uv end.
    """
    extent = float(np.ptp(atlas.positions, axis=0).max()) or 1.0
    _, place = np.unique(np.round(atlas.positions / (WELD * extent)), axis=0, return_inverse=True)
    place = place.reshape(-1).astype(np.int64)
    same = equal_rows(np.column_stack([place.astype(np.float64), atlas.uv.astype(np.float64)]))
    first = first_of_each(same)
    return place[atlas.faces], border_edges(same[atlas.faces], atlas.uv[first]).astype(np.int64)


def _groups_of_edges(
    faces: NDArray[np.int64], corner: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Half-edges (b,) sorted by the edge they lie on; where each edge begins in that order, and how many it has.

    faces: (b, 3) of each half-edge.  corner: (b,) at which it starts.
    """
    row = np.arange(len(faces))
    low, high = np.sort(np.stack([faces[row, corner], faces[row, (corner + 1) % 3]]), axis=0)
    key = low * (int(faces.max(initial=0)) + 1) + high
    order = np.argsort(key, kind="stable")
    _, start, count = np.unique(key[order], return_index=True, return_counts=True)
    return order, start, count


def _border_uv(atlas: Atlas, borders: NDArray[np.int64]) -> NDArray[np.float64]:
    """(b, 2, 2) float64 uv of the ends of borders (b, 2), rows of face and corner."""
    face, corner = borders.T
    ends = np.stack([atlas.faces[face, corner], atlas.faces[face, (corner + 1) % 3]], axis=1)
    return atlas.uv[ends].astype(np.float64)


def page_of(image: NDArray[Any]) -> PageSize:
    """Size of an image (h, w, …)."""
    return PageSize(image.shape[1], image.shape[0])


def sample_seams(seams: NDArray[np.float64], size: Size | PageSize) -> SeamSamples:
    """Samples along seams (e, 2, 2, 2) in an image of that size, evenly, at least two an edge."""
    page = PageSize.of(size)
    length = np.linalg.norm((seams[:, :, 1] - seams[:, :, 0]) * page, axis=2).max(axis=1, initial=0.0)
    edge, place = _along(length)
    uv = seams[edge, :, 0] + place[:, None, None] * (seams[edge, :, 1] - seams[edge, :, 0])
    sides = [footprint(uv[:, side], page) for side in (0, 1)]
    texel = np.concatenate([side[0] for side in sides], axis=1)
    return SeamSamples(texel, np.concatenate([sides[0][1], -sides[1][1]], axis=1))


def footprint(uv: NDArray[np.float64], size: Size | PageSize) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """(s, 4) flat texels and their bilinear weights at uv (s, 2), v up; the image's rim is repeated outwards."""
    width, height = PageSize.of(size)
    x, y = uv[:, 0] * width - 0.5, (1.0 - uv[:, 1]) * height - 0.5
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    across, down = x - left, y - top
    columns = [np.clip(left + i, 0, width - 1) for i in (0, 1)]
    rows = [np.clip(top + i, 0, height - 1) for i in (0, 1)]
    texel = np.stack([row * width + column for row in rows for column in columns], axis=1)
    weight = np.stack([a * b for a in (1.0 - down, down) for b in (1.0 - across, across)], axis=1)
    return texel, weight


def seam_error(texture: Texture, samples: SeamSamples) -> SeamError | None:
    """How far the sides differ in a texture; None without seams.

    The range is 1 or 2 where the map has one, else that of the texels at the seams.
    """
    if len(samples.texel) == 0:
        return None
    pixels = texture.pixels
    whole = {"[0, 1]": 1.0, "[-1, 1]": 2.0}.get(texture.metadata.get("range", ""))
    if whole is None:
        near = pixels.reshape(-1, pixels.shape[2])[samples.texel]
        whole = max(float(np.ptp(near, axis=(0, 1)).max()), float(np.finfo(np.float32).tiny))
    error = np.abs(samples.differences(pixels)).max(axis=1) / whole
    return SeamError(float(error.max()), float(np.quantile(error, 0.99)), len(error))


def seam_report(atlas: Atlas, textures: Mapping[str, Texture]) -> dict[str, dict[str, float]]:
    """Map → "max" and "p99" of `seam_error`, for the maps that are one function on both sides of a seam.

    A value of at most 1/255 is less than one step of 8 bits.
    """
    seams, report = find_seams(atlas), {}
    for name, texture in textures.items():
        error = None
        if agrees_across_seams(name, texture.metadata.get("space", "")):
            error = seam_error(texture, sample_seams(seams, page_of(texture.pixels)))
        if error is not None:
            report[name] = {"max": error.maximum, "p99": error.p99}
    return report


def clean_mip(labels: NDArray[np.int32], atlas: Atlas) -> int:
    """The highest mip level at which bilinear samples on the borders of charts see their own chart alone.

    labels: (h, w) int32, the chart of each texel, gutters included, −1 beyond them.  Levels are halved by boxes,
    as long as both sides are even.  −1 where not even the full image is free of bleeding.
    """
    borders = _uv_borders(atlas)[1]
    ends = _border_uv(atlas, borders)
    edge, place = _along(np.linalg.norm((ends[:, 1] - ends[:, 0]) * page_of(labels), axis=1))
    uv = ends[edge, 0] + place[:, None] * (ends[edge, 1] - ends[edge, 0])
    chart, low, high, level = atlas.face_chart[borders[edge, 0]], labels, labels, -1
    while True:
        texel, weight = footprint(uv, page_of(low))
        own = (low.reshape(-1)[texel] == chart[:, None]) & (high.reshape(-1)[texel] == chart[:, None])
        if not (own | (weight < 1e-6)).all():
            return level
        level += 1
        height, width = low.shape
        if height % 2 or width % 2:
            return level
        blocks = (height // 2, 2, width // 2, 2)
        low, high = low.reshape(blocks).min(axis=(1, 3)), high.reshape(blocks).max(axis=(1, 3))


def _along(length: NDArray[np.floating]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """(s,) edge and place in (0, 1) of samples along edges of lengths (e,) in texels, evenly, at least two an edge."""
    count = np.maximum(np.ceil(PER_TEXEL * length), 2).astype(np.int64)
    edge = np.repeat(np.arange(len(length)), count)
    return edge, (np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[edge]

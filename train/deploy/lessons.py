"""What the deployed networks learn from: samples of a surface, each with what its neighbourhood knows.

n samples · f faces.   xyz in the unit ball; uv in chart coordinates.

Beside seams samples lie closer, and each knows the plane that parts the two sides of its seam: through the edge,
halfway between the two faces.  A slit is a seam too.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.geometry.topology import edge_table
from ...runtime.geometry.triangles import triangle_normals
from ..sampling import sample_surface, samples_in_faces
from .experts import Lesson

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Charts, Surface
    from .config import SampleConfig


class Spots(NamedTuple):
    """Places on a surface.  face (n,) int64; barycentric (n, 3); plane (n, 4): of the seam beside it, or NaN."""

    face: NDArray[np.int64]
    barycentric: NDArray[np.float64]
    plane: NDArray[np.float64]


class Seams(NamedTuple):
    """Seam edges, both sides: half (s, 2) half-edges 3·face + corner; start (s, 3), length (s,); plane (s, 4)."""

    half: NDArray[np.int64]
    start: NDArray[np.float64]
    length: NDArray[np.float64]
    plane: NDArray[np.float64]


def lesson_of(surface: Surface, charts: Charts, config: SampleConfig, rng: np.random.Generator) -> Lesson:
    """Uv and chart at samples of a surface in the unit ball."""
    face, barycentric, plane = spots_on(surface, charts, config, rng)
    triangles = surface.triangles
    corners, uv = np.take(triangles, face, axis=0), np.take(charts.corner_uv, face, axis=0)
    once = len(triangles) <= len(face)  # the slope of each face, or of each sample's
    return Lesson(
        x=np.einsum("nc,ncd->nd", barycentric, corners),
        y=np.einsum("nc,ncd->nd", barycentric, uv),
        label=charts.face_chart[face],
        slope=np.take(face_slopes(triangles, charts.corner_uv), face, axis=0) if once else face_slopes(corners, uv),
        plane=plane,
    )


def spots_on(surface: Surface, charts: Charts, config: SampleConfig, rng: np.random.Generator) -> Spots:
    """Evenly over the surface, some in each chart however small, and as many again beside seams."""
    even = sample_surface(surface, min(max(config.per_face * len(surface.faces), config.least), config.even), rng)
    few = np.flatnonzero(np.bincount(charts.face_chart[even.face], minlength=len(charts.method)) < config.fewest)
    faces = _faces_in(surface, charts, few, config.fewest, rng)
    more = samples_in_faces(surface, faces, rng)
    plain = len(even.face) + len(faces)
    spots = Spots(
        np.concatenate([even.face, more.face]),
        np.concatenate([even.barycentric, more.barycentric]),
        np.full((plain, 4), np.nan),
    )
    seams = seams_of(surface, charts)
    count = min(int(config.along * seams.length.sum()), config.beside)
    side = float(np.sqrt(surface.face_areas().sum() / len(charts.method)))
    near = beside_seams(surface, seams, count, config.reach * side, rng)
    return Spots(
        np.concatenate([spots.face, near.face]),
        np.concatenate([spots.barycentric, near.barycentric]),
        np.concatenate([spots.plane, near.plane]),
    )


def seams_of(surface: Surface, charts: Charts) -> Seams:
    """Edges between two charts, and slits: edges inside a chart whose two sides have other uv."""
    table = edge_table(surface.faces)
    half = table.edge_halfedges[table.edge_count >= 2]
    face, corner = half // 3, half % 3
    start, end = charts.corner_uv[face, corner], charts.corner_uv[face, (corner + 1) % 3]
    torn = (start[:, 0] != end[:, 1]).any(axis=1) | (end[:, 0] != start[:, 1]).any(axis=1)
    half = half[torn | (charts.face_chart[face[:, 0]] != charts.face_chart[face[:, 1]])]
    face, corner = half // 3, half[:, 0] % 3
    first = surface.vertices[surface.faces[face[:, 0]]]
    row = np.arange(len(half))
    origin, along = first[row, corner], first[row, (corner + 1) % 3] - first[row, corner]
    normal = np.cross(along, triangle_normals(surface.vertices[surface.faces[face]]).sum(axis=1))
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, size, out=np.full_like(normal, np.nan), where=size > 0.0)
    plane = np.concatenate([normal, -np.einsum("sd,sd->s", normal, origin)[:, None]], axis=1)
    return Seams(half, origin, np.linalg.norm(along, axis=1), plane)


def beside_seams(surface: Surface, seams: Seams, count: int, reach: float, rng: np.random.Generator) -> Spots:
    """Pairs of spots, one on each side of a seam, evenly along it and up to ``reach`` away; about ``count`` in all."""
    pairs = count // 2
    if pairs == 0 or not seams.length.sum() > 0.0:
        return Spots(np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 4)))
    cumulative = np.cumsum(seams.length)
    along = (np.arange(pairs) + rng.random(pairs)) / pairs * cumulative[-1]
    edge = np.repeat(np.searchsorted(cumulative, along).clip(max=len(cumulative) - 1), 2)
    half = seams.half[edge, np.tile([0, 1], pairs)]
    face, corner = half // 3, half % 3
    height = 2.0 * surface.face_areas()[face] / np.maximum(seams.length[edge], 1e-300)
    depth = np.minimum(rng.random(len(half)) * reach / np.maximum(height, 1e-300), 1.0)
    share = rng.random(len(half))
    barycentric = np.zeros((len(half), 3))
    for i, weight in enumerate(((1.0 - share) * (1.0 - depth), share * (1.0 - depth), depth)):
        barycentric[np.arange(len(half)), (corner + i) % 3] = weight
    return Spots(face, barycentric, seams.plane[edge])


def face_slopes(triangles: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """(f, m, d) how corner values (f, 3, m) change with position in triangles (f, 3, d): nothing across the plane.

    Zero for triangles too thin to say.
    """
    edges, ahead = triangles[:, 1:] - triangles[:, :1], values[:, 1:] - values[:, :1]
    first, second = edges[:, 0], edges[:, 1]
    a, b, c = (np.einsum("fd,fd->f", *pair) for pair in ((first, first), (first, second), (second, second)))
    determinant = a * c - b * b
    thin = determinant <= 1e-12 * (a + c) ** 2
    scale = np.where(thin, 0.0, 1.0 / np.where(thin, 1.0, determinant))[:, None]
    dual = np.stack([c[:, None] * first - b[:, None] * second, a[:, None] * second - b[:, None] * first], axis=1)
    return np.einsum("fim,fid->fmd", ahead, scale[:, None] * dual)


def _faces_in(
    surface: Surface, charts: Charts, chosen: NDArray[np.int64], count: int, rng: np.random.Generator
) -> NDArray[np.int64]:
    """``count`` random faces, by area, of each of the chosen charts."""
    wanted = np.flatnonzero(np.isin(charts.face_chart, chosen))
    wanted = wanted[np.argsort(charts.face_chart[wanted], kind="stable")]
    if len(wanted) == 0:
        return wanted
    chart = np.searchsorted(chosen, charts.face_chart[wanted])
    area = surface.face_areas()[wanted]
    total = np.bincount(chart, area, minlength=len(chosen))
    share = np.where(total[chart] > 0.0, area / np.where(total > 0.0, total, 1.0)[chart], 1.0 / len(wanted))
    share /= np.bincount(chart, share, minlength=len(chosen))[chart]
    cumulative = np.cumsum(share)
    target = np.repeat(np.arange(len(chosen)), count) + rng.random(len(chosen) * count)
    return wanted[np.searchsorted(cumulative, target, side="right").clip(max=len(wanted) - 1)]

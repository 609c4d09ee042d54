"""Metrics of a uv layout: distortion, seams, flips, overlap, coverage, texel density, bleeding.

f faces · e edges · k charts.  The surface is scaled into the unit ball (Frame: bounding-box centre, farthest vertex),
uv to the same total area; mirroring a chart changes none of the distortions.  σ₁ ≥ σ₂ are the singular values of the
affine map surface → uv of a face; 1, 1 = isometric.  Angles in radians.
Faces of the surface below 1e-14 area in the unit ball are left out of all means.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError, ShapeError
from ..mesh import Frame, Surface
from ..pagesize import PageSize
from .distortion import TRIM, singular_values, symmetric_dirichlet
from .gaps import smallest_chart_gap
from .overlap import orientation_sign, overlap_area, overlapping_pairs
from .topology import EdgeTable, edge_table, face_components, next_halfedge
from .triangles import corner_angles, edge_lengths, jacobians, signed_areas

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from ..pagesize import Size

_NO_AREA = 1e-14
_SAME_UV = 1e-6


@dataclass(frozen=True)
class Metrics:
    """What `measure` found.  All values are plain Python numbers.

    conformal_mean: mean over faces of the mean |angle − uv angle| of the three corners, radians.  0 is ideal.
    isometric_mean: mean over faces and edges of |length − uv length|, unit-ball lengths.  0 is ideal.
    equiareal_mean: mean over faces of |area − uv area|, unit-ball areas.  0 is ideal.
    symmetric_dirichlet_mean: area-weighted mean of (σ₁² + σ₂² + σ₁⁻² + σ₂⁻²) / 4, each face trimmed at
        100.  1 is ideal.
    stretch_l2: Sander's L² stretch, area-weighted root mean square singular value of uv → surface.  1 is ideal.
    stretch_linf: Sander's L∞ stretch, the largest singular value of uv → surface (at most 1e12).  1 is ideal.
    flipped_faces: faces whose exact orientation is opposite to the total of their chart.
    degenerate_uv_faces: faces of uv area ≤ 1e-12 of the mean (the surface's own degenerate faces are not counted).
    mirrored_charts: charts whose total signed uv area is negative: a picture on them reads backwards.
    overlap_fraction: area of all pairwise intersections of uv triangles / total uv area; 0 only if none
        intersect (exact).
    charts: number of charts.
    seam_length: length of interior surface edges whose uv differ / √(surface area).
    seam_edges: their number.
    packing_efficiency: uv triangle area, overlaps counted once, over the area of the square of uv `packing_square`.
    packing_square: "unit" where all uv lie in [0, 1]², otherwise "bounding": the square of the larger uv extent.
    texel_density_min, _mean, _max: texels per source unit of a face, √(texels / area); area-weighted mean.
        None without size.
    chart_gap_texels: smallest distance between two charts' outlines, to a texel and mostly exact.  None without size
        or with a single chart.
    bleed_free_mip: highest mip level whose texels don't mix two charts, ⌊log₂(gap / 2)⌋; −1 below a gap of two texels.
        None where chart_gap_texels is.
    """

    conformal_mean: float
    isometric_mean: float
    equiareal_mean: float
    symmetric_dirichlet_mean: float
    stretch_l2: float
    stretch_linf: float
    flipped_faces: int
    degenerate_uv_faces: int
    mirrored_charts: int
    overlap_fraction: float
    charts: int
    seam_length: float
    seam_edges: int
    packing_efficiency: float
    packing_square: str
    texel_density_min: float | None
    texel_density_mean: float | None
    texel_density_max: float | None
    chart_gap_texels: float | None
    bleed_free_mip: int | None

    def to_dict(self) -> dict[str, Any]:
        """Field name → number, text or None, ready for JSON."""
        return dataclasses.asdict(self)


def measure(
    surface: Surface,
    corner_uv: NDArray[np.float64],
    face_chart: NDArray[np.int64] | None = None,
    *,
    size: Size | None = None,
    stack: NDArray[np.int64] | None = None,
) -> Metrics:
    """All metrics of one uv layout.

    Args:
        surface: welded surface, f faces.
        corner_uv: (f, 3, 2) float64, finite, any units (uv of a page where size is given, whose form then counts).
        face_chart: (f,) int64 labels; None takes the charts that `uv_charts` finds.
        size: texels of the page, for texel densities and bleeding.
        stack: (f,) int64, the chart beneath each face where charts were laid on others on purpose: overlap, gap and
            packing efficiency are those of the lowest charts, whose faces name their own; None where all are.

    Raises:
        ShapeError: corner_uv or face_chart don't fit the surface.
        InputError: a uv is not finite, or the layout or the surface has no area.
    """
    _check(surface, corner_uv, face_chart)
    page = None if size is None else PageSize.of(size)
    even_uv, texels = (corner_uv, None) if page is None else (page.even(corner_uv), page.side)
    table = edge_table(surface.faces)
    found, seam = uv_charts(surface.faces, corner_uv, table)
    chart = found if face_chart is None else np.unique(face_chart, return_inverse=True)[1].reshape(-1)
    triangles, scaled_uv, area = _normalized(surface, even_uv)
    square, square_area = _square(corner_uv)
    lowest = np.flatnonzero(np.ones(len(chart), bool) if stack is None else stack == face_chart)
    pairs = lowest[overlapping_pairs(corner_uv[lowest])]
    shared = overlap_area(corner_uv, pairs)
    total_uv = float(np.abs(signed_areas(corner_uv[lowest])).sum())
    meets = bool(np.any(chart[pairs[:, 0]] != chart[pairs[:, 1]]))
    gap = _gap_texels(even_uv[lowest], chart[lowest], _outline(table, seam)[lowest], meets, texels)
    return Metrics(
        **_distortion_means(triangles, scaled_uv, area),
        **_orientation_counts(corner_uv, chart, area),
        **_texel_density(surface, even_uv, area, texels),
        overlap_fraction=shared / total_uv,
        charts=int(chart.max()) + 1,
        seam_length=_seam_length(surface, table.edges[seam]),
        seam_edges=int(seam.sum()),
        packing_efficiency=max(total_uv - shared, 0.0) / square_area,
        packing_square=square,
        chart_gap_texels=gap,
        bleed_free_mip=None if gap is None else bleed_free_mip(gap),
    )


def face_distortion(surface: Surface, corner_uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """(f,) float64 symmetric Dirichlet energy per face, 1 = isometric, trimmed at 100; normalized as in `measure`.

    Faces that have no area on the surface get 1.
    """
    _check(surface, corner_uv, None)
    triangles, scaled_uv, area = _normalized(surface, corner_uv)
    energy = np.ones(len(area))
    solid = area > _NO_AREA
    sigma = singular_values(jacobians(triangles[solid], scaled_uv[solid]))
    energy[solid] = np.minimum(symmetric_dirichlet(*sigma), TRIM)
    return energy


def uv_charts(
    faces: NDArray[np.int64], corner_uv: NDArray[np.float64], table: EdgeTable | None = None
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Charts and seams of a layout: two faces are joined along an edge where their uv agree to 1e-6 of the uv extent.

    Args:
        faces: (f, 3) int64 over welded vertices.
        corner_uv: (f, 3, 2) float64.
        table: ``edge_table(faces)`` where it is at hand.

    Returns:
        (f,) int64 chart labels numbered by the lowest face, and (e,) bool over the edge table: two faces of that edge
        disagree in uv.
    """
    table = table or edge_table(faces)
    tolerance = _SAME_UV * float(np.ptp(corner_uv.reshape(-1, 2), axis=0).max())
    seam = np.zeros(len(table.edges), dtype=bool)
    joined: list[NDArray[np.int64]] = []
    for one, other in _meeting_halfedges(table):
        same = _same_ends(faces.reshape(-1), corner_uv.reshape(-1, 2), one, other, tolerance)
        seam[table.face_edges.reshape(-1)[one[~same]]] = True
        joined.append(np.stack([one[same] // 3, other[same] // 3], axis=1))
    return face_components(len(faces), np.concatenate([np.zeros((0, 2), dtype=np.int64), *joined])), seam


def _meeting_halfedges(table: EdgeTable) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Pairs of half-edges (p,) and (p,) along one edge, each pair once."""
    half = table.edge_halfedges[table.edge_count == 2]
    yield half[:, 0], half[:, 1]
    half = np.flatnonzero((table.edge_count > 2)[table.face_edges.reshape(-1)])
    half = half[np.argsort(table.face_edges.reshape(-1)[half], kind="stable")]
    edge = table.face_edges.reshape(-1)[half]
    for step in range(1, int(table.edge_count.max(initial=1)) if len(half) else 1):
        together = edge[:-step] == edge[step:]
        yield half[:-step][together], half[step:][together]


def _same_ends(
    vertex: NDArray[np.int64],
    uv: NDArray[np.float64],
    one: NDArray[np.int64],
    other: NDArray[np.int64],
    tolerance: float,
) -> NDArray[np.bool_]:
    """(p,) bool: the uv (c, 2) of corners at both ends of two half-edges (p,) agree; vertex (c,) of each corner."""
    alike = vertex[one] == vertex[other]  # else they run against each other
    ahead = next_halfedge(other)
    begin, end = np.where(alike, other, ahead), np.where(alike, ahead, other)
    gap = np.abs(uv[one] - uv[begin]).max(axis=1, initial=0.0)
    return np.maximum(gap, np.abs(uv[next_halfedge(one)] - uv[end]).max(axis=1, initial=0.0)) <= tolerance


def bleed_free_mip(gap: float) -> int:
    """Highest mip level that keeps two charts `gap` texels apart from mixing: ⌊log₂(gap / 2)⌋, −1 below two texels."""
    return -1 if gap < 2.0 else math.floor(math.log2(gap / 2.0) + 1e-4)


def _check(surface: Surface, corner_uv: NDArray[np.float64], face_chart: NDArray[np.int64] | None) -> None:
    expected = (len(surface.faces), 3, 2)
    if corner_uv.shape != expected:
        raise ShapeError(f"corner_uv must be {expected}, one uv per face corner, got {corner_uv.shape}")
    if face_chart is not None and face_chart.shape != expected[:1]:
        raise ShapeError(f"face_chart must be {expected[:1]}, one label per face, got {face_chart.shape}")
    if not np.isfinite(corner_uv).all():
        raise InputError(f"{(~np.isfinite(corner_uv)).sum()} uv values are not finite; unwrap the mesh again")
    if not np.abs(signed_areas(corner_uv)).sum() > 0.0:
        raise InputError("the uv layout has no area: all uv triangles are degenerate; unwrap the mesh again")


def _normalized(
    surface: Surface, corner_uv: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Unit-ball triangles (f, 3, 3), uv (f, 3, 2) scaled to their total area, and unit-ball face areas (f,)."""
    ball = Surface(Frame.of(surface.vertices).apply(surface.vertices), surface.faces)
    area = ball.face_areas()
    scale = math.sqrt(area.sum() / np.abs(signed_areas(corner_uv)).sum())
    return ball.triangles, corner_uv * scale, area


def _distortion_means(
    triangles: NDArray[np.float64], uv: NDArray[np.float64], area: NDArray[np.float64]
) -> dict[str, Any]:
    solid = area > _NO_AREA
    triangles, uv, area = triangles[solid], uv[solid], area[solid]
    large, small = np.maximum(singular_values(jacobians(triangles, uv)), 1e-12)
    weight = area / area.sum()
    return {
        "conformal_mean": float(np.abs(corner_angles(triangles) - corner_angles(uv)).mean()),
        "isometric_mean": float(np.abs(edge_lengths(triangles) - edge_lengths(uv)).mean()),
        "equiareal_mean": float(np.abs(area - np.abs(signed_areas(uv))).mean()),
        "symmetric_dirichlet_mean": float((weight * np.minimum(symmetric_dirichlet(large, small), TRIM)).sum()),
        "stretch_l2": math.sqrt(float((weight * (large**-2 + small**-2)).sum()) / 2.0),
        "stretch_linf": float((1.0 / small).max()),
    }


def _orientation_counts(
    corner_uv: NDArray[np.float64], chart: NDArray[np.int64], area: NDArray[np.float64]
) -> dict[str, Any]:
    signed = signed_areas(corner_uv)
    total = np.bincount(chart, signed)
    sign = orientation_sign(corner_uv[:, 0], corner_uv[:, 1], corner_uv[:, 2])
    solid = area > _NO_AREA
    opposite = sign * np.where(total < 0.0, -1, 1)[chart] < 0
    return {
        "flipped_faces": int((opposite & solid).sum()),
        "degenerate_uv_faces": int(((np.abs(signed) <= 1e-12 * np.abs(signed).mean()) & solid).sum()),
        "mirrored_charts": int((total < 0.0).sum()),
    }


def _seam_length(surface: Surface, edges: NDArray[np.int64]) -> float:
    """Length of edges (e, 2) in space, over √area."""
    lengths = np.linalg.norm(np.diff(surface.vertices[edges], axis=1)[:, 0], axis=1)
    return float(lengths.sum() / math.sqrt(surface.face_areas().sum()))


def _square(corner_uv: NDArray[np.float64]) -> tuple[str, float]:
    """Which square the layout is packed into, and its area."""
    if corner_uv.min() >= -_SAME_UV and corner_uv.max() <= 1.0 + _SAME_UV:
        return "unit", 1.0
    return "bounding", float(np.ptp(corner_uv.reshape(-1, 2), axis=0).max() ** 2)


def _texel_density(
    surface: Surface, corner_uv: NDArray[np.float64], area: NDArray[np.float64], size: int | None
) -> dict[str, Any]:
    names = ("texel_density_min", "texel_density_mean", "texel_density_max")
    if size is None:
        return dict.fromkeys(names)
    solid = area > _NO_AREA
    density = size * np.sqrt(np.abs(signed_areas(corner_uv))[solid] / surface.face_areas()[solid])
    mean = (density * area[solid]).sum() / area[solid].sum()
    return dict(zip(names, (float(density.min()), float(mean), float(density.max())), strict=True))


def _outline(table: EdgeTable, seam: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(f, 3) bool: edge i of the face lies on the outline of a chart."""
    return (seam | table.boundary)[table.face_edges]


def _gap_texels(
    corner_uv: NDArray[np.float64],
    chart: NDArray[np.int64],
    outline: NDArray[np.bool_],
    meets: bool,
    size: int | None,
) -> float | None:
    if size is None or chart.max() == 0:
        return None
    if meets:
        return 0.0
    segments = np.stack([corner_uv, np.roll(corner_uv, -1, axis=1)], axis=2)[outline]
    gap = smallest_chart_gap(segments, np.repeat(chart, outline.sum(axis=1)), spacing=1.0 / size)
    return None if gap is None else gap * size

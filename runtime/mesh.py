"""The data every folder shares: Asset → Surface → Charts → Atlas.

v welded vertices · n file vertices · f faces · k charts · p patches.  Positions: float64, units of the source file.
uv is v up; corner_uv (f, 3, 2) gives the uv of each corner of each face, which needs no decision on what is one vertex.
Face i is the same triangle in all four.  Arrays are read-only by convention: nothing is mutated after it is made.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from .brief import Brief
from .geometry.triangles import triangle_areas, triangle_cross, triangle_normals
from .pagesize import PageSize

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .io.gltf.document import Document
    from .io.obj.text import ObjText
    from .material import Material
    from .pagesize import Size


@dataclass(frozen=True, eq=False, repr=False)
class Surface(Brief):
    """A welded triangle surface: what sampling, training, finishing and metrics work on.

    vertices: (v, 3) float64, finite, each used by a face.
    faces: (f, 3) int64, no degenerate face; consistently oriented where that is possible.  Faces that lie on each other
    (second sides, copies) have vertices of their own at the same places.
    polygon: (f,) int64, the same for faces that were one polygon in the file; None where that isn't known.
    calm: (v, 3) float64, where the vertices would lie without the noise of a scanner; None where they show none.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    polygon: NDArray[np.int64] | None = None
    calm: NDArray[np.float64] | None = None

    @property
    def shape(self) -> Surface:
        """The same faces without noise; the surface itself where it shows none."""
        return self if self.calm is None else Surface(self.calm, self.faces, self.polygon)

    @property
    def triangles(self) -> NDArray[np.float64]:
        """(f, 3, 3) float64 corner positions."""
        return np.take(self.vertices, self.faces, axis=0)  # a quarter of the time of vertices[faces]

    def face_cross(self) -> NDArray[np.float64]:
        """(f, 3) float64 edge cross products: direction = face normal, length = twice the area."""
        return triangle_cross(self.triangles)

    def face_areas(self) -> NDArray[np.float64]:
        """(f,) float64 in source units squared."""
        return triangle_areas(self.triangles)

    def face_normals(self) -> NDArray[np.float64]:
        """(f, 3) float64 unit normals, right-handed (zero for a face of zero area)."""
        return triangle_normals(self.triangles)

    def part(self, rows: NDArray[np.int64]) -> tuple[Surface, NDArray[np.int64]]:
        """The faces rows (m,) by themselves, and which vertices (w,) theirs are, ascending; their polygons are lost."""
        used, index = np.unique(self.faces[rows], return_inverse=True)
        return Surface(self.vertices[used], index.reshape(-1, 3)), used


@dataclass(frozen=True)
class Frame:
    """Centre and scale that bring a surface into the unit ball: xyz_ball = (xyz − centre) / scale."""

    centre: tuple[float, float, float]
    scale: float

    @classmethod
    def of(cls, vertices: NDArray[np.float64]) -> Frame:
        """Frame of the bounding-box centre and the largest distance to it; vertices (v, 3)."""
        centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2.0
        scale = float(np.linalg.norm(vertices - centre, axis=1).max())
        x, y, z = centre.tolist()
        return cls(centre=(x, y, z), scale=scale if scale > 0.0 else 1.0)

    def apply(self, xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        """(…, 3) source units → (…, 3) unit ball."""
        return (xyz - np.asarray(self.centre)) / self.scale


@dataclass(frozen=True, eq=False, repr=False)
class Polygons(Brief):
    """What the triangles of a mesh were in its file.

    corner: (f, 3) int64, the place of each corner in the list of the corners of all polygons.  size: (p,) int64,
    corners of each polygon, in their order; some may have no triangle.
    """

    corner: NDArray[np.int64]
    size: NDArray[np.int64]

    @property
    def of_faces(self) -> NDArray[np.int64]:
        """(f,) int64: the polygon of each triangle."""
        return np.searchsorted(np.cumsum(self.size), self.corner[:, 0], side="right")

    @property
    def large(self) -> int:
        """How many have over three corners."""
        return int(np.count_nonzero(self.size > 3))


@dataclass(frozen=True, eq=False, repr=False)
class Stored(Brief):
    """Numbers that a file keeps with its vertices: positions (m, 3) as there, by name (m,) of any kind of number."""

    positions: NDArray[np.float64]
    values: dict[str, NDArray[Any]]


@dataclass(frozen=True, eq=False, repr=False)
class Asset(Brief):
    """A mesh file, cleaned: the file's own vertices (split as the file splits them) and the welded surface beneath.

    positions: (n, 3) float64.  faces: (f, 3) int64 into positions, the file's faces in its order, minus those dropped.
    weld: (n,) int64, the surface vertex of each file vertex.  surface: faces of it = weld[faces].
    normals: (n, 3) unit float64 or None.  colors: (n, 4) uint8 sRGB or None.  uv: (n, 2) float64 v up, or None.
    face_material: (f,) int64 into materials.  changes: what cleaning did, name → count, only non-zero entries.
    sha256: hex digest of the source file's bytes ("" when made in memory).  stem: base name for outputs.
    document: the scene that the mesh is the surface of, each of its meshes once; None for a file that holds nothing
    but a mesh.  part: (f,) int64, the part of it that each face is in; origin: (n,) int64, the vertex of that part that
    each file vertex is; both None without a document.  polygons: what the triangles were, None for a format of
    triangles.  obj: the text of an OBJ file.  smoothing: (f,) int64, the smoothing group of each face, 0 for a flat
    one; None where the file doesn't say.  unsplit: (n,) int64, the file's vertex that each is, where normals split
    some or the asset is a page of another.  whole: of a page, the surface of all pages together, which rays meet.
    stored: what a PLY file says of its vertices beside these.
    """

    positions: NDArray[np.float64]
    faces: NDArray[np.int64]
    weld: NDArray[np.int64]
    surface: Surface
    normals: NDArray[np.float64] | None = None
    colors: NDArray[np.uint8] | None = None
    uv: NDArray[np.float64] | None = None
    materials: tuple[Material, ...] = ()
    face_material: NDArray[np.int64] | None = None
    changes: dict[str, int] = field(default_factory=dict)
    sha256: str = ""
    stem: str = "mesh"
    part: NDArray[np.int64] | None = None
    origin: NDArray[np.int64] | None = None
    document: Document | None = None
    polygons: Polygons | None = None
    obj: ObjText | None = None
    smoothing: NDArray[np.int64] | None = None
    unsplit: NDArray[np.int64] | None = None
    whole: Surface | None = None
    stored: Stored | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Charts(Brief):
    """Finished charts, not packed: each flat in its own coordinates, in source units (uv area ≈ surface area).

    face_chart: (f,) int64 in [0, k).  corner_uv: (f, 3, 2) float64; inside a chart two faces are joined along an edge
    exactly when their corner uv are equal there.  face_patch: (f,) int64 in [0, p): the Unwrap-Net that answers for it.
    patch_chart: (p,) int64.  method: per chart how it became valid: "slim", "slit", "xatlas", "triangle"
    (one that float32 could not hold beside its neighbours), or "raw" (as learned, not valid).
    """

    face_chart: NDArray[np.int64]
    corner_uv: NDArray[np.float64]
    face_patch: NDArray[np.int64]
    patch_chart: NDArray[np.int64]
    method: tuple[str, ...]


@dataclass(frozen=True, eq=False, repr=False)
class Atlas(Brief):
    """Charts packed onto a page; vertices are split along seams, so it is what an engine loads.

    positions: (n, 3) float64.  faces: (f, 3) int64.  uv: (n, 2) float32 in [0, 1], v up, multiples of 2⁻²⁴ where
    `pack` made them, so that 1 − v is exact.  normals: (n, 3) float32 unit.
    face_chart: (f,) int64.  source_vertex: (n,) int64 into Asset.positions.
    size: texels of a square's side, or WIDTHxHEIGHT; 0 where unknown.  padding: texels kept free around each chart (so
    two charts are 2 × padding apart).
    placement: (k, 2, 3) float64, chart coordinates → atlas uv (on the page a similarity, same scale for all charts;
    rectangles that were asked to fill whole texels lose a part of a texel), or None when the uv came from elsewhere.
    stack: (k,) int64, the chart that each lies on where congruent charts share their place; None where none does.
    """

    positions: NDArray[np.float64]
    faces: NDArray[np.int64]
    uv: NDArray[np.float32]
    normals: NDArray[np.float32]
    face_chart: NDArray[np.int64]
    source_vertex: NDArray[np.int64]
    size: Size
    padding: int
    placement: NDArray[np.float64] | None = None
    stack: NDArray[np.int64] | None = None

    @property
    def corner_uv(self) -> NDArray[np.float64]:
        """(f, 3, 2) float64: the uv as written (float32 values)."""
        return self.uv[self.faces].astype(np.float64)

    @property
    def page(self) -> PageSize:
        """Width and height in texels."""
        return PageSize.of(self.size)

    @property
    def even_uv(self) -> NDArray[np.float64]:
        """(f, 3, 2) float64: the uv in sides of the page, in which shapes are what they are on it."""
        return self.page.even(self.corner_uv)

    @property
    def face_stack(self) -> NDArray[np.int64] | None:
        """(f,) int64 the chart beneath each face, its own where it lies lowest; None where no chart lies on another."""
        if self.stack is None:
            return None
        return np.append(self.stack, np.arange(len(self.stack), self.face_chart.max() + 1))[self.face_chart]


Report = dict[str, Any]

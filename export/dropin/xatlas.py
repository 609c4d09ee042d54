"""The interface of xatlas-python 0.0.11 over flexpara's charts: `import flexpara.xatlas as xatlas`.

Public face: `parametrize`, `export`, `Atlas`, `ChartOptions`, `PackOptions`, `Chart`, `ChartType`, and
`settings`, which xatlas lacks.  Indices are uint32, uv float32 in [0, 1]², v up; sizes and paddings in texels.
There is one square page.
Options that mean nothing here are taken, and said once in the log of "flexpara.xatlas".
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from enum import IntEnum
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.errors import FlexparaError, ShapeError
from ...runtime.process.deadline import Deadline
from .meshes import NOWHERE, Placed
from .page import LOG, Page, Waiting, Wanted, packed_page, parts_in_time, surface_part, uv_part
from .plainarrays import RefusedError, WrongTypeError, drawn, export, faces_of, rows

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Arrays = tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[np.float32]]

__version__ = "0.0.11"
__all__ = ["Atlas", "Chart", "ChartOptions", "ChartType", "PackOptions", "export", "parametrize", "settings"]


class NoSuchPartError(FlexparaError, IndexError):
    """A mesh, chart or page that the atlas has not."""


@dataclass
class Settings:
    """What xatlas has no words for.  Set its fields: the next `generate` reads them."""

    time_budget: float | None = 60.0
    """Seconds that `generate` should take, packing included: the search ends in time for it.  None: no limit."""
    charts: int = 8
    """The most charts that each connected part may get, unless more are needed to keep its stretch low."""
    seed: int = 0
    """Start of all random numbers."""


settings = Settings()
"""In force in this process."""


class ChartType(IntEnum):
    """How xatlas found a chart; ours are all LSCM, its word for charts that are curved."""

    Planar = 0
    Ortho = 1
    LSCM = 2
    Piecewise = 3
    Invalid = 4

    def __str__(self) -> str:
        """As xatlas prints it."""
        return f"ChartType.{self.name}"


@dataclass(frozen=True, eq=False)
class Chart:
    """A chart of a mesh: its faces (m,) uint32."""

    faces: NDArray[np.uint32]
    atlas_index: int = 0
    material: int = 0
    type: ChartType = ChartType.LSCM


@dataclass(slots=True, eq=False)
class ChartOptions:
    """Nothing of it is used: flexpara weighs charts in another way.  See `settings`."""

    fix_winding: bool = False
    max_boundary_length: float = 0.0
    max_chart_area: float = 0.0
    max_cost: float = 2.0
    max_iterations: int = 1
    normal_deviation_weight: float = 2.0
    normal_seam_weight: float = 4.0
    roundness_weight: float = 0.01
    straightness_weight: float = 6.0
    texture_seam_weight: float = 0.5
    use_input_mesh_uvs: bool = False


@dataclass(slots=True, eq=False)
class PackOptions:
    """The page.  blockAlign, bruteForce, max_chart_size and the two of rotation are not used."""

    bilinear: bool = True
    """Keep at least one texel free around each chart."""
    blockAlign: bool = False  # noqa: N815
    bruteForce: bool = False  # noqa: N815
    create_image: bool = False
    """Draw `Atlas.chart_image`."""
    max_chart_size: int = 0
    padding: int = 0
    """Texels kept free around each chart: two are twice as far apart."""
    resolution: int = 0
    """Texels of the side; 0: what texels_per_unit needs, or 1024."""
    rotate_charts: bool = True
    rotate_charts_to_axis: bool = True
    texels_per_unit: float = 0.0
    """Least texel density; 0: as much as the page holds, which it is anyway where resolution is given."""


USED = {"bilinear", "create_image", "padding", "resolution", "texels_per_unit"}


@cache
def say_once(text: str) -> None:
    """A line in the log, the first time."""
    LOG.warning("%s", text)


def _say_unused(options: ChartOptions | PackOptions) -> None:
    for field in fields(options):
        if field.name not in USED and getattr(options, field.name) != field.default:
            say_once(f"{type(options).__name__}.{field.name} means nothing to flexpara and is not used")


class Atlas:
    """Meshes on one page.  Until `generate` it holds none, as with xatlas."""

    def __init__(self) -> None:
        self._waiting: list[Waiting] = []
        self._materials: list[NDArray[np.int64] | None] = []
        self._page: Page | None = None
        self._image: NDArray[np.uint8] | None = None

    def add_mesh(
        self, positions: ArrayLike, indices: ArrayLike, normals: ArrayLike | None = None, uvs: ArrayLike | None = None
    ) -> None:
        """Add positions (n, 3) and faces (f, 3).

        Raises: ShapeError (a ValueError); RefusedError (a RuntimeError) for faces beyond the vertices.
        """
        points = rows("Position", positions, 3)
        for name, given, columns in (("Normal", normals, 3), ("Texture coordinate", uvs, 2)):
            if given is not None:
                rows(name, given, columns, len(points))
                say_once(f"{name}s given to add_mesh mean nothing to flexpara and are not used")
        faces = faces_of(indices, len(points))
        charted = partial(surface_part, points, faces)
        mesh = Waiting(len(faces), lambda deadline: charted(settings.charts, settings.seed, deadline))
        self._add(mesh, None)

    def add_uv_mesh(self, uvs: ArrayLike, indices: ArrayLike, face_materials: ArrayLike | None = None) -> None:
        """Add a layout uv (n, 2) to be packed anew; charts never join two materials (f,).  Mirrored charts are turned.

        Raises: as `add_mesh`.
        """
        uv = rows("Texture coordinate", uvs, 2)
        faces = faces_of(indices, len(uv))
        given = np.zeros(len(faces)) if face_materials is None else face_materials
        materials = np.asarray(given).astype(np.int64).reshape(-1)
        if len(materials) != len(faces):
            raise ShapeError(f"Material array has {len(materials)} elements, expected {len(faces)}, one for each face")
        self._add(Waiting(0, lambda _: uv_part(uv, faces, materials)), materials)

    def _add(self, mesh: Waiting, materials: NDArray[np.int64] | None) -> None:
        if self._materials and (self._materials[0] is None) != (materials is None):
            raise RefusedError("Adding mesh failed: meshes and uv meshes can't be added to the same atlas")
        self._waiting.append(mesh)
        self._materials.append(materials)

    def generate(
        self,
        chart_options: ChartOptions | None = None,
        pack_options: PackOptions | None = None,
        verbose: bool = False,
    ) -> None:
        """Chart all meshes and pack them, within `settings.time_budget`.  verbose: say so in the log.

        Raises: WrongTypeError (a TypeError) for options that are none.
        """
        chosen = pack_options or PackOptions()
        for options, kind in ((chart_options or ChartOptions(), ChartOptions), (chosen, PackOptions)):
            if not isinstance(options, kind):
                raise WrongTypeError(f"options are {type(options).__name__}, expected {kind.__name__} of this module")
            _say_unused(options)
        deadline = Deadline(settings.time_budget)
        parts = parts_in_time(self._waiting, settings.time_budget)
        padding = max(int(chosen.padding), 1 if chosen.bilinear else 0)
        density = float(chosen.texels_per_unit)
        wanted = Wanted(int(chosen.resolution), density if 0.0 < density < math.inf else 0.0, padding)
        self._page = packed_page(parts, wanted, settings.seed, deadline) if parts else None
        draws = self._page is not None and self._page.side > 0 and chosen.create_image
        self._image = drawn(self._page.meshes, self._page.side) if self._page is not None and draws else None
        if deadline.passed():
            faces = sum(mesh.faces for mesh in self._waiting)
            LOG.warning(
                "%d faces took longer than the %g s asked for: reading, laying flat and packing alone do",
                faces,
                deadline.seconds,
            )
        if verbose:
            LOG.warning("%d meshes, %d charts, %d texels", len(self), self.chart_count, self.width)

    def get_mesh(self, mesh_index: int) -> Arrays:
        """Mapping (m,) into the vertices added, faces (f, 3) in their order, uv (m, 2).

        Raises: NoSuchPartError (an IndexError), as all that takes a number.
        """
        mesh = self._mesh(mesh_index)
        return mesh.mapping, mesh.faces, mesh.uv

    def __getitem__(self, mesh_index: int) -> Arrays:
        return self.get_mesh(mesh_index)

    def __len__(self) -> int:
        return self.mesh_count

    def get_mesh_vertex_assignment(self, mesh_index: int) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
        """Page (m,) and chart (m,) of each vertex, 2³² − 1 for one of none."""
        chart = self._mesh(mesh_index).vertex_chart()
        return np.where(chart == NOWHERE, chart, 0).astype(np.uint32), chart

    def get_mesh_chart_count(self, mesh_index: int) -> int:
        """Charts of a mesh."""
        return len(self._charts_of(mesh_index))

    def get_mesh_chart(self, mesh_index: int, chart_index: int) -> Chart:
        """One of them."""
        numbers, materials = self._charts_of(mesh_index), self._materials[mesh_index]
        if not 0 <= chart_index < len(numbers):
            raise NoSuchPartError(f"Chart index {chart_index} out of bounds for mesh with {len(numbers)} charts.")
        faces = np.flatnonzero(self._mesh(mesh_index).face_chart == numbers[chart_index])
        return Chart(faces.astype(np.uint32), material=0 if materials is None else int(materials[faces[0]]))

    def get_utilization(self, atlas_index: int) -> float:
        """Share of a page that charts cover."""
        return self._require(atlas_index).utilization

    def get_chart_image(self, atlas_index: int) -> NDArray[np.uint8]:
        """A page's charts (h, w, 3) in colours; row 0 is v = 0, as with xatlas.  PackOptions.create_image draws it."""
        self._require(atlas_index)
        if self._image is None:
            raise RefusedError("The atlas does not have an image.")
        return self._image

    @property
    def chart_image(self) -> NDArray[np.uint8]:
        """Of the first page."""
        return self.get_chart_image(0)

    @property
    def utilization(self) -> float:
        """Of the first page."""
        return self.get_utilization(0)

    @property
    def mesh_count(self) -> int:
        """Meshes on the page."""
        return 0 if self._page is None else len(self._page.meshes)

    @property
    def atlas_count(self) -> int:
        """Pages."""
        return 0 if self._page is None or self._page.side == 0 else 1

    @property
    def chart_count(self) -> int:
        """Charts of all meshes."""
        return 0 if self._page is None else self._page.charts

    @property
    def width(self) -> int:
        """Texels."""
        return 0 if self._page is None else self._page.side

    @property
    def height(self) -> int:
        """Texels."""
        return self.width

    @property
    def texels_per_unit(self) -> float:
        """Texels per unit of the positions."""
        return 0.0 if self._page is None else self._page.texels_per_unit

    def _mesh(self, number: int) -> Placed:
        meshes = [] if self._page is None else self._page.meshes
        if not 0 <= number < len(meshes):
            raise NoSuchPartError(f"Mesh index {number} out of bounds for atlas with {len(meshes)} meshes.")
        return meshes[number]

    def _charts_of(self, number: int) -> list[int]:
        return [chart for chart in np.unique(self._mesh(number).face_chart).tolist() if chart >= 0]

    def _require(self, number: int) -> Page:
        if self._page is None or not 0 <= number < self.atlas_count:
            raise NoSuchPartError(f"Atlas index {number} out of bounds.")
        return self._page


def parametrize(
    positions: ArrayLike, indices: ArrayLike, normals: ArrayLike | None = None, uvs: ArrayLike | None = None
) -> Arrays:
    """Unwrap positions (n, 3) with faces (f, 3): mapping (m,) into positions, faces (f, 3), uv (m, 2).

    Raises: as `Atlas.add_mesh`.
    """
    atlas = Atlas()
    atlas.add_mesh(positions, indices, normals, uvs)
    atlas.generate()
    return atlas.get_mesh(0)

"""Edges of a mesh that are to be seams whatever that costs: borders that it has already, hard edges, cuts by hand.

f faces · e edges of the edge table of asset.surface, in whose order masks are.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial import KDTree

from ...errors import InputError, MissingFileError
from ...geometry.cutgraph import path_mask, shortest_paths, trace_back
from ...geometry.topology import edge_table
from .facevalues import face_values
from .sameuv import uv_of_same
from .shading import ALIKE, shaded

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...geometry.topology import EdgeTable
    from ...mesh import Asset
    from ...options.seams import SeamOptions

UV_ALIKE = 1e-6
"""Distance of uv up to which two corners lie at one place."""


class WantedSeams(NamedTuple):
    """cut: (e,) bool, edges that are to be seams.  protected: (f,) how much seams keep away from a face, 0 to 1.

    important: (f,) how much a face asks for more texels, 0 to 1.

    start: (f, 3, 2) uv of an atlas to improve.  Each is None where nothing is asked for.
    """

    cut: NDArray[np.bool_] | None = None
    protected: NDArray[np.float64] | None = None
    important: NDArray[np.float64] | None = None
    start: NDArray[np.float64] | None = None


NO_WISH = WantedSeams()


def wanted_seams(asset: Asset, options: SeamOptions, crease_angle: float) -> WantedSeams:
    """What options ask of the seams of a mesh.

    Args:
        asset: the mesh as it was read, or shaded.
        options: which borders stay, a file of cuts, what to keep away from and what is important, and an atlas.
        crease_angle: degrees above which an edge is hard, where the file has neither normals nor smoothing groups.

    Raises: InputError for uv that the mesh does not have, a file of cuts that is none, or an atlas of another mesh;
    MissingFileError.
    """
    table = edge_table(asset.surface.faces)
    found = np.zeros(len(table.edges), dtype=bool)
    for name in options.kept:
        found |= torn(table, values_of(asset, name, crease_angle), UV_ALIKE if name == "uv" else ALIKE)
    if options.cut is not None:
        found |= cuts_of(asset, table, Path(options.cut))
    protected, important = (
        None if source is None else face_values(asset, Path(source)) for source in (options.protect, options.importance)
    )
    start = None if options.start is None else uv_of_same(asset, Path(options.start))
    return WantedSeams(found if options.kept or options.cut is not None else None, protected, important, start)


def values_of(asset: Asset, name: str, crease_angle: float) -> NDArray[np.float64]:
    """(f, 3, c) what the corners of faces have, which differs across a seam of that kind: "uv", "hard", "material"."""
    if name == "uv":
        if asset.uv is None:
            raise InputError("keep-seams uv of a mesh without uv, expected a mesh that has them; leave it out")
        return asset.uv[asset.faces]
    if name == "hard":
        whole = shaded(asset, crease_angle)
        assert whole.normals is not None
        return whole.normals[whole.faces].astype(np.float64)
    material = np.zeros(len(asset.faces)) if asset.face_material is None else asset.face_material.astype(np.float64)
    return np.repeat(material[:, None, None], 3, axis=1)


def torn(table: EdgeTable, corner: NDArray[np.float64], alike: float) -> NDArray[np.bool_]:
    """(e,) bool: manifold edges whose two faces do not hold the same (f, 3, c) at both ends."""
    values = corner.reshape(len(corner) * 3, -1)
    first, second = np.maximum(table.edge_halfedges, 0).T
    ahead = np.arange(len(values)) // 3 * 3 + (np.arange(len(values)) + 1) % 3
    apart = np.abs(values[first] - values[ahead[second]]).max(axis=1) > alike
    apart |= np.abs(values[ahead[first]] - values[second]).max(axis=1) > alike
    return table.manifold & apart


def cuts_of(asset: Asset, table: EdgeTable, path: Path) -> NDArray[np.bool_]:
    """(e,) bool: the edges on the shortest ways between the two points of each line of a file, by nearest vertices."""
    points = asset.surface.vertices
    ends = np.reshape(KDTree(points).query(read_cuts(path))[1], (-1, 2))
    apart = points[table.edges]
    length = np.maximum(np.linalg.norm(apart[:, 1] - apart[:, 0], axis=1), 1e-300)
    ways = []
    for start, end in ends.tolist():
        tree = shortest_paths(len(points), table.edges, length, np.array([start]))
        if start == end or not np.isfinite(tree.distance[end]):
            raise InputError(f"{path} has a cut that joins no two vertices of one part; correct its points")
        ways.append(trace_back(tree.parent, end))
    return path_mask(table, ways)


def read_cuts(path: Path) -> NDArray[np.float64]:
    """(c, 2, 3) the ends of each cut: six numbers a line, empty lines and what follows # left out."""
    if not path.is_file():
        raise MissingFileError(f"{path} is no file, expected lines of six numbers, two points of each cut; correct it")
    rows = [line.split("#")[0].replace(",", " ").split() for line in path.read_text(encoding="utf-8").splitlines()]
    rows = [row for row in rows if row]
    try:
        values = np.array(rows, dtype=np.float64)
    except ValueError as error:
        raise InputError(f"{path} holds other than six numbers a line ({error}); write x y z x y z") from error
    if values.ndim != 2 or values.shape[1] != 6 or not np.isfinite(values).all():
        raise InputError(f"{path} holds {values.shape} numbers, expected six finite ones a line; write x y z x y z")
    return values.reshape(-1, 2, 3)

"""Mesh file → Asset.

obj, ply, stl, off, 3mf and glTF have readers of their own; all else goes through trimesh.  Positions are float64 in the
units of the file; face i of the file is face i until cleaning drops some, polygons as triangles.  A file may come from
anyone: it reaches nothing outside its folder, no network, and no pickle.
"""

from __future__ import annotations

import hashlib
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError, MeshError, MissingFileError, ShapeError
from ..mesh import Asset
from .clean.clean import clean
from .formats.off import read_off
from .formats.stl import read_stl
from .formats.threemf import read_3mf
from .gltf.scene import read_gltf
from .limits import limits, raised
from .obj.read import read_obj
from .pictures.colors import as_rgba
from .pictures.pictures import read_in_folder
from .ply.read import read_ply
from .points.cloudfile import is_cloud
from .rawmesh import RawMesh, unit_vectors

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import trimesh
    from numpy.typing import ArrayLike, NDArray

    MeshLike = str | Path | trimesh.Trimesh | tuple[ArrayLike, ArrayLike]


def load_asset(path: Path, *, instances: bool = False, select: Sequence[str] = ()) -> Asset:
    """Read and clean a mesh file.

    Args:
        path: obj, ply, stl, glb, gltf, off, or another format that trimesh reads.
        instances: each mesh of a scene wherever it stands; otherwise once, with the scene as its document.
        select: names of nodes and meshes of a glTF scene, beyond which nothing is read; () is everything.

    Returns:
        The Asset; its changes say what cleaning did and what could not be kept.

    Raises:
        MissingFileError: nothing lies there.
        MeshError: no mesh, an unknown extension, damaged, empty, points only, not finite, all faces degenerate.
        MissingDependencyError: trimesh reads this format with a package that is absent.
    """
    if path.is_dir():
        raise MeshError(f"{path} is a folder, expected a mesh file; name the file in it")
    if not path.is_file():
        raise MissingFileError(f"{path} does not exist, expected a mesh file; check the path")
    most = limits().bytes
    if path.stat().st_size > most:
        raise MeshError(f"{path} has {path.stat().st_size} bytes, at most {most} are read; {raised('bytes')}")
    if is_cloud(path):
        raise MeshError(
            f"{path} holds points and no faces, expected triangles; flexpara unwrap takes point clouds, "
            "for all else give a triangle mesh"
        )
    data = path.read_bytes()
    if select and path.suffix.lower() not in (".glb", ".gltf"):
        raise MeshError(f"{path} with select, expected a glTF scene, whose parts have names; leave --select out")
    gltf = partial(read_gltf, data, path.parent, instances=instances, select=select)
    try:
        return clean(_read(data, path, gltf), stem=path.stem, sha256=hashlib.sha256(data).hexdigest())
    except InputError as error:
        raise MeshError(f"{path}: {error}") from error


def load(mesh: MeshLike, select: Sequence[str] = ()) -> Asset:
    """The mesh as an Asset, cleaned.  select: names of nodes and meshes of a glTF scene; () is everything.

    Raises: InputError when it is no mesh, or one with nothing to unwrap.
    """
    if isinstance(mesh, str | Path):
        return load_asset(Path(mesh), select=select)
    if isinstance(mesh, tuple):
        return asset_from_arrays(*mesh)
    visual: Any = mesh.visual
    colors = visual.vertex_colors if visual.kind == "vertex" else None
    return asset_from_arrays(mesh.vertices, mesh.faces, colors=colors, uv=getattr(visual, "uv", None))


def asset_from_arrays(
    positions: ArrayLike,
    faces: ArrayLike,
    *,
    normals: ArrayLike | None = None,
    colors: ArrayLike | None = None,
    uv: ArrayLike | None = None,
    stem: str = "mesh",
) -> Asset:
    """Clean a mesh that is already in memory.

    Args:
        positions: (n, 3) finite numbers, source units.
        faces: (f, 3) integers into positions.
        normals: (n, 3), made unit, or None.
        colors: (n, 3 or 4), uint8 sRGB, or float sRGB in [0, 1], or None.
        uv: (n, 2), v up, or None.
        stem: base name for outputs.

    Raises:
        ShapeError: an array of another shape or kind.
        MeshError: as load_asset.
    """
    points = _array("positions", positions, (3,), "iuf").astype(np.float64)
    corners = _array("faces", faces, (3,), "iu").astype(np.int64)
    count = len(points)
    raw = RawMesh(
        positions=points,
        faces=corners,
        normals=None
        if normals is None
        else unit_vectors(_array("normals", normals, (3,), "iuf", count).astype(np.float64)),
        colors=None if colors is None else as_rgba(_array("colors", colors, (3, 4), "uf", count)),
        uv=None if uv is None else _array("uv", uv, (2,), "iuf", count).astype(np.float64),
    )
    return clean(raw, stem=stem)


def _array(name: str, values: ArrayLike, columns: tuple[int, ...], kinds: str, rows: int | None = None) -> NDArray[Any]:
    array = np.asarray(values)
    right = array.ndim == 2 and array.shape[1] in columns and array.dtype.kind in kinds and rows in (None, len(array))
    if not right:
        expected = f"({'n' if rows is None else rows}, {' or '.join(map(str, columns))})"
        kind = "integers" if kinds == "iu" else "numbers"
        raise ShapeError(
            f"{name} has shape {array.shape} and dtype {array.dtype}, expected {expected} {kind}; convert it"
        )
    return array


def _read(data: bytes, path: Path, gltf: Callable[[], RawMesh]) -> RawMesh:
    kind, folder = path.suffix.lower().removeprefix("."), path.parent
    readers: dict[str, Callable[[], RawMesh]] = {
        "obj": lambda: read_obj(data, partial(read_in_folder, folder)),
        "ply": lambda: read_ply(data, partial(read_in_folder, folder)),
        "stl": lambda: read_stl(data),
        "off": lambda: read_off(data),
        "3mf": lambda: read_3mf(data),
        "glb": gltf,
        "gltf": gltf,
    }
    if kind in readers:
        return readers[kind]()
    from .formats.others import read_with_trimesh  # the formats above do without trimesh, whose import takes 0.6 s

    return read_with_trimesh(data, path)

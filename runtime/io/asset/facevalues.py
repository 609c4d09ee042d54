"""A value in [0, 1] for each face, from what a user names: points, a picture over the mesh's uv, or a vertex attribute.

f faces · n file vertices.  A face has the mean of what lies on it.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import KDTree

from ...errors import InputError, MissingFileError
from ..gltf.columns import primitive_columns
from ..pictures.pictures import decode_image

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from ...mesh import Asset

PICTURES = (".png", ".jpg", ".jpeg", ".webp")
CHANNELS = ("red", "green", "blue", "alpha")
"""Names of the channels of vertex colours."""
NEAR = 0.02
"""Distance from a point up to which it counts, as a share of the surface's extent."""
STEPS = 6
"""Samples of a picture along the side of a face."""


def face_values(asset: Asset, source: Path) -> NDArray[np.float64]:
    """(f,) values in [0, 1].

    Args:
        asset: the mesh.
        source: a .npy file of points (n, 3), within reach of which faces have 1; a picture, whose brightness counts,
            through the mesh's uv; or the name of a vertex attribute: a scalar of glTF or PLY, or red, green, blue,
            alpha of vertex colours.  Integers of 8 and 16 bits stand for [0, 1]; what lies beyond is cut off.

    Raises: InputError for what the mesh or file does not have; MissingFileError.
    """
    if source.suffix.lower() == ".npy":
        reach = NEAR * float(np.ptp(asset.surface.vertices, axis=0).max())
        return _near(asset.surface.triangles.mean(axis=1), read_points(source), reach)
    if source.suffix.lower() in PICTURES:
        return _of_picture(asset, source)
    return np.clip(vertex_values(asset, str(source)), 0.0, 1.0)[asset.faces].mean(axis=1)


def _near(places: NDArray[np.float64], points: NDArray[np.float64], reach: float) -> NDArray[np.float64]:
    if not len(points):
        return np.zeros(len(places))
    return (KDTree(points).query(places)[0] <= reach).astype(np.float64)


def _of_picture(asset: Asset, path: Path) -> NDArray[np.float64]:
    """(f,) mean brightness of a picture, sRGB as stored, at samples of each face; it repeats outside [0, 1]²."""
    if not path.is_file():
        raise MissingFileError(f"{path} is no file, expected a picture over the uv of the mesh; correct it")
    if asset.uv is None:
        raise InputError(f"{path} over a mesh without uv, expected one that has them; name a vertex attribute instead")
    pixels = decode_image(path.read_bytes())[:, :, :3].mean(axis=2) / 255.0
    high, wide = pixels.shape
    corner, total = asset.uv[asset.faces], np.zeros(len(asset.faces))
    weights = [(i + 1 / 3, j + 1 / 3, STEPS - i - j - 2 / 3) for i in range(STEPS) for j in range(STEPS - i)]
    for weight in weights:
        u, v = (np.einsum("fkc,k->fc", corner, np.array(weight) / STEPS) % 1.0).T
        total += pixels[((1.0 - v) * high).astype(np.int64) % high, (u * wide).astype(np.int64) % wide]
    return total / len(weights)


def vertex_values(asset: Asset, name: str) -> NDArray[np.float64]:
    """(n,) a vertex attribute of the file; 0 where parts of a scene lack it.

    Raises: InputError for one that the mesh does not have, or that is no scalar.
    """
    if name in CHANNELS and asset.colors is not None:
        return asset.colors[:, CHANNELS.index(name)] / 255.0
    if asset.stored is not None and name in asset.stored.values:
        nearest = KDTree(asset.stored.positions).query(asset.positions)[1]
        return _unit(asset.stored.values[name])[nearest]
    found, known = np.zeros(len(asset.positions)), False
    for vertices, values in _gltf_values(asset, name):
        found[vertices], known = values, True
    if not known:
        have = ", ".join(_names(asset)) or "none"
        raise InputError(
            f"{name!r} is no vertex attribute of {asset.stem}, which has {have}, nor a .npy file or picture; correct it"
        )
    return found


def _gltf_values(asset: Asset, name: str) -> Iterator[tuple[NDArray[np.int64], NDArray[np.float64]]]:
    """Vertices of the asset, and the attribute there, of each part of a scene that has it."""
    if asset.document is None or asset.part is None or asset.origin is None:
        return
    meshes = asset.document.file.tree["meshes"]
    for number in np.unique(asset.part).tolist():
        part = asset.document.parts[number]
        primitive = meshes[part.mesh]["primitives"][part.primitive]
        if name not in primitive["attributes"]:
            continue
        rows = primitive_columns(asset.document.file, primitive)[0][name].rows
        if rows.ndim == 2 and rows.shape[1] != 1:
            raise InputError(f"{name!r} has {rows.shape[1]} numbers a vertex, expected one; name another attribute")
        vertices = np.unique(asset.faces[asset.part == number])
        yield vertices, _unit(rows.reshape(-1))[asset.origin[vertices]]


def _names(asset: Asset) -> list[str]:
    """Attributes that can be named."""
    colors = [] if asset.colors is None else list(CHANNELS)
    stored = [] if asset.stored is None else list(asset.stored.values)
    tree = {"meshes": []} if asset.document is None else asset.document.file.tree
    primitives = [primitive for mesh in tree.get("meshes", []) for primitive in mesh["primitives"]]
    own = {name for primitive in primitives for name in primitive["attributes"] if name.startswith("_")}
    return [*stored, *sorted(own), *colors]


def _unit(values: NDArray[Any]) -> NDArray[np.float64]:
    """Values as numbers; integers of 8 and 16 bits by their greatest, what is not finite as 0."""
    small = values.dtype.kind in "ui" and values.dtype.itemsize <= 2
    found = values.astype(np.float64) / (np.iinfo(values.dtype).max if small else 1.0)
    return np.where(np.isfinite(found), found, 0.0)


def read_points(path: Path) -> NDArray[np.float64]:
    """(n, 3) the points of a .npy file.  Raises: InputError, MissingFileError."""
    if not path.is_file():
        raise MissingFileError(f"{path} is no file, expected a .npy file of points (n, 3); correct it")
    try:
        points = np.load(path, allow_pickle=False)
    except (ValueError, EOFError, OSError) as error:
        raise InputError(f"{path} can't be read ({error}), expected a .npy file of points (n, 3)") from error
    if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind not in "iuf" or not np.isfinite(points).all():
        raise InputError(f"{path} holds {points.dtype} {points.shape}, expected finite points (n, 3); save those")
    return points.astype(np.float64)

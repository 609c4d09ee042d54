"""The uv that another file gives to the triangles of a mesh, matched by where their corners lie.   f faces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from ...errors import InputError
from ..meshfile import load_asset

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ...mesh import Asset, Surface

NEAR = 1e-5
"""Distance, as a share of the mesh's extent, up to which two vertices are one: files round what they write."""


def uv_of_same(asset: Asset, path: Path) -> NDArray[np.float64]:
    """(f, 3, 2) uv of the mesh's corners in another file of the same triangles, in whatever order; it may have more.

    Raises: InputError for a file without uv or of other triangles; MissingFileError, MeshError as `load_asset`.
    """
    other = load_asset(path)
    if other.uv is None:
        raise InputError(f"{path} has no uv, expected an atlas to improve; give a mesh that has them")
    corner, corner_uv = matched(asset.surface, other.surface), other.uv[other.faces].reshape(-1, 2)
    lost = int((corner < 0).any(axis=1).sum())
    if lost:
        raise InputError(
            f"{lost} of {len(corner)} triangles of {asset.stem} are not in {path}, expected the same surface and "
            "triangulation; write the atlas from this very mesh, or unwrap the file that has the atlas"
        )
    if not np.isfinite(corner_uv).all():
        raise InputError(f"{path} has uv that are not finite, expected numbers; unwrap it anew")
    return corner_uv[corner]


def matched(surface: Surface, other: Surface) -> NDArray[np.int64]:
    """(f, 3) which corner of the other surface, counted through its faces, lies at each corner of this; −1 for none.

    Triangles that lie on each other are taken in their order.
    """
    places, place = np.unique(surface.vertices, axis=0, return_inverse=True)
    reach = NEAR * float(np.ptp(surface.vertices, axis=0).max())
    distance, nearest = KDTree(places).query(other.vertices)
    here, there = place.reshape(-1)[surface.faces], np.where(distance <= reach, nearest, -1)[other.faces]
    order, other_order = here.argsort(axis=1), there.argsort(axis=1)
    both = np.concatenate([np.take_along_axis(here, order, 1), np.take_along_axis(there, other_order, 1)])
    kind = np.unique(both, axis=0, return_inverse=True)[1].reshape(-1)
    row = like(kind[: len(here)], kind[len(here) :])
    found = np.zeros(here.shape, dtype=np.int64)
    np.put_along_axis(found, order, 3 * row[:, None] + other_order[row], axis=1)
    return np.where(row[:, None] < 0, -1, found)


def like(kind: NDArray[np.int64], other: NDArray[np.int64]) -> NDArray[np.int64]:
    """(n,) row of the other (m,) numbers that is equal, the second for the second of its kind; −1 for none.

    >>> like(np.array([7, 5, 7, 7]), np.array([7, 7, 5])).tolist()
    [0, 2, 1, -1]
    """
    most = len(kind) + len(other)
    own, rest = kind * most + nth_of_kind(kind), other * most + nth_of_kind(other)
    order = np.argsort(rest)
    row = order[np.minimum(np.searchsorted(rest, own, sorter=order), len(rest) - 1)]
    return np.where(rest[row] == own, row, -1)


def nth_of_kind(kind: NDArray[np.int64]) -> NDArray[np.int64]:
    """(n,) how many before each have its number."""
    order = np.argsort(kind, kind="stable")
    nth = np.zeros(len(kind), dtype=np.int64)
    nth[order] = np.arange(len(kind)) - np.searchsorted(kind[order], kind[order])
    return nth

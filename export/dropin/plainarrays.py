"""Arrays in and out of `flexpara.xatlas`: checked as xatlas checks them, written as OBJ, drawn as charts."""

from __future__ import annotations

import colorsys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image, ImageDraw

from ...runtime.errors import FlexparaError, InputError, ShapeError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from .page import Placed

GOLDEN = 0.618034
"""Step of the hue from chart to chart: no two of a hundred are alike."""


class RefusedError(FlexparaError, RuntimeError):
    """What xatlas refuses as well, with its words."""


class WrongTypeError(FlexparaError, TypeError):
    """What is no array, or no options."""


def converted(name: str, values: ArrayLike, kind: type[np.generic]) -> NDArray[Any]:
    """Values as an array of a kind, whatever numbers they are.

    Raises: WrongTypeError (a TypeError).
    """
    try:
        return np.asarray(values).astype(kind)
    except (TypeError, ValueError) as error:
        raise WrongTypeError(f"{name} array can't be read: {error}; pass an array of numbers") from error


def rows(name: str, values: ArrayLike, columns: int, count: int | None = None) -> NDArray[np.float64]:
    """Numbers (n, columns), n = count where that is given.

    Raises: ShapeError (a ValueError); WrongTypeError (a TypeError).
    """
    array = converted(name, values, np.float64)
    if array.ndim != 2 or array.shape[1] != columns:
        raise ShapeError(f"{name} array expected to be Nx{columns}, it is {array.shape}; reshape it")
    if count is not None and len(array) != count:
        raise ShapeError(
            f"{name} array has invalid number of elements in the first dimension (expected {count}, got {len(array)})"
        )
    return array


def faces_of(indices: ArrayLike, count: int) -> NDArray[np.int64]:
    """Faces (f, 3) into count vertices; without any, each three vertices in turn are one, as with xatlas.

    Raises: as `triples`; RefusedError (a RuntimeError) for faces beyond the vertices.
    """
    array = triples(indices)
    if len(array) == 0:
        return np.arange(count // 3 * 3).reshape(-1, 3)
    if array.max() >= count:
        raise RefusedError(f"Adding mesh failed: Index out of range, expected 0 to {count - 1}")
    return array


def triples(indices: ArrayLike) -> NDArray[np.int64]:
    """Indices (f, 3) as uint32 holds them: −1 is its largest number, 2³² is 0.

    Raises: ShapeError (a ValueError); WrongTypeError (a TypeError).
    """
    array = converted("Index", indices, np.int64)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ShapeError(f"Index array expected to be Nx3, it is {array.shape}; reshape it")
    return array % 2**32


def drawn(meshes: list[Placed], side: int) -> NDArray[np.uint8]:
    """The charts (side, side, 3), each in a colour of its own on black; row 0 is v = 0."""
    image = Image.new("RGB", (side, side))
    pen = ImageDraw.Draw(image)
    for mesh in meshes:
        corners = (mesh.uv[mesh.faces] * side).reshape(-1, 6)
        for chart, corner in zip(mesh.face_chart.tolist(), corners.tolist(), strict=True):
            if chart >= 0:
                red, green, blue = colorsys.hsv_to_rgb(chart * GOLDEN % 1.0, 0.6, 0.9)
                pen.polygon(corner, fill=(round(255 * red), round(255 * green), round(255 * blue)))
    return np.asarray(image)


def export(
    path: str | Path,
    positions: ArrayLike,
    indices: ArrayLike | None = None,
    uvs: ArrayLike | None = None,
    normals: ArrayLike | None = None,
) -> None:
    """Write an OBJ file of positions (n, 3), faces (f, 3), uv (n, 2), v up, and normals (n, 3).

    Faces beyond the vertices are written as they are, as xatlas does.

    Raises: ShapeError or InputError (both ValueErrors); WrongTypeError (a TypeError).
    """
    points = rows("Position", positions, 3).astype(np.float32)
    columns = {"v": points}
    if normals is not None:
        columns["vn"] = rows("Normal", normals, 3, len(points)).astype(np.float32)
    if uvs is not None:
        columns["vt"] = rows("Texture coordinate", uvs, 2, len(points)).astype(np.float32)
    lines = [" ".join([key, *(f"{value:.9g}" for value in row)]) for key, array in columns.items() for row in array]
    if indices is not None:
        texture, normal = "{0}" if uvs is not None else "", "/{0}" if normals is not None else ""
        corner = "{0}" if not texture and not normal else f"{{0}}/{texture}{normal}"
        faces = (triples(indices) + 1).tolist()
        lines += [" ".join(["f", *(corner.format(place) for place in face)]) for face in faces]
    try:
        Path(path).write_text("".join(f"{line}\n" for line in lines), encoding="ascii")
    except OSError as error:
        raise InputError(f"Cannot open path {path}: {error.strerror}; name a file in a folder that is there") from error

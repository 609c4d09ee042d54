"""Islands that stay: their faces together, their borders where they were, less distortion inside."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from flexpara.runtime.errors import InputError
from flexpara.runtime.geometry.triangles import signed_areas
from flexpara.runtime.mesh import Asset, Surface
from flexpara.train.charts.kept import kept_islands
from flexpara.train.config import TrainConfig

if TYPE_CHECKING:
    from numpy.typing import NDArray

CONFIG = TrainConfig().finish


def sheet(count: int, bend: float = 0.0) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """A grid of count² quads over the unit square, (v, 3), bent upwards; its triangles (f, 3)."""
    x, y = (plane.ravel() for plane in np.meshgrid(*[np.linspace(0, 1, count + 1)] * 2, indexing="ij"))
    start = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).ravel()
    a, b, c, d = start, start + count + 1, start + count + 2, start + 1
    return np.stack([x, y, bend * x * y], axis=1), np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def two_sheets(warp: float, *, mirrored: bool = False) -> Asset:
    """Two sheets side by side, each an island: the first warped in uv by so much, the second true, or mirrored."""
    flat, faces = sheet(6)
    positions = np.concatenate([flat, flat + np.array([2.0, 0.0, 0.0])])
    first = flat[:, :2] + warp * np.column_stack([np.sin(3 * flat[:, 1]), flat[:, 0] ** 2])
    second = flat[:, :2] * ((-1.0, 1.0) if mirrored else (1.0, 1.0)) + (3.0, 0.0)
    every = np.concatenate([faces, faces + len(flat)])
    surface = Surface(positions, every)
    return Asset(positions, every, np.arange(len(positions)), surface, uv=np.concatenate([first, second]))


def test_a_warped_sheet_is_laid_flat_and_the_other_stays() -> None:
    asset = two_sheets(0.2)
    before = kept_islands(two_sheets(0.0), CONFIG)
    found = kept_islands(asset, CONFIG)
    assert [len(piece.ids) for piece in found.pieces] == [72, 72]
    assert [piece.ids[0] for piece in found.pieces] == [0, 72]
    assert max(piece.energy for piece in before.pieces) < 1e-9
    assert found.pieces[0].energy < 1e-4
    assert found.pieces[1].energy < 1e-9
    assert found.notes == ()
    for piece in found.pieces:
        assert (signed_areas(piece.flat.uv[piece.flat.surface.faces]) > 0.0).all()
        assert piece.slit_length == 0.0


def test_no_border_edge_comes_in() -> None:
    """As many vertices as the island had: none was doubled."""
    found = kept_islands(two_sheets(0.2), CONFIG)
    assert [len(piece.flat.uv) for piece in found.pieces] == [49, 49]


def test_a_mirrored_island_is_turned_over() -> None:
    found = kept_islands(two_sheets(0.0, mirrored=True), CONFIG)
    uv = found.pieces[1].flat.uv[found.pieces[1].flat.surface.faces]
    assert (signed_areas(uv) > 0.0).all()


def test_an_island_that_lies_over_itself_stays_and_is_counted() -> None:
    asset = two_sheets(0.0)
    assert asset.uv is not None
    folded = asset.uv.copy()
    folded[:49, 0] = np.abs(folded[:49, 0] - 0.3)
    found = kept_islands(Asset(asset.positions, asset.faces, asset.weld, asset.surface, uv=folded), CONFIG)
    assert found.notes == ("1 islands overlap or are turned over in the file and are not relaxed",)


def test_uv_are_asked_for() -> None:
    asset = two_sheets(0.0)
    with pytest.raises(InputError, match="carries no uv"):
        kept_islands(Asset(asset.positions, asset.faces, asset.weld, asset.surface), CONFIG)

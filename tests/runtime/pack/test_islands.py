"""Islands of uv that a mesh has: their sizes, their shapes after packing, and what cannot be packed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flexpara.runtime.errors import InputError
from flexpara.runtime.geometry.metrics import measure, uv_charts
from flexpara.runtime.geometry.triangles import signed_areas
from flexpara.runtime.io.meshfile import asset_from_arrays
from flexpara.runtime.mesh import Asset
from flexpara.runtime.pack.config import IslandConfig
from flexpara.runtime.pack.islands import islands_of
from flexpara.runtime.pack.repack import repack
from flexpara.runtime.pack.square import Square

SQUARE = Square(256, 2)
QUAD = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)


def quads(*shapes: tuple[float, float, float]) -> Asset:
    """Flat rectangles side by side, of width, height, and so many uv units a unit; uv of all begin at (0, 0)."""
    positions, faces, uv = [], [], []
    for number, (width, height, density) in enumerate(shapes):
        flat = QUAD * (width, height)
        positions.append(np.column_stack([flat[:, 0] + 10.0 * number, flat[:, 1], np.zeros(4)]))
        faces.append(np.array([[0, 1, 2], [0, 2, 3]]) + 4 * number)
        uv.append(flat * density)
    return asset_from_arrays(np.concatenate(positions), np.concatenate(faces), uv=np.concatenate(uv))


def sides(asset: Asset, corner_uv: np.ndarray) -> list[tuple[float, float]]:
    """Extent in uv of each island, in the order of the faces; the longer side first."""
    island, _ = uv_charts(asset.surface.faces, corner_uv)
    extents = [np.ptp(corner_uv[island == number].reshape(-1, 2), axis=0) for number in range(island.max() + 1)]
    return [(float(extent.max()), float(extent.min())) for extent in extents]


def test_equal_density_gives_an_island_the_size_of_its_surface() -> None:
    asset = quads((2, 1, 0.1), (1, 1, 0.4))
    islands = islands_of(asset, equal=True, config=IslandConfig())
    area = np.bincount(islands.charts.face_chart, signed_areas(islands.charts.corner_uv))
    assert np.allclose(area, [2.0, 1.0])


def test_kept_density_keeps_sizes_beside_each_other() -> None:
    asset = quads((2, 1, 0.1), (1, 1, 0.4))
    islands = islands_of(asset, equal=False, config=IslandConfig())
    area = np.bincount(islands.charts.face_chart, signed_areas(islands.charts.corner_uv))
    assert np.isclose(area[1] / area[0], 16.0 / 2.0)
    assert np.isclose(area.sum(), 3.0)


@pytest.mark.parametrize(("equal", "wanted"), [(True, 1.0), (False, 4.0)])
def test_islands_keep_their_shape_and_lie_apart(equal: bool, wanted: float) -> None:
    asset = quads((2, 1, 0.1), (1, 1, 0.4), (1.5, 0.5, 0.1))
    found = repack(asset, SQUARE, equal=equal)
    uv = found.atlas.corner_uv
    (long, short), (one, other), (strip, thin) = sides(asset, uv)
    assert np.allclose([long / short, one / other, strip / thin], [2.0, 1.0, 3.0], rtol=1e-4)
    assert np.isclose(one / short, wanted, rtol=1e-4)
    gap = measure(asset.surface, uv, found.atlas.face_chart, size=256).chart_gap_texels
    assert gap is not None
    assert gap >= 4.0


def test_a_mirrored_island_stays_mirrored() -> None:
    asset = quads((2, 1, 0.1), (1, 1, 0.1))
    assert asset.uv is not None
    uv = asset.uv.copy()
    uv[4:, 0] *= -1.0
    found = repack(replace(asset, uv=uv), SQUARE)
    assert (signed_areas(found.atlas.corner_uv) > 0).tolist() == [True, True, False, False]


def test_islands_without_area_lie_in_a_point_and_are_counted() -> None:
    asset = quads((2, 1, 0.1), (1, 1, 0.0))
    found = repack(asset, SQUARE)
    assert found.report["changes"]["flat_islands"] == 1
    assert (found.atlas.corner_uv[2:] == 0.0).all()
    assert np.abs(signed_areas(found.atlas.corner_uv[:2])).sum() > 0.3


def test_an_island_folded_over_keeps_its_padding_along_the_fold() -> None:
    """Two quads that share an edge and lie on each other in uv, beside another island."""
    flat = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [-1, 0, 0], [-1, 1, 0], [5, 0, 0], [6, 0, 0], [5, 1, 0]]
    )
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 0, 3], [4, 3, 5], [6, 7, 8]])
    uv = np.column_stack([np.abs(flat[:, 0]), flat[:, 1]]) * 0.5
    uv[6:] = [[0, 0], [1, 0], [0, 1]]
    found = repack(asset_from_arrays(flat.astype(float), faces, uv=uv), SQUARE)
    folded, other = found.atlas.corner_uv[:4].reshape(-1, 2), found.atlas.corner_uv[4]
    assert found.report["changes"]["invalid_islands"] == 1
    low, high = folded.min(axis=0), folded.max(axis=0)
    outside = np.maximum(np.maximum(low - other, other - high), 0.0)
    assert np.linalg.norm(outside, axis=1).min() * 256 >= 3.99


def test_a_mesh_without_uv_area_is_refused() -> None:
    with pytest.raises(InputError, match="no area"):
        repack(quads((1, 1, 0.0)), SQUARE)
    with pytest.raises(InputError, match="no uv"):
        repack(replace(quads((1, 1, 0.1)), uv=None), SQUARE)

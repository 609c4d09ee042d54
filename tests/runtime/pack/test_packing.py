"""Packing: one square by hand, rectangles with exact gaps, similarities, determinism, meshes with uv, a real mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh
import xatlas

from flexpara.runtime.errors import FinishError, InputError
from flexpara.runtime.geometry.metrics import measure
from flexpara.runtime.geometry.overlap import overlapping_pairs
from flexpara.runtime.geometry.topology import edge_table, face_components
from flexpara.runtime.geometry.triangles import signed_areas
from flexpara.runtime.mesh import Asset, Atlas, Charts, Surface
from flexpara.runtime.pack.config import PackConfig
from flexpara.runtime.pack.growing.growth import apply_placement
from flexpara.runtime.pack.packing import atlas_from_uv, pack

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from flexpara.runtime.pagesize import Size

UNIT = np.array([[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]]])


def turn(angle: float) -> NDArray[np.float64]:
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


def rectangles(sides: NDArray[np.float64], angles: NDArray[np.float64]) -> tuple[Asset, Charts]:
    """Separate flat rectangles of sides (k, 2), each a chart that is the rectangle turned by its angle."""
    k = len(sides)
    flat = UNIT[None] * sides[:, None, None]
    uv = np.concatenate([part @ turn(angle) for part, angle in zip(flat, angles.tolist(), strict=True)])
    height = np.repeat(np.arange(k, dtype=np.float64), 6).reshape(-1, 3, 1)
    corners = np.concatenate([flat.reshape(-1, 3, 2), height], axis=2).reshape(-1, 3)
    vertices, weld = np.unique(corners, axis=0, return_inverse=True)
    surface = Surface(vertices, weld.reshape(-1, 3).astype(np.int64))
    chart = np.repeat(np.arange(k), 2)
    asset = Asset(vertices, surface.faces, np.arange(len(vertices)), surface)
    return asset, Charts(chart, uv, chart, np.arange(k), ("slim",) * k)


def box_charts(surface: Surface) -> Charts:
    """Charts of a closed mesh: connected faces with the same main normal direction, seen along it."""
    normals = surface.face_normals()
    main = np.abs(normals).argmax(axis=1)
    side = 2 * main + (normals[np.arange(len(normals)), main] < 0.0)
    table = edge_table(surface.faces)
    pairs = table.edge_faces[table.manifold]
    chart = face_components(len(side), pairs[side[pairs[:, 0]] == side[pairs[:, 1]]])
    kept = np.array([[1, 2], [2, 0], [0, 1]])[main]
    uv = np.take_along_axis(surface.triangles, kept[:, None, :], axis=2).astype(np.float64)
    uv[side % 2 == 1, :, 0] *= -1.0
    k = int(chart.max()) + 1
    return Charts(chart, uv, chart, np.arange(k), ("slim",) * k)


def packed(asset: Asset, charts: Charts, *, size: Size, padding: int, seed: int = 0) -> Atlas:
    """The atlas of charts that all come out valid."""
    found = pack(asset, charts, size=size, padding=padding, seed=seed)
    assert found.invalid.tolist() == []
    return found.atlas


def measured_gap(asset: Asset, atlas: Atlas) -> float:
    gap = measure(asset.surface, atlas.corner_uv, atlas.face_chart, size=atlas.size).chart_gap_texels
    assert gap is not None
    return gap


def assert_valid(asset: Asset, charts: Charts, atlas: Atlas) -> None:
    """What every packed atlas promises, whatever went in."""
    uv, extent = atlas.corner_uv, atlas.page.extent
    border = atlas.padding / np.array(atlas.page)
    assert np.array_equal(np.rint(uv * 2.0**24), uv * 2.0**24)
    assert (uv >= border).all()
    assert (uv <= 1.0 - border).all()
    assert len(overlapping_pairs(uv)) == 0
    assert np.array_equal(np.sign(signed_areas(uv)), np.sign(signed_areas(charts.corner_uv)))
    assert np.array_equal(atlas.source_vertex[atlas.faces], asset.faces)
    assert np.array_equal(atlas.positions[atlas.faces], asset.positions[asset.faces])
    assert atlas.placement is not None
    exact = apply_placement(atlas.placement, charts.face_chart, charts.corner_uv)
    assert np.abs(exact - uv).max() < 3e-7
    linear = atlas.placement[:, :, :2] * extent[:, None]
    scale = np.sqrt(np.linalg.det(linear))
    assert scale == pytest.approx(np.full(len(scale), scale[0]))
    assert linear @ linear.transpose(0, 2, 1) == pytest.approx(scale[:, None, None] ** 2 * np.eye(2)[None], abs=1e-12)


def test_one_square_fills_the_atlas_up_to_its_border() -> None:
    asset, charts = rectangles(np.ones((1, 2)), np.array([0.3]))
    atlas = packed(asset, charts, size=256, padding=4)
    assert_valid(asset, charts, atlas)
    lengths = np.sqrt(np.abs(signed_areas(atlas.corner_uv)).sum()) * 256
    assert lengths == pytest.approx(248.0, abs=0.01)


@pytest.mark.parametrize(("size", "padding"), [(256, 0), (256, 2), (1024, 8), (100, 3)])
def test_four_squares_lie_exactly_two_paddings_apart(size: int, padding: int) -> None:
    asset, charts = rectangles(np.ones((4, 2)), np.array([0.0, 0.3, 1.0, 2.5]))
    atlas = packed(asset, charts, size=size, padding=padding)
    assert_valid(asset, charts, atlas)
    assert measured_gap(asset, atlas) >= 2 * padding
    side = np.sqrt(np.abs(signed_areas(atlas.corner_uv)).sum() / 4.0) * size
    assert side == pytest.approx((size - 4 * padding) / 2.0, rel=0.01)


@pytest.mark.parametrize("size", [512, "1024x256"])
def test_charts_in_rows_keep_their_padding_and_one_scale(size: Size) -> None:
    rng = np.random.default_rng(3)
    asset, charts = rectangles(np.exp(rng.normal(size=(40, 2))), rng.uniform(0.0, 2.0 * np.pi, 40))
    found = pack(asset, charts, size=size, padding=2, config=PackConfig(hurried=True))
    assert len(found.invalid) == 0
    assert 4.0 <= measured_gap(asset, found.atlas) < 4.5
    ratio = np.abs(signed_areas(found.atlas.corner_uv * found.atlas.page)) / np.abs(signed_areas(charts.corner_uv))
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-3)


@pytest.mark.parametrize("seed", range(4))
def test_rectangles_of_all_sizes_keep_padding_scale_and_orientation(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 20))
    asset, charts = rectangles(rng.uniform(0.05, 1.0, (count, 2)), rng.uniform(0.0, 6.0, count))
    atlas = packed(asset, charts, size=512, padding=4, seed=seed)
    assert_valid(asset, charts, atlas)
    assert measured_gap(asset, atlas) >= 8.0


@pytest.mark.parametrize("size", ["512x256", "192x512", "1000x300"])
def test_a_page_that_is_not_square_is_filled_by_charts_of_one_scale_and_true_shape(size: str) -> None:
    rng = np.random.default_rng(1)
    asset, charts = rectangles(rng.uniform(0.1, 1.0, (12, 2)), rng.uniform(0.0, 6.0, 12))
    atlas = packed(asset, charts, size=size, padding=3)
    assert_valid(asset, charts, atlas)
    assert measured_gap(asset, atlas) >= 6.0 - 1e-4
    metrics = measure(asset.surface, atlas.corner_uv, atlas.face_chart, size=size)
    assert metrics.symmetric_dirichlet_mean == pytest.approx(1.0, abs=1e-6)
    density = [metrics.texel_density_min, metrics.texel_density_max]
    assert density == pytest.approx([density[0]] * 2, rel=1e-3)
    assert metrics.packing_efficiency > 0.6


def test_a_lone_chart_lies_along_the_longer_side_of_its_page() -> None:
    asset, charts = rectangles(np.array([[1.0, 2.0]]), np.array([0.4]))
    for size in ("512x256", "256x512"):
        atlas = packed(asset, charts, size=size, padding=0)
        assert float(np.abs(signed_areas(atlas.corner_uv)).sum()) == pytest.approx(1.0, abs=1e-4)


def test_many_charts_and_few_texels_still_keep_their_distance() -> None:
    rng = np.random.default_rng(0)
    asset, charts = rectangles(rng.uniform(0.1, 1.0, (60, 2)), np.zeros(60))
    atlas = packed(asset, charts, size=64, padding=1)
    assert_valid(asset, charts, atlas)
    assert measured_gap(asset, atlas) >= 2.0


def test_charts_of_very_different_size_share_one_scale() -> None:
    asset, charts = rectangles(np.array([[1.0, 1.0], [1e-5, 1e-5], [1.0, 1e-3]]), np.zeros(3))
    atlas = packed(asset, charts, size=512, padding=4)
    assert_valid(asset, charts, atlas)
    assert measured_gap(asset, atlas) >= 8.0


def test_the_same_seed_gives_the_same_bytes() -> None:
    rng = np.random.default_rng(5)
    asset, charts = rectangles(rng.uniform(0.1, 1.0, (7, 2)), rng.uniform(0.0, 6.0, 7))
    one, two = (packed(asset, charts, size=512, padding=4, seed=3) for _ in range(2))
    for name in ("positions", "faces", "uv", "normals", "source_vertex", "placement"):
        assert getattr(one, name).tobytes() == getattr(two, name).tobytes()


def test_a_slit_inside_a_chart_splits_its_vertices() -> None:
    asset, charts = rectangles(np.ones((1, 2)), np.zeros(1))
    uv = charts.corner_uv.copy()
    uv[1] += [-0.1, 0.2]
    slit = Charts(charts.face_chart, uv, charts.face_patch, charts.patch_chart, charts.method)
    atlas = packed(asset, slit, size=128, padding=2)
    assert len(atlas.uv) == 6
    assert_valid(asset, slit, atlas)


@pytest.mark.parametrize(
    ("size", "padding", "message"), [(0, 4, "size ≥ 1"), (64, -1, "padding ≥ 0"), (64, 20, "leave no room")]
)
def test_sizes_and_paddings_that_cannot_be_are_refused(size: int, padding: int, message: str) -> None:
    asset, charts = rectangles(np.ones((9, 2)), np.zeros(9))
    with pytest.raises(InputError, match=message):
        pack(asset, charts, size=size, padding=padding)


def test_charts_that_cannot_be_packed_are_named() -> None:
    asset, charts = rectangles(np.ones((2, 2)), np.zeros(2))
    broken = charts.corner_uv.copy()
    broken[0, 0, 0] = np.nan
    with pytest.raises(FinishError, match="not finite"):
        pack(
            asset, Charts(charts.face_chart, broken, *([charts.face_patch, charts.patch_chart, ()])), size=64, padding=1
        )
    with pytest.raises(FinishError, match="chart 0 has no face"):
        pack(
            asset,
            Charts(charts.face_chart + 1, charts.corner_uv, charts.face_patch, charts.patch_chart, ()),
            size=64,
            padding=1,
        )


def test_uv_of_a_file_become_an_atlas_as_they_are() -> None:
    box = trimesh.creation.box()
    positions = np.asarray(box.vertices, dtype=np.float64)[np.asarray(box.faces)].reshape(-1, 3)
    positions = np.concatenate([positions, [[9.0, 9.0, 9.0]]])
    faces = np.arange(36).reshape(-1, 3)
    surface = Surface(np.asarray(box.vertices, dtype=np.float64), np.asarray(box.faces, dtype=np.int64))
    uv = np.random.default_rng(0).random((37, 2))
    weld = np.append(surface.faces.reshape(-1), 0)
    atlas = atlas_from_uv(Asset(positions, faces, weld, surface, uv=uv))
    assert np.array_equal(atlas.corner_uv, uv.astype(np.float32)[faces])
    assert atlas.source_vertex.tolist() == list(range(36))
    assert (atlas.size, atlas.padding, atlas.placement) == (0, 0, None)
    assert atlas.face_chart.tolist() == list(range(12))


def test_a_mesh_without_uv_has_no_atlas() -> None:
    asset, _ = rectangles(np.ones((1, 2)), np.zeros(1))
    with pytest.raises(InputError, match="carries no uv"):
        atlas_from_uv(asset)


def xatlas_coverage(charts: Charts, size: int, padding: int) -> float:
    """What xatlas makes of the same charts: area over the square that holds its atlas."""
    atlas = xatlas.Atlas()
    indices = np.arange(charts.face_chart.size * 3, dtype=np.uint32).reshape(-1, 3)
    materials = charts.face_chart.astype(np.uint32).reshape(-1, 1)
    atlas.add_uv_mesh(charts.corner_uv.reshape(-1, 2).astype(np.float32), indices, materials)
    options = xatlas.PackOptions()
    options.resolution, options.padding = size, padding
    atlas.generate(pack_options=options)
    area = np.abs(signed_areas(charts.corner_uv)).sum()
    return float(area * atlas.texels_per_unit**2 / max(atlas.width, atlas.height) ** 2)


def test_fandisk_in_its_box_charts_covers_as_much_as_with_xatlas_alone(models: Path) -> None:
    mesh = trimesh.load_mesh(models / "fandisk.obj", process=False, skip_materials=True)
    vertices, weld = np.unique(np.asarray(mesh.vertices, dtype=np.float64), axis=0, return_inverse=True)
    surface = Surface(vertices, weld.reshape(-1)[np.asarray(mesh.faces)].astype(np.int64))
    charts = box_charts(surface)
    asset = Asset(vertices, surface.faces, np.arange(len(vertices)), surface)
    found = pack(asset, charts, size=1024, padding=4)
    assert len(found.invalid) <= 1  # seen along an axis, one chart of the real fandisk lies over itself
    atlas = found.atlas
    covered = measure(surface, atlas.corner_uv, atlas.face_chart, size=1024)
    assert covered.chart_gap_texels is not None
    assert covered.chart_gap_texels >= 8.0
    assert covered.packing_efficiency > 0.97 * xatlas_coverage(charts, 1024, 4)

"""Metrics: one triangle, closed forms on a grid, seams of a cube, then an independent evaluator on real meshes."""

from __future__ import annotations

import dataclasses
import importlib.util
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from flexpara.runtime.errors import InputError, ShapeError
from flexpara.runtime.geometry.metrics import bleed_free_mip, face_distortion, measure, uv_charts
from flexpara.runtime.mesh import Surface

EVALUATOR = Path(__file__).resolve().parents[4] / "shared" / "check" / "uveval.py"


def grid(n: int) -> Surface:
    axis = np.linspace(0.0, 1.0, n + 1)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    corner = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = corner[:-1, :-1].ravel(), corner[1:, :-1].ravel(), corner[1:, 1:].ravel(), corner[:-1, 1:].ravel()
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return Surface(np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], 1), faces)


def flat_uv(surface: Surface, matrix: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
    uv = surface.vertices[surface.faces][..., :2]
    return uv if matrix is None else uv @ matrix.T


def cube() -> tuple[Surface, NDArray[np.float64]]:
    """A cube whose six sides are charts in a 3 × 2 grid, gaps 0.1."""
    box = trimesh.creation.box()
    vertices, faces = np.asarray(box.vertices, dtype=np.float64), np.asarray(box.faces, dtype=np.int64)
    normal = np.rint(box.face_normals).astype(np.int64)
    axis, side = np.abs(normal).argmax(axis=1), (normal.sum(axis=1) > 0).astype(np.int64)
    kept = np.array([[1, 2], [2, 0], [0, 1]])[axis]
    uv = np.take_along_axis(vertices[faces], kept[:, None, :], axis=2) * 1.0
    uv[side == 0, :, 0] *= -1.0
    return Surface(vertices, faces), uv + 0.5 + np.stack([axis * 1.1, side * 1.1], axis=1)[:, None, :]


def test_a_similarity_has_no_distortion() -> None:
    surface = grid(4)
    turn = 3.0 * np.array([[0.8, -0.6], [0.6, 0.8]])
    found = measure(surface, flat_uv(surface, turn) + 5.0)
    for name in ("conformal_mean", "isometric_mean", "equiareal_mean"):
        assert getattr(found, name) == pytest.approx(0.0, abs=1e-12)
    for name in ("symmetric_dirichlet_mean", "stretch_l2", "stretch_linf"):
        assert getattr(found, name) == pytest.approx(1.0, abs=1e-12)
    assert (found.charts, found.seam_edges, found.flipped_faces, found.mirrored_charts) == (1, 0, 0, 0)


def test_a_stretch_by_four_has_the_closed_form() -> None:
    surface = grid(4)
    found = measure(surface, flat_uv(surface, np.diag([4.0, 1.0])))
    assert found.symmetric_dirichlet_mean == pytest.approx((4.0 + 0.25 + 0.25 + 4.0) / 4.0)
    assert found.stretch_l2 == pytest.approx(np.sqrt((4.0 + 0.25) / 2.0))
    assert found.stretch_linf == pytest.approx(2.0)
    assert found.equiareal_mean == pytest.approx(0.0, abs=1e-12)
    assert found.conformal_mean == pytest.approx(2.0 / 3.0 * (np.arctan(4.0) - np.pi / 4.0))


def test_a_vertex_pulled_across_its_fan_flips_triangles_and_overlaps() -> None:
    surface = grid(4)
    moved = surface.vertices[:, :2].copy()
    moved[6] += [-0.01, 0.26]
    found = measure(surface, moved[surface.faces])
    assert (found.charts, found.flipped_faces) == (1, 2)
    assert found.overlap_fraction > 0.0
    assert measure(surface, flat_uv(surface)).overlap_fraction == 0.0


def test_a_mirrored_chart_is_mirrored_and_not_flipped() -> None:
    surface = grid(4)
    found = measure(surface, flat_uv(surface, np.diag([-1.0, 1.0])))
    assert (found.mirrored_charts, found.flipped_faces) == (1, 0)
    assert found.symmetric_dirichlet_mean == pytest.approx(1.0)


def test_a_collapsed_triangle_is_degenerate() -> None:
    surface = grid(4)
    uv = flat_uv(surface).copy()
    uv[3] = uv[3, :1]
    assert measure(surface, uv).degenerate_uv_faces == 1


def test_two_layers_overlap_by_half() -> None:
    surface = grid(2)
    double = Surface(
        np.concatenate([surface.vertices, surface.vertices + np.array([0.0, 0.0, 1.0])]),
        np.concatenate([surface.faces, surface.faces + len(surface.vertices)]),
    )
    found = measure(double, flat_uv(double), size=64)
    assert found.overlap_fraction == pytest.approx(0.5)
    assert found.packing_efficiency == pytest.approx(1.0)
    assert (found.charts, found.chart_gap_texels, found.bleed_free_mip) == (2, 0.0, -1)


def test_a_cube_of_six_charts() -> None:
    surface, uv = cube()
    found = measure(surface, uv / 4.0, size=512)
    assert (found.charts, found.mirrored_charts, found.seam_edges) == (6, 0, 12)
    assert found.seam_length == pytest.approx(12.0 / np.sqrt(6.0))
    assert found.packing_square == "unit"
    assert found.packing_efficiency == pytest.approx(6.0 / 16.0)
    assert found.texel_density_min == pytest.approx(128.0)
    assert found.texel_density_max == pytest.approx(128.0)
    assert found.chart_gap_texels == pytest.approx(12.8)
    assert found.bleed_free_mip == 2
    assert measure(surface, uv * 4.0).packing_square == "bounding"


@pytest.mark.parametrize(("gap", "mip"), [(0.0, -1), (1.9, -1), (2.0, 0), (4.0, 1), (15.99, 2), (16.0, 3), (40.0, 4)])
def test_the_bleed_free_mip_halves_the_gap(gap: float, mip: int) -> None:
    assert bleed_free_mip(gap) == mip


def test_without_a_size_there_are_no_texels() -> None:
    found = measure(*cube())
    assert found.texel_density_mean is None
    assert found.chart_gap_texels is None


def test_the_dictionary_is_json_and_holds_every_field() -> None:
    found = measure(*cube(), size=64)
    assert set(json.loads(json.dumps(found.to_dict(), allow_nan=False))) == {f.name for f in dataclasses.fields(found)}


def test_given_charts_are_taken_over() -> None:
    surface, uv = cube()
    labels, _ = uv_charts(surface.faces, uv)
    assert measure(surface, uv, labels * 3).charts == 6
    assert measure(surface, uv, np.zeros(12, dtype=np.int64)).charts == 1


def test_face_values_average_to_the_mean() -> None:
    surface = grid(6)
    uv = flat_uv(surface) + 0.3 * np.sin(3.0 * flat_uv(surface)[..., ::-1])
    mean = measure(surface, uv).symmetric_dirichlet_mean
    assert face_distortion(surface, uv).mean() == pytest.approx(mean)


def test_scale_and_place_of_mesh_and_uv_change_nothing() -> None:
    surface = grid(5)
    uv = flat_uv(surface) ** 2
    moved = Surface(surface.vertices * 1e3 + 7e3, surface.faces)
    one, two = measure(surface, uv), measure(moved, uv * 0.01 + 0.3)
    assert two.isometric_mean == pytest.approx(one.isometric_mean, rel=1e-9)
    assert two.seam_length == pytest.approx(one.seam_length)


def test_what_does_not_fit_is_refused() -> None:
    surface, uv = cube()
    with pytest.raises(ShapeError, match="corner_uv must be"):
        measure(surface, uv[:-1])
    with pytest.raises(ShapeError, match="face_chart must be"):
        measure(surface, uv, np.zeros(3, dtype=np.int64))
    with pytest.raises(InputError, match="not finite"):
        measure(surface, np.where(np.arange(12)[:, None, None] == 5, np.nan, uv))
    with pytest.raises(InputError, match="no area"):
        measure(surface, np.zeros((12, 3, 2)))


def evaluator() -> Any:
    if not EVALUATOR.is_file():
        pytest.skip(f"no independent evaluator at {EVALUATOR}")
    spec = importlib.util.spec_from_file_location("uveval", EVALUATOR)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", ["suzanne", "spot", "fandisk"])
def test_all_common_metrics_agree_with_the_independent_evaluator(models: Path, name: str) -> None:
    check = evaluator()
    mesh = trimesh.load_mesh(models / f"{name}.obj", process=False, skip_materials=True)
    vertices, weld = np.unique(np.asarray(mesh.vertices, dtype=np.float64), axis=0, return_inverse=True)
    surface = Surface(vertices, weld.reshape(-1)[np.asarray(mesh.faces)].astype(np.int64))
    normals = surface.face_normals()
    side = np.abs(normals).argmax(axis=1) * 2 + (normals[np.arange(len(normals)), np.abs(normals).argmax(axis=1)] < 0)
    kept = np.array([[1, 2], [2, 0], [0, 1]])[side // 2]
    uv = np.take_along_axis(surface.triangles, kept[:, None, :], axis=2)
    uv = uv + 3.0 * np.abs(vertices).max() * np.stack([side // 2, side % 2], axis=1)[:, None, :]
    theirs = check.evaluate(vertices, surface.faces, uv, raster=False)
    ours = measure(surface, uv)
    common = {
        "conformal_mean": "conf_mean",
        "isometric_mean": "iso_abs",
        "symmetric_dirichlet_mean": "symdir",
        "seam_length": "seam_len",
        "seam_edges": "seam_edges",
        "charts": "charts",
        "flipped_faces": "flips_n",
        "degenerate_uv_faces": "uv_degenerate_n",
        "overlap_fraction": "lag_overlap_area_frac",
    }
    expected = {name: theirs[other] for name, other in common.items() if other in theirs}
    assert {name: getattr(ours, name) for name in expected} == pytest.approx(expected, rel=1e-6, abs=1e-12)
    assert theirs["mirrored_charts"] in (ours.mirrored_charts, ours.charts - ours.mirrored_charts)
    assert (theirs["eff_square"] - ours.packing_efficiency) * 1.0 == pytest.approx(
        theirs["eff_square"] * ours.overlap_fraction, abs=1e-9
    )


def test_two_closed_surfaces_without_a_seam_have_no_gap() -> None:
    """Their charts have no outline."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    surface = Surface(np.concatenate([corners, corners + 3.0]), np.concatenate([faces, faces + 4]))
    uv = surface.vertices @ np.array([[0.1, 0.0], [0.0, 0.1], [0.03, 0.07]])
    assert measure(surface, uv[surface.faces], size=64).chart_gap_texels in (None, 0.0)

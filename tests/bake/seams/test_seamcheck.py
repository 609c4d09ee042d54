"""Both sides of a seam give one value: measured by hand on a cut square, then made so on a sphere and real meshes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexpara.bake.baker import bake, chart_labels
from flexpara.bake.raster.gbuffer import GBuffer
from flexpara.bake.seams.seamcheck import (
    agrees_across_seams,
    chart_outlines,
    clean_mip,
    find_seams,
    footprint,
    sample_seams,
    seam_edges,
    seam_error,
    seam_report,
)
from flexpara.bake.texture import Texture
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.mesh import Asset, Atlas
from flexpara.runtime.pack.packing import atlas_from_uv

MakeGBuffer = Callable[[Atlas, int], GBuffer]

Pair = tuple[Atlas, Asset]


@pytest.fixture
def cut(pair: Callable[..., Pair]) -> Pair:
    """A flat strip of two squares, cut along x = 1: the right one lies above the left one, turned by a quarter."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    xyz = [[x + i, y, 0] for i in (0, 1) for x, y in corners]
    right = np.stack([1 - corners[:, 1], corners[:, 0]], axis=1)  # a quarter turn
    uv = np.concatenate([corners * 0.3 + [0.13, 0.1], right * 0.3 + [0.47, 0.61]])
    return pair(xyz, [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]], uv)


def test_the_seam_of_a_cut_strip_is_one_edge_seen_twice(cut: Pair) -> None:
    seams = find_seams(cut[0])
    assert seams.shape == (1, 2, 2, 2)
    np.testing.assert_allclose(seams[0, 0], [[0.43, 0.1], [0.43, 0.4]], atol=1e-6)
    np.testing.assert_allclose(seams[0, 1], [[0.77, 0.61], [0.47, 0.61]], atol=1e-6)


def test_a_crease_is_left_out(cut: Pair) -> None:
    normals = cut[0].normals.copy()
    normals[4:] = [1, 0, 0]
    assert len(find_seams(replace(cut[0], normals=normals))) == 0


def test_a_footprint_is_bilinear() -> None:
    image = np.arange(16.0).reshape(4, 4)
    texel, weight = footprint(np.array([[0.5, 0.5], [0.125, 0.875], [0.0, 0.0]]), 4)
    np.testing.assert_allclose((image.reshape(-1)[texel] * weight).sum(axis=1), [7.5, 0.0, 12.0])


def test_the_error_of_two_constants_is_their_difference(cut: Pair) -> None:
    pixels = np.zeros((64, 64, 1), np.float32)
    pixels[:32] = 0.25  # the upper half, where the right square lies
    texture = Texture(pixels, "unit", 8, "png")
    error = seam_error(replace(texture, metadata={"range": "[0, 1]"}), sample_seams(find_seams(cut[0]), 64))
    assert error is not None
    assert error.maximum == pytest.approx(0.25)
    assert error.p99 == pytest.approx(0.25)
    assert error.samples >= 2 * 0.3 * 64
    assert seam_error(texture, sample_seams(np.zeros((0, 2, 2, 2)), 64)) is None


def test_a_steep_function_agrees_across_the_seam_and_stays_inside_charts(make_gbuffer: MakeGBuffer, cut: Pair) -> None:
    def steep(position: np.ndarray, *_: np.ndarray) -> np.ndarray:
        return 0.5 + 0.5 * np.sin(6.0 * position[:, :2])

    size = 64
    textures = bake(cut[0], {"steep": steep}, size=size, padding=4)
    bare = bake(cut[0], {"steep": steep}, size=size, padding=0)["steep"].pixels
    assert seam_report(cut[0], textures)["steep"]["max"] < 1.0 / 255.0
    inside = make_gbuffer(cut[0], size).inside
    assert inside.sum() > 600
    np.testing.assert_array_equal(textures["steep"].pixels[inside], bare[inside])
    plain = np.array(textures["steep"].pixels)
    plain[~inside] = bare[~inside]
    error = seam_error(replace(textures["steep"], pixels=plain), sample_seams(find_seams(cut[0]), size))
    assert error is not None
    assert error.maximum > 3.0 / 255.0  # so there was something to do


def test_a_sphere_s_normals_agree_across_its_cut(fine_sphere: Pair) -> None:
    textures = bake(*fine_sphere, ["normal-object", "position", "chart", "normal"], size=256, padding=4)
    report = seam_report(fine_sphere[0], textures)
    assert set(report) == {"normal-object", "position"}
    assert max(entry["max"] for entry in report.values()) <= 1.0 / 255.0


def test_maps_that_jump_by_right_are_not_compared() -> None:
    assert agrees_across_seams("position", "object")
    assert not agrees_across_seams("normal", "tangent, Y up")
    assert not agrees_across_seams("chart", "none")
    assert not agrees_across_seams("uv-checker", "uv")


@pytest.mark.parametrize(("padding", "level"), [(1, 0), (2, 1), (4, 1), (5, 2), (8, 2), (10, 3)])
def test_gutters_carry_as_many_mips_as_they_are_wide(two_charts: Pair, padding: int, level: int) -> None:
    # squares from 16 to 48 and from 80 to 112 of 128 texels touch one texel more; at level m a corner looks 2^m texels
    # away in both directions: (2^m − 1) √2 ≤ padding
    assert clean_mip(chart_labels(two_charts[0], 128, padding), two_charts[0]) == level


def test_without_a_gutter_the_full_image_bleeds(two_charts: Pair) -> None:
    moved = replace(two_charts[0], uv=two_charts[0].uv + np.float32(0.3 / 64))
    assert clean_mip(chart_labels(moved, 64, 0), moved) == -1


def test_a_real_mesh_agrees_across_its_seams(models: Path) -> None:
    asset = load_asset(models / "spot.obj")
    assert asset.uv is not None
    asset = replace(asset, uv=asset.uv * 0.9 + 0.06)
    atlas = atlas_from_uv(asset)
    report = seam_report(atlas, bake(atlas, asset, ["position", "normal-object"], size=1024, padding=4))
    assert len(find_seams(atlas)) > 100
    assert report["position"]["max"] <= 1.0 / 255.0
    assert report["normal-object"]["p99"] <= 1.0 / 255.0


def test_seams_of_a_cut_sphere_are_its_cut(sphere: Pair) -> None:
    """Rows of 16 faces along the meridian that is cut, columns of 24 around each pole that is left out."""
    edges = seam_edges(sphere[0])
    assert edges.shape == (16, 2, 3)
    np.testing.assert_allclose(edges[..., 0], 0.0, atol=1e-9)
    assert (edges[..., 2] > 0).all()
    assert chart_outlines(sphere[0]).shape == (2 * 16 + 2 * 24, 2, 2)


def test_an_edge_whose_normals_alone_are_split_is_no_seam(quad: Pair) -> None:
    """A square folded along its diagonal, shaded flat: two vertices at each end of the diagonal, with one uv."""
    atlas, _ = quad
    corner = np.array([0, 1, 2, 0, 2, 3])
    split = replace(
        atlas,
        positions=atlas.positions[corner],
        uv=atlas.uv[corner],
        normals=atlas.normals[corner],
        source_vertex=corner,
        faces=np.arange(6).reshape(2, 3),
    )
    assert len(seam_edges(split)) == 0
    assert len(chart_outlines(split)) == 4
    moved = split.uv.copy()
    moved[3:] *= 0.5
    assert len(seam_edges(replace(split, uv=moved))) == 1
    assert len(chart_outlines(replace(split, uv=moved))) == 6

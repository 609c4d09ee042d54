"""Seams that were asked for are seams of the charts that come out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.geometry.triangles import signed_areas
from flexpara.runtime.io.asset.wantedseams import torn, wanted_seams
from flexpara.runtime.io.meshfile import asset_from_arrays
from flexpara.runtime.options.seams import SeamOptions
from flexpara.runtime.options.unwrap import TrainOptions
from flexpara.runtime.process.progress import Clock
from flexpara.runtime.samples import make_sample
from flexpara.train.presets import train_asset


def test_every_hard_edge_of_a_cube_is_a_seam_where_that_is_asked_and_is_not_otherwise() -> None:
    cube = asset_from_arrays(*make_sample("cube", resolution=12))
    hard = wanted_seams(cube, SeamOptions(hard_edges="split"), 30.0).cut
    assert hard is not None
    table = edge_table(cube.surface.faces)
    for options in (TrainOptions(hard_edges="split"), TrainOptions()):
        charts = train_asset(cube, options, Clock()).charts
        of_corner = np.repeat(charts.face_chart[:, None, None].astype(np.float64), 3, axis=1)
        seam = torn(table, charts.corner_uv, 1e-9) | torn(table, of_corner, 0.5)
        assert bool(seam[hard].all()) is (options.hard_edges == "split")
        assert (len(charts.method) == 6) is (options.hard_edges == "split")


def test_no_chart_of_a_sphere_reaches_over_the_border_of_two_materials_that_stays() -> None:
    sphere = asset_from_arrays(*make_sample("sphere", resolution=16))
    side = sphere.surface.triangles.mean(axis=1)[:, 2] > 0.0
    painted = replace(sphere, face_material=side.astype(np.int64))
    charts = train_asset(painted, TrainOptions(keep_seams=("material",)), Clock()).charts
    for chart in range(len(charts.method)):
        assert len(np.unique(side[charts.face_chart == chart])) == 1


def test_important_charts_get_as_many_times_the_texels_as_is_asked_and_all_others_stay() -> None:
    cube = asset_from_arrays(*make_sample("cube", resolution=4))
    top = cube.positions[:, 2] >= cube.positions[:, 2].max() - 1e-9
    colors = np.repeat(np.where(top, 255, 0).astype(np.uint8)[:, None], 4, axis=1)
    marked = replace(cube, colors=colors)
    options = TrainOptions(hard_edges="split", importance=Path("red"), importance_density=3.0)
    charts = train_asset(marked, options, Clock()).charts
    size = np.sqrt(np.abs(signed_areas(charts.corner_uv)) / cube.surface.face_areas())
    above = cube.surface.face_normals()[:, 2] > 0.9
    below = cube.surface.face_normals()[:, 2] < -0.9
    assert np.allclose(size[above], 3.0)
    assert np.allclose(size[below], 1.0)

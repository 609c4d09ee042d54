"""Seams that were asked for are seams of the charts that come out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.io.asset.wantedseams import torn, wanted_seams
from flexpara.runtime.io.meshfile import asset_from_arrays
from flexpara.runtime.options.seams import SeamOptions
from flexpara.runtime.options.unwrap import TrainOptions
from flexpara.runtime.progress import Clock
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

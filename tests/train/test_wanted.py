"""Seams that were asked for are seams of the charts that come out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.io.meshfile import asset_from_arrays
from flexpara.runtime.io.wantedseams import torn, wanted_seams
from flexpara.runtime.options.seams import SeamOptions
from flexpara.runtime.options.unwrap import TrainOptions
from flexpara.runtime.progress import Clock
from flexpara.runtime.samples import make_sample
from flexpara.train.presets import train_asset


def test_every_hard_edge_of_a_cube_is_a_seam_where_that_is_asked_and_is_not_otherwise() -> None:
    cube = asset_from_arrays(*make_sample("cube", resolution=12))
    hard = wanted_seams(cube, SeamOptions(hard_edges="split"), 30.0)
    assert hard is not None
    for asked, share in (("split", 1.0), ("free", 0.7)):
        charts = train_asset(cube, TrainOptions(hard_edges=asked), Clock()).charts
        seam = torn(edge_table(cube.surface.faces), charts.corner_uv, 1e-9)
        seam |= torn(edge_table(cube.surface.faces), np.repeat(charts.face_chart[:, None, None], 3, axis=1), 0.5)
        assert (seam[hard].mean() == share) if asked == "split" else (seam[hard].mean() < share)
        assert (len(charts.method) == 6) is (asked == "split")


def test_no_chart_of_a_sphere_reaches_over_the_border_of_two_materials_that_stays() -> None:
    sphere = asset_from_arrays(*make_sample("sphere", resolution=16))
    side = sphere.surface.triangles.mean(axis=1)[:, 2] > 0.0
    painted = replace(sphere, face_material=side.astype(np.int64))
    charts = train_asset(painted, TrainOptions(keep_seams=("material",)), Clock()).charts
    for chart in range(len(charts.method)):
        assert len(np.unique(side[charts.face_chart == chart])) == 1

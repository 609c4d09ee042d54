"""Texel density: exactly what was asked for, padding kept, and the size to pass where it does not fit."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.errors import InputError
from flexpara.runtime.geometry.metrics import measure
from flexpara.runtime.mesh import Asset, Charts, Surface
from flexpara.runtime.pack.density import pack_square
from flexpara.runtime.pack.square import Square


def squares(sides: list[float]) -> tuple[Asset, Charts]:
    """Separate unit quads of these sides, each a chart."""
    unit = np.array([[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]]])
    uv = np.concatenate([unit * side for side in sides])
    height = np.repeat(np.arange(len(sides), dtype=np.float64), 6).reshape(-1, 3, 1)
    corners = np.concatenate([uv, height], axis=2).reshape(-1, 3)
    vertices, weld = np.unique(corners, axis=0, return_inverse=True)
    surface = Surface(vertices, weld.reshape(-1, 3).astype(np.int64))
    chart = np.repeat(np.arange(len(sides)), 2)
    asset = Asset(vertices, surface.faces, np.arange(len(vertices)), surface)
    return asset, Charts(chart, uv, chart, np.arange(len(sides)), ("slim",) * len(sides))


@pytest.mark.parametrize("density", [3.0, 20.0, 45.0])
def test_the_density_is_the_one_asked_for(density: float) -> None:
    asset, charts = squares([1.0, 2.0, 0.5, 3.0])
    packed = pack_square(asset, charts, Square(256, 3, density))
    assert len(packed.invalid) == 0
    metrics = measure(asset.surface, packed.atlas.corner_uv, packed.atlas.face_chart, size=256).to_dict()
    assert metrics["texel_density_min"] == pytest.approx(density, rel=1e-4)
    assert metrics["texel_density_max"] == pytest.approx(density, rel=1e-4)
    assert metrics["chart_gap_texels"] >= 6.0 - 1e-3
    assert packed.atlas.size == 256
    assert packed.atlas.uv.min() * 256 >= 3.0 - 1e-3


def test_a_density_that_does_not_fit_names_the_size_that_does() -> None:
    asset, charts = squares([1.0, 1.0])
    with pytest.raises(InputError, match=r"texel-density is 1000, .* pass --size 4096"):
        pack_square(asset, charts, Square(256, 2, 1000.0))
    pack_square(asset, charts, Square(4096, 2, 1000.0))


def test_the_density_that_just_fits_is_met_whichever_way_it_was_rounded() -> None:
    """As pages ask for it: the density of the fullest, summed in another order."""
    asset, charts = squares([1.0, 2.0])
    most = pack_square(asset, charts, Square(256, 2)).report["chart_scale"] * 256
    packed = pack_square(asset, charts, Square(256, 2, float(np.nextafter(most, np.inf))))
    assert packed.report["chart_scale"] * 256 == pytest.approx(most, rel=1e-9)


def test_without_a_density_charts_fill_the_atlas() -> None:
    asset, charts = squares([1.0])
    packed = pack_square(asset, charts, Square(100, 2))
    assert packed.report["chart_scale"] == pytest.approx(0.96, abs=1e-3)


def test_many_charts_get_less_padding_where_none_was_asked_for_and_the_report_says_so() -> None:
    asset, charts = squares([1.0] * 40)
    packed = pack_square(asset, charts, Square(128, 4, spares=True))
    assert (packed.atlas.padding, packed.report["padding"], packed.report["usual_padding"]) == (2, 2, 4)
    asked = pack_square(asset, charts, Square(128, 4))
    assert (asked.atlas.padding, asked.report["padding"]) == (4, 4)
    assert "usual_padding" not in asked.report
    assert packed.report["chart_scale"] > 1.2 * asked.report["chart_scale"]

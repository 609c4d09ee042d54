"""What a page may be asked: turns, stacks, whole texels, each measured on what comes out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from flexpara.runtime.geometry.metrics import measure
from flexpara.runtime.mesh import Asset, Atlas, Charts, Surface
from flexpara.runtime.pack.asked import pack_asked
from flexpara.runtime.pack.growing.outlines import rotation
from flexpara.runtime.pack.square import Square
from flexpara.runtime.pack.stacking import MIRROR

if TYPE_CHECKING:
    from flexpara.runtime.pack.config import Rotation

SIZE, PADDING = 256, 3
ROTATIONS: tuple[Rotation, ...] = ("any", "90", "off")
SCALENE = np.array([[0.0, 0.0], [3.0, 0.0], [0.5, 1.0]])


def triangles(*flat: np.ndarray) -> tuple[Asset, Charts]:
    """Separate triangles (3, 2), each a chart as it stands."""
    k = len(flat)
    vertices = np.concatenate([np.column_stack([part, np.full(3, 2.0 * number)]) for number, part in enumerate(flat)])
    faces = np.arange(3 * k).reshape(k, 3)
    surface = Surface(vertices, faces)
    chart = np.arange(k)
    return Asset(vertices, faces, np.arange(3 * k), surface), Charts(chart, np.stack(flat), chart, chart, ("slim",) * k)


def edge_angles(atlas: Atlas) -> np.ndarray:
    """(f,) directions of the first edges, in degrees of a whole turn."""
    edge = np.diff(atlas.corner_uv[:, :2], axis=1)[:, 0]
    return np.degrees(np.arctan2(edge[:, 1], edge[:, 0])) % 360.0


@pytest.mark.parametrize(("turns", "step"), [("off", 360.0), ("90", 90.0)])
def test_charts_are_turned_no_more_than_allowed(turns: Rotation, step: float) -> None:
    angles = np.array([0.0, 0.3, 1.0, 2.5, 4.0, 5.5])
    asset, charts = triangles(*(SCALENE @ rotation(angle).T for angle in angles.tolist()))
    atlas = pack_asked(asset, charts, Square(SIZE, PADDING, rotation=turns)).atlas
    turned = (edge_angles(atlas) - np.degrees(angles)) / step
    assert np.abs(turned - np.rint(turned)).max() < 1e-3


def test_freely_turned_charts_are_larger() -> None:
    asset, charts = triangles(*(SCALENE @ rotation(angle).T for angle in (0.4, 0.5, 0.6, 0.7, 0.8, 0.9)))
    scale = {turns: pack_asked(asset, charts, Square(SIZE, PADDING, rotation=turns)) for turns in ROTATIONS}
    assert scale["any"].report["chart_scale"] > 1.05 * scale["90"].report["chart_scale"]
    assert scale["90"].report["chart_scale"] >= scale["off"].report["chart_scale"]


def test_identical_charts_share_their_place_and_the_rest_keeps_the_padding() -> None:
    copies = [SCALENE @ rotation(angle).T + angle for angle in (0.0, 1.0, 2.0)]
    asset, charts = triangles(*copies, 0.7 * SCALENE, SCALENE @ MIRROR.T)
    found = pack_asked(asset, charts, Square(SIZE, PADDING, stack="identical"))
    uv = found.atlas.corner_uv
    assert np.abs(uv[:3] - uv[0]).max() <= 2.0**-23
    assert found.report["stacked"] == 2
    assert found.invalid.tolist() == []
    metrics = measure(asset.surface, uv, found.atlas.face_chart, size=SIZE, stack=found.atlas.face_stack)
    assert metrics.chart_gap_texels is not None
    assert metrics.chart_gap_texels >= 2 * PADDING - 1e-3
    assert metrics.overlap_fraction == 0.0
    assert metrics.charts == 5


def test_mirror_images_share_their_place_where_that_is_asked_for() -> None:
    asset, charts = triangles(SCALENE, 0.7 * SCALENE, SCALENE @ MIRROR.T @ rotation(2.0).T)
    found = pack_asked(asset, charts, Square(SIZE, PADDING, stack="mirrored"))
    uv = found.atlas.corner_uv
    assert np.abs(uv[2] - uv[0]).max() <= 2.0**-23
    assert found.atlas.stack is not None
    assert found.atlas.stack.tolist() == [0, 1, 0]


def test_stacks_leave_room_for_larger_charts() -> None:
    asset, charts = triangles(*[SCALENE] * 8)
    plain, stacked = (pack_asked(asset, charts, Square(SIZE, PADDING, stack=how)) for how in ("off", "identical"))
    assert stacked.report["chart_scale"] > 1.4 * plain.report["chart_scale"]


def test_the_placement_leads_from_every_chart_to_its_uv() -> None:
    asset, charts = triangles(SCALENE, 0.7 * SCALENE, SCALENE @ MIRROR.T @ rotation(2.0).T + 4.0)
    atlas = pack_asked(asset, charts, Square(SIZE, PADDING, stack="mirrored")).atlas
    assert atlas.placement is not None
    placed = np.einsum("kij,kcj->kci", atlas.placement[:, :, :2], charts.corner_uv) + atlas.placement[:, None, :, 2]
    assert np.abs(placed - atlas.corner_uv).max() <= 2.0**-23


def test_nothing_is_stacked_where_no_two_are_alike() -> None:
    asset, charts = triangles(SCALENE, 0.7 * SCALENE)
    found = pack_asked(asset, charts, Square(SIZE, PADDING, stack="mirrored"))
    assert found.report["stacked"] == 0

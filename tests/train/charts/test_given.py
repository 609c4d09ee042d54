"""An atlas to improve: what is valid of it stays, the rest is mended, and no result is worse than it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.mesh import Surface
from flexpara.runtime.process.progress import Stages
from flexpara.runtime.samples import make_sample
from flexpara.train.charts.charts import Finished, chart_surface
from flexpara.train.charts.given import made_valid
from flexpara.train.charts.proof import verify
from flexpara.train.charts.starts import NOTHING, Known
from flexpara.train.config import FinishConfig, PageConfig
from flexpara.train.search.config import StartConfig

CONFIG = FinishConfig(start=StartConfig(counts=(1.0,)), page=PageConfig(price=0.0, tries=0))
LAZY = replace(CONFIG, rounds=0, start=StartConfig(counts=(4.0,)), doubt=-1.0, stretched=9.0)
"""A search that merges next to nothing."""


def ball() -> Surface:
    return Surface(*make_sample("sphere", resolution=16))


def corners_of(found: Finished, count: int) -> np.ndarray:
    """(f, 3, 2) uv of finished charts, each beside the last."""
    corner_uv = np.zeros((count, 3, 2))
    for number, piece in enumerate(found.pieces):
        corner_uv[piece.ids] = piece.flat.uv[piece.flat.surface.faces] + [10.0 * number, 0.0]
    return corner_uv


def charted(surface: Surface, config: FinishConfig, known: Known = NOTHING) -> Finished:
    found = chart_surface(surface, 8, config, 0, Stages(), known)
    verify(found.pieces)
    return found


def test_a_result_is_no_worse_than_the_atlas_given_where_the_search_alone_is() -> None:
    sphere = ball()
    good, lazy = charted(sphere, CONFIG), charted(sphere, LAZY)
    assert lazy.objective > 1.02 * good.objective
    again = charted(sphere, LAZY, Known(corner_uv=corners_of(good, len(sphere.faces))))
    assert again.start is not None
    assert again.objective <= good.objective * (1.0 + 1e-9)
    assert again.start.objective[0] == pytest.approx(good.objective, rel=1e-4)
    assert again.start.objective[1] == again.objective


def test_size_place_and_mirroring_of_the_given_atlas_do_not_matter() -> None:
    sphere = ball()
    plain = corners_of(charted(sphere, CONFIG), len(sphere.faces))
    first, second = (made_valid(sphere, uv, CONFIG) for uv in (plain, plain * [-0.01, 0.01] + 0.3))
    assert second.objective() == pytest.approx(first.objective(), rel=1e-6)
    assert len(second.pieces) == len(first.pieces)


def test_an_island_that_lies_over_itself_is_mended_and_one_without_area_laid_out_anew() -> None:
    sphere = ball()
    folded = sphere.triangles[:, :, :2].copy()  # both halves on each other: half of the triangles are flipped
    mended = made_valid(sphere, folded, CONFIG)
    verify(list(mended.pieces.values()))
    assert sum(len(piece.ids) for piece in mended.pieces.values()) == len(sphere.faces)
    empty = made_valid(sphere, np.zeros_like(folded), CONFIG)
    verify(list(empty.pieces.values()))


def test_a_part_takes_the_best_atlas_among_its_copies() -> None:
    one = ball()
    two = Surface(
        np.concatenate([one.vertices, one.vertices * [-1.0, 1.0, 1.0] + [3.0, 0.0, 0.0]]),
        np.concatenate([one.faces, one.faces[:, [0, 2, 1]] + len(one.vertices)]),
    )
    count = len(one.faces)
    good = corners_of(charted(one, CONFIG), count)
    torn = np.tile(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), (count, 1, 1))
    torn += np.arange(count)[:, None, None] * 2.0  # each triangle for itself
    known = Known(corner_uv=np.concatenate([torn, good[:, [0, 2, 1]] * [-1.0, 1.0] + [500.0, 0.0]]))
    found, alone = charted(two, LAZY, known), charted(one, CONFIG)
    assert found.parts["copies"] == 1
    assert len(found.pieces) <= 2 * len(alone.pieces)
    assert found.start is not None
    assert found.start.charts[0] == count + len(alone.pieces)
    assert found.start.objective[1] < found.start.objective[0]

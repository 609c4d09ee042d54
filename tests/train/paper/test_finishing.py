"""Finishing a global map: two triangles by hand, tubes, tori and spheres with bands, several parts, a real mesh."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from flexpara.runtime.errors import ShapeError
from flexpara.runtime.geometry.metrics import Metrics, measure
from flexpara.runtime.geometry.topology import euler_characteristic
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.mesh import Frame, Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.finish.contact import excess_energy, is_valid
from flexpara.train.finish.flatten import slim
from flexpara.train.paper.conformal import ConformalConfig, angle_error, conformal_steps
from flexpara.train.paper.finishing import (
    GlobalFinish,
    GlobalFinishConfig,
    finish_global,
    learned_start,
    open_along_seam,
)

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

CONFIG = GlobalFinishConfig()
CONFORMAL = ConformalConfig()
CONTACT = CONFIG.finish.slit.contact


def quiet(stage: str) -> None:
    """No progress."""


def sample(name: str, resolution: int) -> Surface:
    vertices, faces = make_sample(name, resolution=resolution)
    return Surface(Frame.of(vertices).apply(vertices), faces)


def banded(angle: NDArray[np.float64], width: float) -> NDArray[np.float64]:
    """The angle as a network would have it: continuous, with a steep way back within ``width`` of its jump."""
    return angle * np.tanh((np.pi - np.abs(angle)) / width)


def unrolled_tube(width: float) -> tuple[Surface, NDArray[np.float64]]:
    tube = sample("tube", 40)
    angle = np.arctan2(tube.vertices[:, 1], tube.vertices[:, 0])
    radius = float(np.hypot(*tube.vertices[0, :2]))
    return tube, np.stack([radius * (banded(angle, width) if width else angle), tube.vertices[:, 2]], axis=1)


def unrolled_torus(width: float) -> tuple[Surface, NDArray[np.float64]]:
    torus = sample("torus", 40)
    x, y, z = torus.vertices.T
    ring = np.hypot(x, y)
    around, across = np.arctan2(y, x), np.arctan2(z, ring - (ring.max() + ring.min()) / 2.0)
    return torus, np.stack([0.7 * banded(around, width), 0.3 * banded(across, 2.0 * width)], axis=1)


def together(first: Surface, second: Surface) -> Surface:
    """Two surfaces side by side, as parts of one."""
    vertices = np.concatenate([first.vertices, second.vertices + np.array([4.0, 0.0, 0.0])])
    return Surface(vertices, np.concatenate([first.faces, second.faces + len(first.vertices)]))


def figures(surface: Surface, found: GlobalFinish) -> Metrics:
    """Metrics of the finished charts; each face lies in exactly one."""
    uv = np.full((len(surface.faces), 3, 2), np.nan)
    chart = np.full(len(surface.faces), -1)
    for number, piece in enumerate(found.finished.pieces):
        assert (chart[piece.ids] == -1).all()
        uv[piece.ids] = piece.flat.uv[piece.flat.surface.faces] + [100.0 * number, 0.0]  # not packed yet
        chart[piece.ids] = number
        assert np.array_equal(piece.flat.surface.triangles, surface.triangles[piece.ids])
    return measure(surface, uv, chart)


def test_two_triangles_keep_their_shape() -> None:
    square = Surface(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    found = finish_global(square, square.vertices[:, :2] * [3.0, 1.0], quiet)
    assert figures(square, found).isometric_mean < 1e-6
    assert found.components == [
        {"faces": 2, "seam_length": 0.0, "slits": 0, "start": found.components[0]["start"], "charts": 1}
    ]


def test_uv_of_other_vertices_or_without_value_are_refused() -> None:
    tube, uv = unrolled_tube(0.0)
    with pytest.raises(ShapeError, match=rf"\({len(uv)}, 2\)"):
        finish_global(tube, uv[1:], quiet)
    uv[3, 0] = np.nan
    with pytest.raises(ShapeError, match="1 values that are not"):
        finish_global(tube, uv, quiet)


def test_opening_along_the_seam_leaves_the_triangles_and_a_disk() -> None:
    torus, uv = unrolled_torus(0.1)
    whole, opened = open_along_seam(torus, np.arange(len(torus.faces)), uv, CONFIG.seam)
    assert euler_characteristic(whole.faces) != 1
    assert euler_characteristic(opened.surface.faces) == 1
    assert np.array_equal(opened.surface.triangles, torus.triangles)
    assert np.array_equal(opened.uv[opened.surface.faces], uv[torus.faces])
    assert 0.02 < opened.torn.mean() < 0.3


@pytest.mark.parametrize("width", [0.0, 0.1, 0.3])
def test_the_learned_uv_of_a_tube_are_valid_once_its_band_is_laid_out_anew(width: float) -> None:
    tube, uv = unrolled_tube(width)
    opened = open_along_seam(tube, np.arange(len(tube.faces)), uv, CONFIG.seam)[1]
    assert not is_valid(opened.surface, opened.uv)
    start = learned_start(opened, CONFIG)
    assert start is not None
    assert is_valid(opened.surface, start)
    # far from the band, the learned uv are kept, up to one scale
    far = opened.surface.vertices[:, 0] > 0.0
    ratio = np.ptp(start[far], axis=0) / np.ptp(opened.uv[far], axis=0)
    assert ratio[0] == pytest.approx(ratio[1], rel=1e-6)
    assert angle_error(opened.surface, start) < 0.1


def test_a_mirrored_map_is_turned_round() -> None:
    tube, uv = unrolled_tube(0.0)
    opened = open_along_seam(tube, np.arange(len(tube.faces)), uv * [-1.0, 1.0], CONFIG.seam)[1]
    start = learned_start(opened, CONFIG)
    assert start is not None
    assert is_valid(opened.surface, start)


def test_a_map_that_is_nonsense_is_no_start() -> None:
    tube, _ = unrolled_tube(0.0)
    rng = np.random.default_rng(0)
    opened = open_along_seam(tube, np.arange(len(tube.faces)), rng.normal(size=(len(tube.vertices), 2)), CONFIG.seam)[1]
    assert learned_start(opened, CONFIG) is None
    flat = opened._replace(uv=np.zeros_like(opened.uv), torn=np.zeros_like(opened.torn))
    assert learned_start(flat, CONFIG) is None


def test_two_layers_in_uv_are_no_valid_map() -> None:
    """A strip of triangles that winds around a point twice: no flip, but it lies on itself."""
    turn = np.linspace(0.0, 4.0 * np.pi, 33)
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    uv = np.concatenate([ring, 2.0 * ring])
    low = np.arange(32)
    faces = np.concatenate([np.stack([low, low + 33, low + 34], axis=1), np.stack([low, low + 34, low + 1], axis=1)])
    strip = Surface(np.concatenate([uv, np.repeat(turn[None], 2, axis=0).reshape(-1, 1)], axis=1), faces)
    assert not is_valid(strip, uv)
    half = faces[(faces % 33 < 14).all(axis=1)]
    assert is_valid(Surface(strip.vertices, half), uv)


def test_conformal_steps_trade_areas_for_angles_and_stay_valid() -> None:
    cap = sample("cloth", 24)
    bent = Surface(cap.vertices * [1.0, 1.0, 3.0], cap.faces)
    uv = bent.vertices[:, :2]
    angles = conformal_steps(bent, uv, CONFORMAL, CONTACT)
    assert is_valid(bent, angles)
    assert angle_error(bent, angles) < 0.3 * angle_error(bent, uv)
    assert 0.0 < angle_error(bent, conformal_steps(bent, uv, replace(CONFORMAL, enough=0.2), CONTACT)) < 0.2
    assert np.array_equal(conformal_steps(bent, uv, replace(CONFORMAL, iterations=0), CONTACT), uv)


def test_conformal_steps_end_where_areas_would_cost_more_than_allowed() -> None:
    cap = sample("cloth", 24)
    bent = Surface(cap.vertices * [1.0, 1.0, 3.0], cap.faces)
    uv, area = slim(bent, bent.vertices[:, :2], 50), float(bent.face_areas().sum())
    free = conformal_steps(bent, uv, replace(CONFORMAL, growth=1e6), CONTACT)
    limit = 0.5 * (excess_energy(bent, uv) + excess_energy(bent, free))
    assert excess_energy(bent, uv) < limit < excess_energy(bent, free)
    tight = replace(CONFORMAL, growth=limit / excess_energy(bent, uv), allowance=0.0, block=1)
    found = conformal_steps(bent, uv, tight, CONTACT)
    assert excess_energy(bent, found) <= limit
    still = conformal_steps(
        bent, uv, replace(tight, growth=0.0, allowance=0.5 * excess_energy(bent, uv) / area), CONTACT
    )
    assert np.array_equal(still, uv)


def test_a_knotted_tube_opened_along_its_seams_is_laid_flat() -> None:
    knot = sample("trefoil", 40)
    place = np.arange(len(knot.vertices))
    along, around = (
        2.0 * np.pi * part / count - np.pi for part, count in zip(np.divmod(place, 6), (120, 6), strict=True)
    )
    uv = np.stack([2.0 * banded(along, 0.1), 0.12 * banded(around, 0.4)], axis=1)
    metrics = figures(knot, finish_global(knot, uv, quiet))
    assert (metrics.charts, metrics.flipped_faces, metrics.overlap_fraction) == (1, 0, 0.0)
    assert metrics.conformal_mean < 0.05
    assert metrics.symmetric_dirichlet_mean < 1.1


@pytest.mark.parametrize("width", [0.0, 0.2])
def test_a_tube_comes_back_as_its_unrolled_rectangle(width: float) -> None:
    tube, uv = unrolled_tube(width)
    found = finish_global(tube, uv, quiet)
    metrics = figures(tube, found)
    assert metrics.conformal_mean < 1e-4
    assert metrics.symmetric_dirichlet_mean < 1.0001
    assert (metrics.charts, metrics.flipped_faces, metrics.overlap_fraction) == (1, 0, 0.0)
    assert found.components[0]["slits"] == 0
    assert found.components[0]["seam_length"] == pytest.approx(metrics.seam_length)


def test_a_torus_becomes_one_chart_and_its_slits_relieve_it() -> None:
    torus, uv = unrolled_torus(0.1)
    found = finish_global(torus, uv, quiet)
    metrics = figures(torus, found)
    assert (metrics.charts, metrics.flipped_faces, metrics.overlap_fraction) == (1, 0, 0.0)
    assert metrics.conformal_mean < 0.03
    assert metrics.symmetric_dirichlet_mean < 1.06
    assert found.components[0]["slits"] > 0
    bare = figures(torus, finish_global(torus, uv, quiet, replace(CONFIG, slits=0)))
    assert bare.seam_length < metrics.seam_length
    assert bare.symmetric_dirichlet_mean > metrics.symmetric_dirichlet_mean


def test_a_sphere_becomes_one_chart() -> None:
    sphere = sample("sphere", 40)
    x, y, z = sphere.vertices.T
    uv = np.stack([banded(np.arctan2(y, x), 0.2) * np.sqrt(1.0 - np.minimum(z**2, 1.0)), np.arcsin(z)], axis=1)
    metrics = figures(sphere, finish_global(sphere, uv, quiet))
    assert (metrics.charts, metrics.flipped_faces, metrics.overlap_fraction) == (1, 0, 0.0)
    assert metrics.conformal_mean < 0.05


def test_each_part_becomes_a_chart_of_its_own() -> None:
    tube, uv = unrolled_tube(0.2)
    both = together(tube, sample("cloth", 16))
    xy = both.vertices[len(uv) :, :2]
    found = finish_global(both, np.concatenate([uv, xy]), quiet)
    metrics = figures(both, found)
    assert (metrics.charts, metrics.flipped_faces, metrics.overlap_fraction) == (2, 0, 0.0)
    assert [row["charts"] for row in found.components] == [1, 1]
    assert found.components[1]["seam_length"] == 0.0


def test_faces_that_only_a_non_manifold_edge_joins_are_charts_apart() -> None:
    fan = Surface(
        np.array([[0.0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [-1, -1, 0]]),
        np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]]),
    )
    metrics = figures(fan, finish_global(fan, fan.vertices[:, :2], quiet))
    assert (metrics.charts, metrics.flipped_faces, metrics.overlap_fraction) == (3, 0, 0.0)


def test_a_component_without_a_valid_start_is_split_and_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    tube, uv = unrolled_tube(0.0)
    monkeypatch.setattr("flexpara.train.paper.finishing.flattened", lambda *_: (None, "none"))
    found = finish_global(tube, uv, quiet)
    metrics = figures(tube, found)
    assert found.components[0]["start"] == "none"
    assert found.components[0]["charts"] == len(found.finished.pieces) == metrics.charts
    assert (metrics.flipped_faces, metrics.overlap_fraction) == (0, 0.0)


def test_the_stages_are_named() -> None:
    square = Surface(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    stages: list[str] = []
    finish_global(square, square.vertices[:, :2], stages.append)
    assert stages == ["flatten", "exact check"]


def test_a_real_mesh_becomes_one_chart(models: Path) -> None:
    surface = load_asset(models / "spot.obj").surface
    ball = Surface(Frame.of(surface.vertices).apply(surface.vertices), surface.faces)
    config = replace(CONFIG, slits=0)
    metrics = figures(ball, finish_global(ball, ball.vertices[:, :2], quiet, config))
    assert (metrics.charts, metrics.flipped_faces, metrics.overlap_fraction) == (1, 0, 0.0)
    assert metrics.conformal_mean < 0.1  # the paper's figures are between 0.01 and 0.1

"""Finishing: every kind of surface becomes valid charts, whatever the probabilities; no network is needed.

The probabilities are a softmax over fixed directions: a Voronoi diagram of the sphere around the origin.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.errors import FinishError
from flexpara.runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from flexpara.runtime.geometry.topology import components, edge_table, is_manifold
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.mesh import Frame, Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.config import FinishConfig
from flexpara.train.finish.finish import Finished, carried_back, component_count, finish, regrouped, verify
from flexpara.train.finish.labels import dual_graph
from flexpara.train.finish.pieces import make_piece
from flexpara.train.finish.regroup import Regrouping

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

CONFIG = FinishConfig(rounds=2)
TETRAHEDRON = (
    np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]),
    np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]),
)


def voronoi(count: int, sharpness: float = 8.0) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """Log probability (n, count) of points (n, 3): softmax of their products with fixed directions."""
    direction = np.random.default_rng(0).normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)

    def log_probability(xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        score = sharpness * xyz @ direction.T
        score -= score.max(axis=1, keepdims=True)
        return score - np.log(np.exp(score).sum(axis=1, keepdims=True))

    return log_probability


def in_ball(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> Surface:
    return Surface(Frame.of(vertices).apply(vertices), faces)


def sample(name: str, resolution: int) -> Surface:
    if name in ("gyroid", "bracket"):
        pytest.importorskip("manifold3d")
    return in_ball(*make_sample(name, resolution=resolution))


def finished(surface: Surface, charts: int, config: FinishConfig = CONFIG, labels: int = 6) -> Finished:
    return finish(surface, voronoi(labels), charts, config, lambda _: None)


def beside(*parts: tuple[NDArray[np.float64], NDArray[np.int64]]) -> Surface:
    """Several meshes in a row, in one surface."""
    vertices = [part[0] + [3.0 * i, 0.0, 0.0] for i, part in enumerate(parts)]
    first = np.cumsum([0, *(len(part[0]) for part in parts[:-1])])
    return in_ball(
        np.concatenate(vertices), np.concatenate([part[1] + n for part, n in zip(parts, first, strict=True)])
    )


def book(cells: int) -> Surface:
    """Three square sheets on one edge."""
    line = np.linspace(0.0, 1.0, cells + 1)
    x, y = np.meshgrid(line, line, indexing="ij")
    corner = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    angle = 2.0 * np.pi / 3.0 * np.arange(3)[:, None, None]
    sheets = np.stack([x + 0.0 * angle, y * np.cos(angle), y * np.sin(angle)], axis=-1).reshape(-1, 3)
    _, first, weld = np.unique(np.round(sheets, 9), axis=0, return_index=True, return_inverse=True)
    every = np.concatenate([faces, faces + x.size, faces + 2 * x.size])
    return in_ball(sheets[first], weld.reshape(-1)[every].astype(np.int64))


def moebius(around: int, across: int) -> Surface:
    """A Möbius strip: a manifold that no orientation fits."""
    turn, shift = np.meshgrid(
        np.linspace(0.0, 2.0 * np.pi, around, endpoint=False), np.linspace(-0.3, 0.3, across + 1), indexing="ij"
    )
    radius = 1.0 + shift * np.cos(turn / 2.0)
    points = np.stack([radius * np.cos(turn), radius * np.sin(turn), shift * np.sin(turn / 2.0)], axis=-1)
    corner = np.arange(turn.size).reshape(turn.shape)
    corner = np.concatenate([corner, corner[:1, ::-1]])
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return in_ball(points.reshape(-1, 3), faces)


def assert_finished(surface: Surface, result: Finished, most: int) -> None:
    """Each face in one chart, charts in order of their first face, connected and valid, no more than the limit."""
    ids = [piece.ids for piece in result.pieces]
    assert np.array_equal(np.sort(np.concatenate(ids)), np.arange(len(surface.faces)))
    assert [int(part.min()) for part in ids] == sorted(int(part.min()) for part in ids)
    assert len(result.pieces) <= most
    for piece in result.pieces:
        flat, corners = piece.flat, piece.flat.uv[piece.flat.surface.faces]
        assert np.array_equal(flat.surface.triangles, surface.triangles[piece.ids])
        assert components(flat.surface.faces).max() == 0
        assert is_manifold(flat.surface.faces)
        assert not flipped_triangles(corners).any()
        assert len(overlapping_pairs(corners)) == 0
        assert (piece.method == "slit") == (piece.slits > 0.0)
    assert np.isfinite(result.objective)


def test_one_triangle_is_one_chart() -> None:
    triangle = in_ball(np.eye(3), np.array([[0, 1, 2]]))
    result = finished(triangle, 3)
    assert_finished(triangle, result, 1)
    assert result.objective == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("charts", [1, 8])
def test_a_tetrahedron_finishes_though_a_cut_needs_two_edges(charts: int) -> None:
    surface = in_ball(*TETRAHEDRON)
    assert_finished(surface, finished(surface, charts), charts)


def test_a_flat_sheet_is_one_chart_without_distortion() -> None:
    cloth = sample("cloth", 12)
    sheet = Surface(cloth.vertices * [1.0, 1.0, 0.0], cloth.faces)
    result = finished(sheet, 1)
    assert_finished(sheet, result, 1)
    assert result.pieces[0].method == "slim"
    assert result.objective < 1e-4


def test_a_tube_in_one_chart_is_slit_along_its_height() -> None:
    tube = sample("tube", 16)
    result = finished(tube, 1)
    assert_finished(tube, result, 1)
    assert result.pieces[0].slits == pytest.approx(2.0 / np.sqrt(2.0 * np.pi), rel=0.03)
    assert result.pieces[0].energy < 1e-3


@pytest.mark.parametrize("charts", [1, 3, 6])
@pytest.mark.parametrize("name", ["sphere", "torus", "tube", "cone", "cloth", "cube"])
def test_solids_finish_within_the_limit(name: str, charts: int) -> None:
    surface = sample(name, 12)
    assert_finished(surface, finished(surface, charts), charts)


@pytest.mark.parametrize(("name", "charts"), [("gyroid", 3), ("bracket", 3), ("bracket", 6)])
def test_high_genus_finishes_with_few_charts(name: str, charts: int) -> None:
    surface = sample(name, 16)
    assert_finished(surface, finished(surface, charts, replace(CONFIG, rounds=0)), charts)


def test_three_sheets_on_one_edge_are_cut_apart() -> None:
    surface = book(6)
    assert (edge_table(surface.faces).edge_count == 3).any()
    result = finished(surface, 1)
    assert_finished(surface, result, 3)
    assert len(result.pieces) == 3
    assert result.objective < 1e-4


@pytest.mark.parametrize("charts", [1, 3, 6])
def test_a_moebius_strip_finishes(charts: int) -> None:
    surface = moebius(30, 4)
    assert_finished(surface, finished(surface, charts), charts)


@pytest.mark.parametrize("charts", [1, 3])
def test_each_component_beyond_the_first_raises_the_limit(charts: int) -> None:
    surface = beside(make_sample("sphere", resolution=8), make_sample("tube", resolution=8), TETRAHEDRON)
    result = finished(surface, charts)
    assert_finished(surface, result, charts + 2)
    assert len(result.pieces) >= 3
    part = components(surface.faces)
    assert all(len(np.unique(part[piece.ids])) == 1 for piece in result.pieces)


@pytest.mark.parametrize("name", ["sphere", "torus"])
def test_what_is_decided_on_the_twin_is_carried_back(name: str) -> None:
    """More faces than the twin may have: charts are found on it, and are valid on the surface itself."""
    surface = sample(name, 40)
    config = replace(CONFIG, surrogate_faces=300, rounds=1)
    assert len(surface.faces) > 1.5 * config.surrogate_faces
    assert_finished(surface, finished(surface, 4, config), 4)


def test_stages_are_named_as_they_begin() -> None:
    surface, names = sample("sphere", 40), []
    finish(surface, voronoi(4), 4, replace(CONFIG, surrogate_faces=300, rounds=0), names.append)
    assert len(names) >= 3
    assert names[0] == "split and merge"
    assert "carry labels back" in names
    assert names[-1] == "exact check"


def test_the_same_input_gives_the_same_charts_to_the_last_bit() -> None:
    surface = sample("torus", 16)
    first, second = (finished(surface, 3) for _ in range(2))
    assert first.objective == second.objective
    for one, other in zip(first.pieces, second.pieces, strict=True):
        assert one.ids.tobytes() == other.ids.tobytes()
        assert one.flat.uv.tobytes() == other.flat.uv.tobytes()


def test_components_are_counted_across_manifold_edges() -> None:
    surface = book(2)
    graph = dual_graph(surface, edge_table(surface.faces), 0.0)
    assert component_count(graph, len(surface.faces)) == 3


def test_the_exact_check_refuses_flips_and_overlaps() -> None:
    sheet = sample("cloth", 4)
    piece = make_piece(sheet, np.arange(len(sheet.faces)), 4.0, CONFIG)
    assert piece is not None
    verify([piece])
    flipped = replace(piece, flat=piece.flat._replace(uv=piece.flat.uv * [1.0, -1.0]))
    with pytest.raises(FinishError, match=f"chart 1 of {len(sheet.faces)} faces has {len(sheet.faces)} flipped"):
        verify([piece, flipped])
    folded = piece.flat.uv.copy()
    folded[:, 0] = np.abs(folded[:, 0] - np.median(folded[:, 0]))
    with pytest.raises(FinishError, match="overlapping pairs"):
        verify([replace(piece, flat=piece.flat._replace(uv=folded))])


def test_a_flip_that_slips_in_is_never_returned(monkeypatch: pytest.MonkeyPatch) -> None:
    def mirror(search: Regrouping, *_: object, **__: object) -> None:
        for key, piece in search.pieces.items():
            search.pieces[key] = replace(piece, flat=piece.flat._replace(uv=piece.flat.uv * [1.0, -1.0]))

    monkeypatch.setattr(Regrouping, "relieve_all", mirror)
    with pytest.raises(FinishError, match="flipped triangles"):
        finished(sample("cloth", 6), 1)


def test_the_limit_holds_on_the_surface_itself_too() -> None:
    """Though the twin left more charts than that."""
    surface, twin = sample("sphere", 24), sample("sphere", 12)
    found = regrouped(twin, voronoi(6), 6, replace(CONFIG, rounds=0))
    assert len(found.pieces) > 2
    carried = carried_back(surface, twin, found, 2, CONFIG)
    assert len(carried.pieces) == 2
    assert_finished(surface, Finished(sorted(carried.pieces.values(), key=lambda piece: int(piece.ids.min())), 0.0), 2)


def test_a_real_mesh_finishes_with_eight_charts(models: Path) -> None:
    source = load_asset(models / "suzanne.obj").surface
    surface = in_ball(source.vertices, source.faces)
    graph = dual_graph(surface, edge_table(surface.faces), 0.0)
    limit = 8 + component_count(graph, len(surface.faces)) - 1
    assert_finished(surface, finished(surface, 8, replace(CONFIG, rounds=0), labels=8), limit)

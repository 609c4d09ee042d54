"""From a surface to charts: flat things exactly, balls at any size, copies solved once, soups and real meshes valid."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.errors import FinishError
from flexpara.runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from flexpara.runtime.geometry.topology import components, edge_table
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.mesh import Surface
from flexpara.runtime.process.deadline import Deadline
from flexpara.runtime.process.progress import Stages
from flexpara.runtime.samples import make_sample
from flexpara.train.charts import charts as module
from flexpara.train.charts.charts import Finished, chart_surface
from flexpara.train.charts.objective import objective
from flexpara.train.charts.proof import verify
from flexpara.train.charts.starts import Known
from flexpara.train.config import FinishConfig
from flexpara.train.finish.flatten import jacobians
from flexpara.train.search.config import StartConfig
from flexpara.train.search.search import Search

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

# small proxies and one start: what is tested here holds for any
CONFIG = FinishConfig(proxy_faces=300, fewest_faces=200, rounds=1, start=StartConfig(counts=(0.5,)))


def charted(surface: Surface, charts: int = 8, config: FinishConfig = CONFIG, seed: int = 0) -> Finished:
    return chart_surface(surface, charts, config, seed, Stages())


def assert_valid(found: Finished, surface: Surface) -> None:
    """Each face once, in its own place, unflipped and not overlapped; charts in the order of their first faces."""
    ids = np.concatenate([piece.ids for piece in found.pieces])
    assert np.array_equal(np.sort(ids), np.arange(len(surface.faces)))
    assert (np.diff([piece.ids.min() for piece in found.pieces]) > 0).all()
    for piece in found.pieces:
        uv = piece.flat.uv[piece.flat.surface.faces]
        assert np.array_equal(piece.flat.surface.triangles, surface.triangles[piece.ids])
        assert not flipped_triangles(uv).any()
        assert len(overlapping_pairs(uv)) == 0


def stretch(found: Finished) -> float:
    """The greatest singular value, or inverse of the least, of any face."""
    sigma = np.concatenate(
        [np.linalg.svd(jacobians(p.flat.surface, p.flat.uv), compute_uv=False).ravel() for p in found.pieces]
    )
    return float(np.maximum(sigma, 1.0 / sigma).max())


def charts_of(found: Finished) -> list[list[int]]:
    return [sorted(piece.ids.tolist()) for piece in found.pieces]


@pytest.mark.parametrize(
    ("name", "charts"),
    [
        ("quad", 1),
        ("box", 1),
        ("fine box", 1),
        ("cube", 2),
        ("tube", 1),
        ("cone", 1),
        ("frustum", 1),
        ("capped cylinder", 3),
        ("prism", 2),
        ("L-bracket", 3),
        ("stairs", 2),
    ],
)
def test_what_is_made_of_facets_is_unfolded_without_stretch(
    name: str, charts: int, solid: Callable[[str], Surface]
) -> None:
    surface = solid(name)
    found = charted(surface)
    assert_valid(found, surface)
    assert len(found.pieces) <= charts
    assert stretch(found) <= 1.0001


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_facets_stay_exact_at_any_size_and_in_any_position(
    size: float, solid: Callable[[str], Surface], moved: Callable[..., Surface]
) -> None:
    surface = moved(solid("capped cylinder"), size=size)
    found = charted(surface)
    assert_valid(found, surface)
    assert len(found.pieces) == 3
    assert stretch(found) <= 1.0001


def test_one_triangle_is_one_chart() -> None:
    triangle = Surface(np.array([[0.0, 0, 0], [2, 0, 0], [0, 1, 5]]), np.array([[0, 1, 2]]))
    found = charted(triangle)
    assert_valid(found, triangle)
    assert found.objective == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("name", "resolution"), [("sphere", 24), ("torus", 14), ("cloth", 16)])
def test_a_curved_surface_gets_valid_charts_of_little_stretch(name: str, resolution: int) -> None:
    surface = Surface(*make_sample(name, resolution=resolution))
    found = charted(surface)
    assert_valid(found, surface)
    assert len(found.pieces) <= 8
    assert sum(piece.energy for piece in found.pieces) < CONFIG.most_excess
    assert {piece.method for piece in found.pieces} <= {"slim", "slit"}


def test_a_drilled_bracket_is_unfolded_but_for_nothing_curved() -> None:
    """Its bores are prisms: every face lies in a facet."""
    pytest.importorskip("manifold3d")
    surface = Surface(*make_sample("bracket", resolution=12))
    found = charted(surface)
    assert_valid(found, surface)
    assert sum(piece.energy for piece in found.pieces) < 0.01


def test_a_ball_gets_the_same_charts_and_stretch_at_any_size() -> None:
    ball = Surface(*make_sample("sphere", resolution=12))
    large = Surface(4.0 * ball.vertices, ball.faces)  # a power of two: not a bit is rounded otherwise
    first, second = charted(ball), charted(large)
    assert charts_of(first) == charts_of(second)
    assert first.objective == pytest.approx(second.objective)
    for a, b in zip(first.pieces, second.pieces, strict=True):
        np.testing.assert_allclose(4.0 * a.flat.uv, b.flat.uv, rtol=1e-9, atol=1e-9)


def test_the_seed_decides_and_nothing_else() -> None:
    surface = Surface(*make_sample("torus", resolution=12))
    first, second = charted(surface, seed=3), charted(surface, seed=3)
    assert all(a.flat.uv.tobytes() == b.flat.uv.tobytes() for a, b in zip(first.pieces, second.pieces, strict=True))


def test_a_part_gets_the_same_charts_alone_and_among_others(
    solid: Callable[[str], Surface], together: Callable[..., Surface]
) -> None:
    """Among others it is searched no less, as long as it is not small beside them."""
    torus = Surface(*make_sample("torus", resolution=12))
    box = solid("box")
    both = together(torus, Surface(0.3 * box.vertices + 9.0, box.faces))
    alone, among = charts_of(charted(torus)), charts_of(charted(both))
    assert among[: len(alone)] == alone
    assert len(among) == len(alone) + 1


@pytest.mark.parametrize("mirrored", [False, True])
def test_copies_are_solved_once_and_charted_alike(
    mirrored: bool,
    together: Callable[..., Surface],
    moved: Callable[..., Surface],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    vertices, faces = make_sample("torus", resolution=12)
    ring = Surface(vertices * [1.0, 1.3, 1.7], faces)
    surface = together(ring, moved(ring, size=0.5, mirrored=mirrored), moved(ring, seed=5))
    solved: list[int] = []
    solve = module.solve_part
    monkeypatch.setattr(module, "solve_part", lambda *args: solved.append(1) or solve(*args))
    found = charted(surface, 4)
    assert_valid(found, surface)
    assert len(solved) == 1
    per_part = np.bincount([int(piece.ids.min()) // len(faces) for piece in found.pieces])
    assert len(set(per_part.tolist())) == 1
    energy = [
        sum(p.energy for p in found.pieces if p.ids.min() // len(faces) == part) / size**2
        for part, size in ((0, 1.0), (1, 0.5), (2, 1.0))
    ]
    assert energy == pytest.approx([energy[0]] * 3, rel=1e-3)


def test_the_objective_is_that_of_the_whole_surface(
    solid: Callable[[str], Surface], together: Callable[..., Surface]
) -> None:
    """Two unfolded boxes: no stretch, and the price of eight of twelve edges each, in √(area of both)."""
    cube = solid("cube")
    surface = together(cube, Surface(cube.vertices + 5.0, cube.faces))
    found = charted(surface)
    assert found.objective == pytest.approx(CONFIG.slit.price * 2 * 8.0 / np.sqrt(12.0))
    assert objective(surface, found.pieces, 1.0) == pytest.approx(2 * 8.0 / np.sqrt(12.0))


def test_learned_scores_take_the_place_of_geometry() -> None:
    """The one start of the search is labels of the scores at the faces, in the surface's own units."""
    vertices, faces = make_sample("sphere", resolution=12)
    ball = Surface(3.0 * vertices + 50.0, faces)
    asked: list[np.ndarray] = []

    def scores(points: np.ndarray) -> np.ndarray:
        asked.append(points)
        return -np.logaddexp(0.0, np.array([-9.0, 9.0]) * (points[:, 2:] - 50.0))

    curved = replace(CONFIG, planar=replace(CONFIG.planar, most=0))  # no unfolding is tried
    found = chart_surface(ball, 2, curved, 0, Stages(), Known(scores))
    assert_valid(found, ball)
    assert len(asked) == 1
    np.testing.assert_allclose(asked[0], ball.triangles.mean(axis=1), atol=1e-9)


def test_stages_are_named_in_turn() -> None:
    named: list[str] = []

    def begun(stage: str, step: int, steps: int, loss: float | None = None) -> None:
        if (step, steps, loss) == (0, 1, None):
            named.append(stage)

    chart_surface(Surface(*make_sample("cube", resolution=8)), 8, CONFIG, 0, Stages(begun))
    assert named == ["parts", "charts", "exact check"]


def test_a_search_that_is_asked_to_end_is_valid_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    surface, deadline, splits = Surface(*make_sample("trefoil", resolution=48)), Deadline(), []
    plain = Search.improve
    monkeypatch.setattr(Search, "improve", lambda self, most: splits.append(1) or plain(self, most))
    deadline.ask()
    found = chart_surface(surface, 8, CONFIG, 0, Stages(deadline=deadline))
    assert_valid(found, surface)
    assert splits == []
    assert any("on request" in note for note in found.notes)


def test_a_budget_names_itself_and_none_leaves_no_note() -> None:
    surface = Surface(*make_sample("torus", resolution=32))
    hurried = chart_surface(surface, 8, CONFIG, 0, Stages(deadline=Deadline(0.01)))
    assert any("time budget of 0.01 s" in note for note in hurried.notes)
    assert_valid(hurried, surface)
    assert not any("ended" in note for note in chart_surface(surface, 8, CONFIG, 0, Stages()).notes)


def test_sheets_on_one_edge_and_slivers_are_charted() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0.5, 1e-12, 1.0]])
    book = Surface(vertices, np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4], [4, 1, 5]]))
    found = charted(book)
    assert_valid(found, book)


@pytest.mark.parametrize("seed", range(3))
def test_a_soup_of_random_triangles_is_charted(seed: int) -> None:
    rng = np.random.default_rng(seed)
    soup = Surface(rng.normal(size=(60, 3)), np.arange(60).reshape(20, 3))
    found = charted(soup)
    assert_valid(found, soup)
    assert len(found.pieces) == 20
    assert stretch(found) <= 1.0001


def test_an_invalid_chart_is_a_defect_that_names_it(solid: Callable[[str], Surface]) -> None:
    (piece,) = charted(solid("box")).pieces
    broken = replace(piece, flat=piece.flat._replace(uv=piece.flat.uv * [-1.0, 1.0]))
    with pytest.raises(FinishError, match=r"chart 1 of 12 faces has 12 flipped triangles"):
        verify([piece, broken])


def test_the_source_is_not_written_to() -> None:
    ball = Surface(*make_sample("sphere", resolution=12))
    vertices, faces = ball.vertices.copy(), ball.faces.copy()
    charted(ball)
    assert np.array_equal(ball.vertices, vertices)
    assert np.array_equal(ball.faces, faces)


@pytest.mark.parametrize(("name", "seams", "excess"), [("spot", 8.0, 0.02), ("suzanne", 16.0, 0.03)])
def test_a_real_mesh_gets_few_charts_of_little_stretch_and_short_seams(
    name: str, seams: float, excess: float, models: Path
) -> None:
    surface = load_asset(models / f"{name}.obj").surface
    found = charted(surface)
    assert_valid(found, surface)
    assert len(found.pieces) <= 8 * (1 + int(components(surface.faces, edge_table(surface.faces)).max()))
    energy = sum(piece.energy for piece in found.pieces)
    assert energy < excess
    assert (found.objective - energy) / CONFIG.slit.price < seams


def test_a_spiral_ribbon_beside_something_larger_ends_though_it_costs_nothing() -> None:
    """Searched as one of little area, it unfolds exactly: a cost that a rounding took below zero was behind itself."""
    turn = np.linspace(0.0, 6.0 * np.pi, 200)
    radius = 1.0 + turn / 9.0
    edge = np.round(np.stack([3.0 + np.cos(turn) * radius, np.sin(turn) * radius, 0.0 * turn], axis=1), 6)
    k = np.arange(199)
    faces = np.concatenate([np.stack([k, k + 1, k + 200], axis=1), np.stack([k + 1, k + 201, k + 200], axis=1)])
    ribbon = np.concatenate([edge, edge + np.array([0.0, 0.0, 0.3])])
    far = np.array([[50.0, 0.0, 0.0], [70.0, 0.0, 0.0], [50.0, 20.0, 0.0]])
    both = Surface(np.concatenate([ribbon, far]), np.concatenate([faces, [[400, 401, 402]]]))
    found = charted(both)
    assert_valid(found, both)
    assert stretch(found) <= 1.0001

"""Split and merge: strips and sheets by hand, coplanar halves, a dumbbell, solids under a limit.

A *dumbbell* is two balls joined by a thin neck: the place to cut is known.
"""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("igl")

from typing import TYPE_CHECKING

from flexpara.runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from flexpara.runtime.geometry.topology import components, edge_table
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.config import FinishConfig
from flexpara.train.finish.labels import DualGraph, connected_pieces, dual_graph
from flexpara.train.finish.regroup import (
    Regrouping,
    connected_parts,
    dual_distance,
    halves,
    inner_pairs,
    neck_length,
    necks,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flexpara.train.finish.pieces import Piece

CONFIG = FinishConfig()
PRICE = CONFIG.relief.price
NECK = 0.15
FAR_APART = np.array([3.0, 0.0, 0.0])


def sample(name: str, resolution: int) -> Surface:
    return Surface(*make_sample(name, resolution=resolution))


def graph_of(surface: Surface) -> DualGraph:
    return dual_graph(surface, edge_table(surface.faces), CONFIG.labels.crease_discount)


def search_of(surface: Surface, label: NDArray[np.int64]) -> Regrouping:
    """A search that starts from the connected pieces of these labels."""
    graph = graph_of(surface)
    search = Regrouping(surface, graph, CONFIG)
    piece = connected_pieces(label, graph)
    for number in range(int(piece.max()) + 1):
        search.add_valid(np.flatnonzero(piece == number))
    return search


def flat_sheet(resolution: int) -> Surface:
    cloth = sample("cloth", resolution)
    return Surface(cloth.vertices * [1.0, 1.0, 0.0], cloth.faces)


def dumbbell(around: int = 12) -> Surface:
    """Balls of radius 0.4 at z = ±0.6, joined by a neck of radius NECK; the poles are closed by a vertex each."""
    z = np.linspace(-1.0, 1.0, 2 * around + 1)[1:-1]
    radius = np.maximum(np.sqrt(np.maximum(0.16 - (np.abs(z) - 0.6) ** 2, 0.0)), NECK)
    turn = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)[:, None]
    ring = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.tile(z, (around, 1))], axis=-1)
    corner = np.arange(around * len(z)).reshape(around, len(z))
    right = np.roll(corner, -1, axis=0)
    a, b, c, d = (part.ravel() for part in (corner[:, :-1], right[:, :-1], right[:, 1:], corner[:, 1:]))
    north, south = np.full(around, corner.size), np.full(around, corner.size + 1)
    caps = [
        np.stack([corner[:, -1], right[:, -1], north], axis=1),
        np.stack([right[:, 0], corner[:, 0], south], axis=1),
    ]
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1), *caps])
    return Surface(np.concatenate([ring.reshape(-1, 3), [[0.0, 0, 1], [0.0, 0, -1]]]), faces)


def assert_valid(surface: Surface, pieces: list[Piece]) -> None:
    """All faces, each once, in connected pieces without flips and overlap."""
    assert np.array_equal(np.sort(np.concatenate([piece.ids for piece in pieces])), np.arange(len(surface.faces)))
    for piece in pieces:
        corners = piece.flat.uv[piece.flat.surface.faces]
        assert np.array_equal(piece.flat.surface.triangles, surface.triangles[piece.ids])
        assert components(surface.faces[piece.ids]).max() == 0
        assert not flipped_triangles(corners).any()
        assert len(overlapping_pairs(corners)) == 0


def octants(surface: Surface) -> NDArray[np.int64]:
    return (surface.triangles.mean(axis=1) > 0.0).astype(np.int64) @ np.array([1, 2, 4])


def fan() -> tuple[Surface, DualGraph]:
    """Four faces in a row: 0 – 1 – 2 – 3, joined along edges of length 1, √2, 1."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0], [1, 2, 0]])
    surface = Surface(vertices, np.array([[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]]))
    return surface, graph_of(surface)


def test_inner_pairs_are_the_joints_between_chosen_faces() -> None:
    _, graph = fan()
    i, j, length = inner_pairs(np.array([3, 2, 0]), graph, 4)
    assert sorted([int(i[0]), int(j[0])]) == [0, 1]
    assert length == pytest.approx([np.sqrt(2.0)])


def test_distance_runs_over_centroids_inside_the_piece() -> None:
    surface, graph = fan()
    centroids = surface.triangles.mean(axis=1)
    step = np.linalg.norm(centroids[1:] - centroids[:-1], axis=1)
    assert dual_distance(np.arange(4), graph, centroids, 0) == pytest.approx([0.0, *np.cumsum(step)])
    assert dual_distance(np.array([1, 0, 3]), graph, centroids, 0) == pytest.approx([step[0], 0.0, np.inf])


def test_cutting_a_row_in_the_middle_leaves_three_parts() -> None:
    _, graph = fan()
    parts = connected_parts(np.arange(4), np.array([False, True, True, False]), graph)
    assert sorted(part.tolist() for part in parts) == [[0], [1, 2], [3]]
    assert neck_length(np.array([1, 2]), [np.array([0]), np.array([3])], graph, 4) == pytest.approx(2.0 * np.sqrt(2.0))


def test_a_neck_counts_borders_to_the_given_parts_only() -> None:
    _, graph = fan()
    assert neck_length(np.array([1, 2]), [np.array([0])], graph, 4) == pytest.approx(np.sqrt(2.0))


@pytest.mark.parametrize("name", ["cloth", "tube", "torus"])
def test_halves_are_connected_and_about_as_many_faces(name: str) -> None:
    surface = sample(name, 16)
    graph, centroids = graph_of(surface), surface.triangles.mean(axis=1)
    parts = halves(np.arange(len(surface.faces)), graph, centroids, 0)
    assert np.array_equal(np.sort(np.concatenate(parts)), np.arange(len(surface.faces)))
    assert all(components(surface.faces[part]).max() == 0 for part in parts)
    assert len(parts) >= 2
    near = next(part for part in parts if 0 in part)
    assert len(near) / len(surface.faces) == pytest.approx(0.5, abs=0.05)


def test_two_faces_at_equal_distance_are_halved_too() -> None:
    """Else a piece that can't be flattened would be halved for ever."""
    vertices = np.array([[0.0, 0, 0], [2, 0, 0], [1, 2, 0], [-1, 2, 0], [3, 2, 0]])
    surface = Surface(vertices, np.array([[0, 1, 2], [2, 3, 0], [1, 4, 2]]))
    parts = halves(np.arange(3), graph_of(surface), surface.triangles.mean(axis=1), 0)
    assert len(parts) >= 2


def test_the_best_neck_of_a_dumbbell_is_its_neck() -> None:
    surface = dumbbell()
    graph, centroids = graph_of(surface), surface.triangles.mean(axis=1)
    ids = np.arange(len(surface.faces))
    found = necks(ids, graph, centroids, surface.face_areas(), int(centroids[:, 2].argmax()), 2)
    assert 1 <= len(found) <= 2
    best = min(found, key=lambda parts: neck_length(parts[0], parts[1:], graph, len(ids)))
    assert len(best) == 2
    assert neck_length(best[0], best[1:], graph, len(ids)) < 2.0 * 2.0 * np.pi * NECK  # isolines run in zigzags
    assert {bool((centroids[part][:, 2] > -0.3).all() or (centroids[part][:, 2] < 0.3).all()) for part in best} == {
        True
    }


def test_objective_of_a_halved_sheet_is_the_price_of_its_border() -> None:
    sheet = flat_sheet(12)
    search = search_of(sheet, (sheet.triangles.mean(axis=1)[:, 0] > 0.0).astype(np.int64))
    assert search.borders() == pytest.approx({(0, 1): 2.0 / 2.0})
    assert search.objective() == pytest.approx(PRICE, rel=1e-3)
    assert np.unique(search.label()).tolist() == [0, 1]


def test_merging_coplanar_halves_gains_their_border() -> None:
    sheet = flat_sheet(12)
    search = search_of(sheet, (sheet.triangles.mean(axis=1)[:, 0] > 0.0).astype(np.int64))
    found = search.best_merge(set(), 0.0)
    assert found is not None
    gain, pair, merged = found
    assert pair == (0, 1)
    assert gain == pytest.approx(PRICE, rel=1e-2)
    search.apply_merge(pair, merged)
    assert_valid(sheet, list(search.pieces.values()))
    assert search.objective() == pytest.approx(0.0, abs=1e-5)
    assert search.borders() == {}


def test_halves_of_a_sphere_are_not_worth_a_merge() -> None:
    """One chart of a whole sphere costs more than a seam around the equator."""
    sphere = sample("sphere", 24)
    search = search_of(sphere, (sphere.triangles.mean(axis=1)[:, 2] > 0.0).astype(np.int64))
    assert search.best_merge(set(), 0.0) is None
    assert search.best_merge(set(), -np.inf) is not None


def test_excluded_pieces_are_not_merged() -> None:
    sheet = flat_sheet(12)
    search = search_of(sheet, np.digitize(sheet.triangles.mean(axis=1)[:, 0], [-0.3, 0.3]))
    left, middle, right = (
        int(search.label()[face]) for face in sheet.vertices[sheet.faces[:, 0]][:, 0].argsort()[[0, 144, -1]]
    )
    found = search.best_merge({left}, 0.0)
    assert found is not None
    assert set(found[1]) == {middle, right}
    assert search.best_merge({middle}, 0.0) is None


def test_a_dumbbell_is_split_at_its_neck() -> None:
    surface = dumbbell()
    search = search_of(surface, np.zeros(len(surface.faces), dtype=np.int64))
    before = search.objective()
    search.search(2)
    assert len(search.pieces) == 2
    assert_valid(surface, list(search.pieces.values()))
    assert search.objective() < before
    (neck,) = search.borders().values()
    assert neck * search.unit < 2.0 * 2.0 * np.pi * NECK  # isolines run in zigzags
    height = [float(surface.triangles[piece.ids].mean(axis=(0, 1))[2]) for piece in search.pieces.values()]
    assert min(height) < -0.3 < 0.3 < max(height)


def test_a_split_without_room_is_paid_for_by_a_merge_elsewhere() -> None:
    """A dumbbell as one piece beside a sheet needlessly in two: with three pieces at most, the sheet is made whole."""
    bell, sheet = dumbbell(10), flat_sheet(6)
    vertices = np.concatenate([bell.vertices, sheet.vertices + FAR_APART])
    both = Surface(vertices, np.concatenate([bell.faces, sheet.faces + len(bell.vertices)]))
    right = both.triangles.mean(axis=1)[:, 0] > 3.0
    search = search_of(both, right.astype(np.int64))
    assert len(search.pieces) == 3
    search.search(3)
    assert len(search.pieces) == 3
    assert_valid(both, list(search.pieces.values()))
    sizes = sorted(len(piece.ids) for piece in search.pieces.values() if piece.ids.min() >= len(bell.faces))
    assert sizes == [len(sheet.faces)]


@pytest.mark.parametrize("most", [1, 4])
@pytest.mark.parametrize("name", ["sphere", "torus", "cube"])
def test_the_limit_holds_and_every_piece_is_valid(name: str, most: int) -> None:
    surface = sample(name, 12)
    search = search_of(surface, octants(surface))
    assert len(search.pieces) >= 8
    search.search(most)
    assert 1 <= len(search.pieces) <= most
    assert_valid(surface, list(search.pieces.values()))


def test_the_search_never_ends_worse_than_it_began_where_there_is_room() -> None:
    surface = sample("cube", 12)
    search = search_of(surface, (surface.triangles.mean(axis=1)[:, 2] > 0.0).astype(np.int64))
    before = search.objective()
    search.search(8)
    assert search.objective() <= before


def test_components_are_never_merged() -> None:
    sphere = sample("sphere", 5)
    vertices = np.concatenate([sphere.vertices, sphere.vertices + FAR_APART])
    both = Surface(vertices, np.concatenate([sphere.faces, sphere.faces + len(sphere.vertices)]))
    search = search_of(both, np.zeros(len(both.faces), dtype=np.int64))
    search.search(1)
    assert len(search.pieces) == 2


class Fussy(Regrouping):
    """A search that takes only small pieces for valid."""

    def weigh(self, ids: NDArray[np.int64], *rest: object, **options: object) -> Piece | None:
        return super().weigh(ids, *rest, **options) if len(ids) <= 60 else None  # pyright: ignore[reportArgumentType]


def test_what_cannot_be_flattened_is_halved_until_it_can() -> None:
    surface = sample("cloth", 12)
    search = Fussy(surface, graph_of(surface), CONFIG)
    search.add_valid(np.arange(len(surface.faces)))
    assert len(search.pieces) >= len(surface.faces) // 60
    assert max(len(piece.ids) for piece in search.pieces.values()) <= 60
    assert_valid(surface, list(search.pieces.values()))

"""Unfolding: two squares by hand, then solids whose nets are known; exact, and no flat face is cut."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh

from flexpara.runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.geometry.triangles import edge_lengths
from flexpara.runtime.kernel.choice import kernel, twins_only
from flexpara.runtime.mesh import Surface
from flexpara.train.charts.develop import Development, Unfolding, rigid_motion, unfold
from flexpara.train.charts.planar import flat_regions
from flexpara.train.config import PlanarConfig

if TYPE_CHECKING:
    from collections.abc import Callable

    from flexpara.runtime.mesh import Surface

CONFIG = PlanarConfig()
FACETED = [
    "quad",
    "box",
    "cube",
    "fine box",
    "tube",
    "capped cylinder",
    "cone",
    "frustum",
    "prism",
    "L-bracket",
    "stairs",
]


def developments(surface: Surface, config: PlanarConfig = CONFIG) -> list[Development]:
    table = edge_table(surface.faces)
    return unfold(surface, table, flat_regions(surface, table, config), config)


def unfolding(surface: Surface) -> Unfolding:
    table = edge_table(surface.faces)
    return Unfolding(surface, table, flat_regions(surface, table, CONFIG), CONFIG)


def corner_uv(surface: Surface, found: list[Development]) -> np.ndarray:
    """(f, 3, 2) of the whole surface."""
    uv = np.zeros((len(surface.faces), 3, 2))
    for development in found:
        uv[development.ids] = development.uv
    return uv


def joined_edges(surface: Surface, found: list[Development]) -> tuple[np.ndarray, np.ndarray]:
    """Both (e,) bool, of manifold edges: the two faces have one uv there; and they are in one flat region."""
    table = edge_table(surface.faces)
    uv, region = corner_uv(surface, found), flat_regions(surface, table, CONFIG)
    owner = np.zeros(len(surface.faces), dtype=np.int64)
    for number, development in enumerate(found):
        owner[development.ids] = number
    joined, flat = [], []
    for edge in np.flatnonzero(table.manifold).tolist():
        a, b = table.edge_faces[edge].tolist()
        places = [[uv[f][surface.faces[f] == v][0] for v in table.edges[edge]] for f in (a, b)]
        joined.append(owner[a] == owner[b] and np.array_equal(places[0], places[1]))
        flat.append(region[a] == region[b])
    return np.array(joined), np.array(flat)


def test_a_motion_brings_one_segment_onto_another() -> None:
    moving, fixed = np.array([[0.0, 0], [2, 0]]), np.array([[5.0, 1], [5, 3]])
    turn, shift = rigid_motion(moving, fixed)
    np.testing.assert_allclose(moving @ turn.T + shift, fixed, atol=1e-12)
    np.testing.assert_allclose(turn, [[0.0, -1.0], [1.0, 0.0]], atol=1e-12)


def test_segments_of_unequal_length_meet_at_their_midpoints() -> None:
    turn, shift = rigid_motion(np.array([[0.0, 0], [4, 0]]), np.array([[0.0, 0], [2, 0]]))
    np.testing.assert_allclose(np.array([2.0, 0.0]) @ turn.T + shift, [1.0, 0.0], atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1.0)


def test_a_square_fills_its_rectangle_and_a_triangle_half_of_it_however_turned() -> None:
    square = np.array([[[0.0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]])
    turn = np.array([[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]])
    assert Development(np.arange(2), square, 4.0).fill == pytest.approx(1.0)
    assert Development(np.arange(2), square @ turn.T + 7.0, 4.0).fill == pytest.approx(1.0)
    assert Development(np.arange(1), square[:1] @ turn.T, 4.0).fill == pytest.approx(0.5)


def test_the_border_of_a_square_facet_is_four_edges(solid: Callable[[str], Surface]) -> None:
    (development,) = developments(solid("quad"))
    assert development.perimeter == pytest.approx(6.0)
    state = unfolding(solid("cube"))
    assert [member.perimeter for member in state.members.values()] == pytest.approx([4.0] * 6)


def test_two_sides_of_a_cube_join_along_their_common_edge(solid: Callable[[str], Surface]) -> None:
    state = unfolding(solid("cube"))
    (first, second), edges = next(iter(state.shared_edges().items()))
    share, hinge = state.best_hinge(first, second, edges)
    assert share == pytest.approx(0.25)
    assert np.array_equal(np.sort(hinge.edges), edges)
    whole = state.joined(first, second, hinge)
    assert whole is not None
    assert whole.perimeter == pytest.approx(6.0)
    assert whole.fill == pytest.approx(1.0)


@pytest.mark.parametrize("name", FACETED)
def test_an_unfolding_is_exact_and_valid_and_holds_each_face_once(name: str, solid: Callable[[str], Surface]) -> None:
    surface = solid(name)
    found = developments(surface)
    assert np.array_equal(np.sort(np.concatenate([d.ids for d in found])), np.arange(len(surface.faces)))
    uv = corner_uv(surface, found)
    np.testing.assert_allclose(edge_lengths(uv), edge_lengths(surface.triangles), rtol=1e-4)
    for development in found:
        assert not flipped_triangles(development.uv).any()
        assert len(overlapping_pairs(development.uv)) == 0
        assert (np.diff(development.ids) > 0).all()
        assert development.fill >= CONFIG.fill


@pytest.mark.skipif(kernel() is None, reason="nothing was compiled")
@pytest.mark.parametrize("name", FACETED)
def test_the_kernel_unfolds_as_its_twin_does(name: str, solid: Callable[[str], Surface]) -> None:
    found = developments(solid(name))
    with twins_only():
        expected = developments(solid(name))
    assert [one.ids.tolist() for one in found] == [one.ids.tolist() for one in expected]
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one.uv, other.uv, atol=1e-9)
        assert one.perimeter == pytest.approx(other.perimeter)


@pytest.mark.parametrize("side", [0.0, 40.0])
def test_a_strip_may_be_as_long_as_the_page_that_it_shares(side: float) -> None:
    """A bent ribbon forty times as long as wide, of squares that meet at their ends."""
    along = np.cumsum([[0.0, 0.0], *([np.cos(0.1 * n), np.sin(0.1 * n)] for n in range(40))], axis=0)
    vertices = np.concatenate([np.column_stack([along, np.full(41, z)]) for z in (0.0, 1.0)])
    faces = np.array([tri for n in range(40) for tri in ([n, n + 1, 42 + n], [n, 42 + n, 41 + n])])
    ribbon = Surface(vertices, faces)
    table = edge_table(faces)
    found = unfold(ribbon, table, flat_regions(ribbon, table, CONFIG), CONFIG, side)
    assert (len(found) == 1) == (side > 0.0)


@pytest.mark.parametrize("name", FACETED)
def test_no_flat_face_is_cut(name: str, solid: Callable[[str], Surface]) -> None:
    surface = solid(name)
    joined, flat = joined_edges(surface, developments(surface))
    assert joined[flat].all()


@pytest.mark.parametrize("name", FACETED)
def test_the_perimeter_is_the_length_of_the_edges_that_are_not_joined(
    name: str, solid: Callable[[str], Surface]
) -> None:
    surface = solid(name)
    found = developments(surface)
    table = edge_table(surface.faces)
    ends = surface.vertices[table.edges]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    open_ = 2.0 * length[table.manifold][~joined_edges(surface, found)[0]].sum() + length[table.boundary].sum()
    assert sum(d.perimeter for d in found) == pytest.approx(open_)


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("quad", 1),
        ("box", 1),
        ("cube", 1),
        ("tube", 1),
        ("cone", 1),
        ("frustum", 1),
        ("capped cylinder", 3),
        ("prism", 2),
        ("L-bracket", 2),
        ("stairs", 2),
    ],
)
def test_a_solid_unfolds_into_no_more_charts_than_a_person_would_make(
    name: str, count: int, solid: Callable[[str], Surface]
) -> None:
    assert len(developments(solid(name))) <= count


def test_a_cube_becomes_a_cross_of_six_squares(solid: Callable[[str], Surface]) -> None:
    """Five of twelve edges are joined: 14 sides are left."""
    (cross,) = developments(solid("cube"))
    assert cross.perimeter == pytest.approx(14.0)


def test_a_tube_becomes_a_rectangle_and_a_cone_a_sector(solid: Callable[[str], Surface]) -> None:
    (rectangle,) = developments(solid("tube"))
    chord = 16 * 2.0 * 0.5 * np.sin(np.pi / 16)
    assert rectangle.fill == pytest.approx(1.0)
    assert rectangle.perimeter == pytest.approx(2.0 * (2.0 + chord))
    (sector,) = developments(solid("cone"))
    radius = np.linalg.norm(sector.uv.reshape(-1, 2) - apex_of(sector), axis=1).max()
    assert radius == pytest.approx(np.hypot(0.5, 1.0), rel=1e-6)


def apex_of(sector: Development) -> np.ndarray:
    """Where most corners meet."""
    place, count = np.unique(sector.uv.reshape(-1, 2).round(9), axis=0, return_counts=True)
    return place[count.argmax()]


def test_a_lid_keeps_off_the_rectangle_that_it_shares_too_little_with(solid: Callable[[str], Surface]) -> None:
    found = developments(solid("capped cylinder"))
    assert sorted(len(d.ids) for d in found) == [14, 14, 32]


def test_developments_that_would_sprawl_stay_apart(solid: Callable[[str], Surface]) -> None:
    whole = PlanarConfig(fill=0.99)
    assert all(d.fill >= 0.99 for d in developments(solid("box"), whole))
    assert len(developments(solid("box"), whole)) > 1


@pytest.mark.parametrize("name", ["box", "fine box", "L-bracket", "prism", "capped cylinder", "frustum"])
@pytest.mark.parametrize("seed", range(3))
def test_turning_and_scaling_a_solid_changes_nothing(
    name: str, seed: int, solid: Callable[[str], Surface], moved: Callable[..., Surface]
) -> None:
    """Edges of equal length stay equal however they are rounded."""
    first = developments(solid(name))
    second = developments(moved(solid(name), size=0.37, seed=seed))
    assert [d.ids.tolist() for d in first] == [d.ids.tolist() for d in second]
    assert [0.37 * d.perimeter for d in first] == pytest.approx([d.perimeter for d in second])


@pytest.mark.parametrize("seed", range(4))
def test_stairs_whose_net_touches_itself_stay_valid_however_they_are_turned(
    seed: int, solid: Callable[[str], Surface], moved: Callable[..., Surface]
) -> None:
    """Whether two sides that just touch overlap is decided by the last digit; that they do not, by the exact test."""
    found = developments(moved(solid("stairs"), seed=seed))
    assert len(found) <= 2
    assert all(len(overlapping_pairs(development.uv)) == 0 for development in found)


def test_the_rims_of_a_washer_roll_on_until_they_no_longer_fit_the_page() -> None:
    washer = trimesh.creation.annulus(0.3, 1.0, 0.2, sections=48)
    surface = Surface(np.asarray(washer.vertices), np.asarray(washer.faces))
    found = developments(surface)
    # two rings, the inner rim in one strip, the outer, longer than the page, in two
    assert sorted(len(each.ids) for each in found) == [32, 64, 96, 96, 96]

"""Cleaning: from one triangle by hand to solids whose faces were shuffled, turned and split."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.errors import MeshError
from flexpara.runtime.io.clean import weld
from flexpara.runtime.io.clean.clean import clean
from flexpara.runtime.io.clean.orient import inconsistent_faces
from flexpara.runtime.io.clean.weld import degenerate_faces, weld_vertices
from flexpara.runtime.io.rawmesh import RawMesh
from flexpara.runtime.mesh import Asset
from flexpara.runtime.samples import make_sample

TRIANGLE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
SQUARE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])


def cleaned(positions: np.ndarray, faces: list[list[int]] | np.ndarray) -> Asset:
    return clean(RawMesh(positions=np.asarray(positions, dtype=np.float64), faces=np.asarray(faces, dtype=np.int64)))


def agrees(faces: np.ndarray) -> bool:
    """Slow twin: no directed edge occurs twice."""
    directed = [(int(f[i]), int(f[(i + 1) % 3])) for f in faces for i in range(3)]
    return len(directed) == len(set(directed))


def test_one_triangle_stays_as_it_is() -> None:
    asset = cleaned(TRIANGLE, [[0, 1, 2]])
    assert asset.changes == {}
    np.testing.assert_array_equal(asset.positions, TRIANGLE)
    np.testing.assert_array_equal(asset.surface.vertices, TRIANGLE)
    np.testing.assert_array_equal(asset.faces, [[0, 1, 2]])


def test_equal_positions_weld_in_order_of_first_appearance() -> None:
    positions = np.array([[5.0, 0, 0], [1, 0, 0], [5, 0, 0], [0, 0, 0], [-0.0, 0, 0]])
    np.testing.assert_array_equal(weld_vertices(positions), [0, 1, 0, 2, 2])


@pytest.mark.parametrize(("gap", "count"), [(0.9e-8, 1), (1.1e-8, 2)])
def test_vertices_weld_within_the_tolerance_of_the_diagonal(gap: float, count: int) -> None:
    positions = np.array([[0.0, 0, 0], [gap * 100.0, 0, 0], [100.0, 0, 0]])
    assert len(set(weld_vertices(positions)[:2].tolist())) == count


def test_welded_faces_are_the_weld_of_the_file_faces() -> None:
    soup = SQUARE[[0, 1, 2, 0, 2, 3]]
    asset = cleaned(soup, [[0, 1, 2], [3, 4, 5]])
    assert asset.changes == {"welded_vertices": 2}
    assert len(asset.positions) == 6
    np.testing.assert_array_equal(asset.surface.faces, [[0, 1, 2], [0, 2, 3]])
    np.testing.assert_array_equal(asset.weld[asset.faces], asset.surface.faces)


def test_faces_with_a_repeated_welded_corner_are_dropped() -> None:
    positions = np.vstack([SQUARE, SQUARE[:1]])
    asset = cleaned(positions, [[0, 1, 2], [0, 4, 3], [0, 2, 3]])
    assert asset.changes == {"welded_vertices": 1, "degenerate_faces": 1, "unreferenced_vertices": 1}
    np.testing.assert_array_equal(asset.faces, [[0, 1, 2], [0, 2, 3]])


@pytest.mark.parametrize(("height", "dropped"), [(0.0, True), (1e-15, True), (1e-13, False), (1e-3, False)])
@pytest.mark.parametrize("scale", [1e-30, 1.0, 1e30])
def test_a_sliver_is_kept_while_float64_sees_its_area(height: float, dropped: bool, scale: float) -> None:
    corners = scale * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, height, 0.0]])
    assert degenerate_faces(corners, np.array([[0, 1, 2]])).tolist() == [dropped]


def test_a_face_on_another_stays_and_is_counted() -> None:
    asset = cleaned(SQUARE, [[1, 2, 0], [0, 1, 2], [0, 2, 3], [3, 2, 0], [2, 1, 0]])
    assert asset.changes == {"coincident_faces": 5, "components": 3}
    assert len(asset.faces) == 5
    np.testing.assert_array_equal(asset.positions[asset.faces], asset.surface.triangles)


def test_a_file_vertex_of_two_sheets_is_split_and_takes_its_attributes_along() -> None:
    colors = np.arange(12, dtype=np.uint8).reshape(3, 4)
    raw = RawMesh(positions=TRIANGLE, faces=np.array([[0, 1, 2], [0, 2, 1]]), colors=colors, uv=TRIANGLE[:, :2])
    asset = clean(raw)
    np.testing.assert_array_equal(asset.positions[:3], TRIANGLE)
    np.testing.assert_array_equal(asset.positions[asset.faces], TRIANGLE[[[0, 1, 2], [0, 2, 1]]])
    assert asset.colors is not None
    assert asset.uv is not None
    np.testing.assert_array_equal(asset.colors[asset.faces], colors[[[0, 1, 2], [0, 2, 1]]])
    np.testing.assert_array_equal(asset.uv[asset.faces], TRIANGLE[:, :2][[[0, 1, 2], [0, 2, 1]]])
    assert len(set(asset.surface.faces.ravel().tolist())) == 6


def test_unreferenced_vertices_take_their_attributes_along() -> None:
    positions = np.vstack([[[9.0, 9.0, 9.0]], TRIANGLE])
    raw = RawMesh(
        positions=positions,
        faces=np.array([[1, 2, 3]]),
        normals=np.tile([0.0, 0.0, 1.0], (4, 1)),
        colors=np.arange(16, dtype=np.uint8).reshape(4, 4),
        uv=np.arange(8.0).reshape(4, 2),
    )
    asset = clean(raw)
    assert asset.changes == {"unreferenced_vertices": 1}
    assert asset.colors is not None
    assert asset.uv is not None
    assert asset.normals is not None
    np.testing.assert_array_equal(asset.colors, raw.colors[1:] if raw.colors is not None else ())
    np.testing.assert_array_equal(asset.uv, [[2, 3], [4, 5], [6, 7]])
    assert asset.normals.shape == (3, 3)


def test_a_turned_face_keeps_corner_0_and_swaps_the_others() -> None:
    asset = cleaned(np.vstack([SQUARE, [[2.0, 0, 0]]]), [[0, 1, 2], [0, 3, 2], [1, 4, 2]])
    assert asset.changes == {"flipped_faces": 1}
    np.testing.assert_array_equal(asset.faces, [[0, 1, 2], [0, 2, 3], [1, 4, 2]])


@pytest.mark.parametrize("name", ["sphere", "torus", "trefoil", "tube", "cone", "cloth"])
def test_turned_faces_turn_back_to_the_majority(name: str) -> None:
    vertices, faces = make_sample(name, resolution=24)
    rng = np.random.default_rng(0)
    turned = rng.random(len(faces)) < 0.3
    asset = cleaned(vertices, np.where(turned[:, None], faces[:, [0, 2, 1]], faces))
    np.testing.assert_array_equal(asset.faces, faces)
    assert asset.changes == {"flipped_faces": int(turned.sum())}


def test_an_inside_out_solid_stays_inside_out() -> None:
    vertices, faces = make_sample("sphere", resolution=12)
    asset = cleaned(vertices, faces[:, ::-1])
    assert asset.changes == {}
    np.testing.assert_array_equal(asset.faces, faces[:, ::-1])


def test_each_component_has_its_own_majority() -> None:
    vertices, faces = make_sample("sphere", resolution=12)
    inward = faces[:, [0, 2, 1]].copy()
    inward[:5] = faces[:5]
    both = np.concatenate([vertices, vertices + 5.0])
    asset = cleaned(both, np.concatenate([faces, inward + len(vertices)]))
    assert asset.changes == {"flipped_faces": 5, "components": 2}
    assert agrees(asset.surface.faces)


@pytest.mark.parametrize("seed", range(4))
def test_a_moebius_band_is_left_with_one_disagreement(seed: int) -> None:
    """It is a ring of faces: a spanning tree leaves one edge of it, and that one can't agree."""
    count = 12
    top, bottom = np.arange(count), np.arange(count) + count
    after_top, after_bottom = np.append(top[1:], bottom[0]), np.append(bottom[1:], top[0])
    faces = np.concatenate([np.stack([top, after_top, bottom], 1), np.stack([after_top, after_bottom, bottom], 1)])
    turned = np.random.default_rng(seed).random(len(faces)) < 0.5
    faces = np.where(turned[:, None], faces[:, [0, 2, 1]], faces)
    flip = inconsistent_faces(faces)
    faces = np.where(flip[:, None], faces[:, [0, 2, 1]], faces)
    directed = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    assert len(directed) - len(np.unique(directed, axis=0)) == 1


def test_non_manifold_edges_are_counted_and_allowed() -> None:
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]])
    asset = cleaned(positions, [[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    assert asset.changes == {"non_manifold_edges": 1}
    assert len(asset.faces) == 3


def test_two_faces_that_share_two_edges_do_not_confuse_the_orientation() -> None:
    tent = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 1.0]])
    faces = np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3], [0, 2, 1]])
    faces[2] = faces[2][[0, 2, 1]]
    asset = cleaned(tent, faces)
    assert agrees(asset.surface.faces)
    assert asset.changes == {"flipped_faces": 1}


@pytest.mark.parametrize(
    ("positions", "faces", "message"),
    [
        (np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64), "empty"),
        (TRIANGLE, np.zeros((0, 3), dtype=np.int64), "empty"),
        (TRIANGLE, [[0, 1, 3]], r"face 0 refers to vertices \[0, 1, 3\], expected 0 to 2"),
        (TRIANGLE, [[0, 1, -1]], "face 0 refers"),
        (np.where(np.eye(3) > 0, np.nan, TRIANGLE), [[0, 1, 2]], r"3 of 3 vertices .*first: vertex 0"),
        (np.where(np.arange(3)[:, None] == 2, np.inf, TRIANGLE), [[0, 1, 2]], r"1 of 3 vertices .*first: vertex 2"),
        (TRIANGLE * 1e120, [[0, 1, 2]], "coordinates reach"),
        (TRIANGLE * 1e-120, [[0, 1, 2]], "diagonal"),
        (TRIANGLE * 0.0, [[0, 1, 2]], "diagonal 0"),
        (TRIANGLE, [[0, 0, 1], [1, 2, 1]], "all 2 faces are degenerate"),
        (TRIANGLE * [[1.0, 0.0, 0.0]], [[0, 1, 2]], "all 1 faces are degenerate"),
    ],
)
def test_what_is_no_surface_is_refused(positions: np.ndarray, faces: list[list[int]], message: str) -> None:
    with pytest.raises(MeshError, match=message) as caught:
        cleaned(positions, faces)
    assert "\n" not in str(caught.value)


def test_a_part_far_smaller_than_the_scene_keeps_its_vertices_apart() -> None:
    small = 1e-9 * SQUARE
    asset = cleaned(np.vstack([small, 1.0 + SQUARE]), [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    assert asset.changes == {"components": 2}
    assert len(asset.surface.vertices) == 8


def test_broken_normals_are_those_of_the_surface_and_counted() -> None:
    normals = np.array([[0.0, 0.0, -1.0], [np.nan, 0.0, 1.0], [0.0, 0.0, 0.0]])
    asset = clean(RawMesh(positions=TRIANGLE, faces=np.array([[0, 1, 2]]), normals=normals))
    assert asset.changes == {"repaired_normals": 2}
    np.testing.assert_array_equal(asset.normals, [[0, 0, -1], [0, 0, 1], [0, 0, 1]])


def test_uv_that_are_not_finite_become_0_and_are_counted() -> None:
    uv = np.array([[0.5, 0.5], [np.nan, 1.0], [0.0, np.inf]])
    asset = clean(RawMesh(positions=TRIANGLE, faces=np.array([[0, 1, 2]]), uv=uv))
    assert asset.changes == {"uv_not_finite": 2}
    np.testing.assert_array_equal(asset.uv, [[0.5, 0.5], [0, 0], [0, 0]])


def test_a_part_far_away_does_not_make_all_others_near(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[float] = []

    class Tree(weld.KDTree):
        def query_pairs(self, r: float, *args: object, **kwargs: object) -> object:
            asked.append(r)
            return super().query_pairs(r, *args, **kwargs)  # pyright: ignore[reportArgumentType,reportCallIssue]

    monkeypatch.setattr(weld, "KDTree", Tree)
    positions = np.concatenate([SQUARE, SQUARE + 1e15])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    assert len(set(weld_vertices(positions, faces).tolist())) == 8
    assert asked[0] < 0.1

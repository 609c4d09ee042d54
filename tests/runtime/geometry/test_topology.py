"""Topology: one triangle, by-hand cases, solids with known Euler characteristic, real meshes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import trimesh

from flexpara.runtime.geometry.topology import (
    boundary_loops,
    components,
    edge_table,
    euler_characteristic,
    face_components,
    is_manifold,
    split_non_manifold_vertices,
)

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

TRIANGLE = np.array([[0, 1, 2]])
BOWTIE = np.array([[0, 1, 2], [0, 3, 4]])
BOOK = np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]])
TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
MOEBIUS = np.array([[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4], [4, 5, 1], [5, 0, 1]])


def grid(n: int) -> NDArray[np.int64]:
    corner = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = corner[:-1, :-1].ravel(), corner[:-1, 1:].ravel(), corner[1:, 1:].ravel(), corner[1:, :-1].ravel()
    return np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def welded(path: Path) -> NDArray[np.int64]:
    mesh = trimesh.load_mesh(path, process=False, skip_materials=True)
    _, weld = np.unique(np.asarray(mesh.vertices), axis=0, return_inverse=True)
    return weld.reshape(-1)[np.asarray(mesh.faces, dtype=np.int64)]


def test_one_triangle_has_three_boundary_edges() -> None:
    table = edge_table(TRIANGLE)
    assert table.edges.tolist() == [[0, 1], [0, 2], [1, 2]]
    assert table.face_edges.tolist() == [[0, 2, 1]]
    assert table.edge_faces.tolist() == [[0, -1]] * 3
    assert table.edge_count.tolist() == [1, 1, 1]
    assert not table.interior.any()
    assert table.boundary.all()


def test_edge_i_of_a_face_joins_corner_i_and_the_next() -> None:
    faces = grid(7)
    table = edge_table(faces)
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2), axis=2)
    assert np.array_equal(table.edges[table.face_edges], ends)


def test_each_half_edge_of_the_table_lies_on_its_edge() -> None:
    table = edge_table(grid(5))
    for side in range(2):
        there = table.edge_halfedges[:, side] >= 0
        on_edge = table.face_edges.reshape(-1)[table.edge_halfedges[there, side]]
        assert np.array_equal(on_edge, np.flatnonzero(there))


def test_faces_that_disagree_in_orientation_make_no_manifold_edge() -> None:
    assert edge_table(np.array([[0, 1, 2], [1, 0, 3]])).manifold.sum() == 1
    assert edge_table(np.array([[0, 1, 2], [0, 1, 3]])).manifold.sum() == 0


def test_an_edge_of_three_faces_is_counted_three_times() -> None:
    table = edge_table(BOOK)
    assert table.edge_count.max() == 3
    assert table.edge_faces[table.edge_count == 3].tolist() == [[0, 1]]


def test_face_components_are_numbered_by_their_lowest_face() -> None:
    assert face_components(5, np.array([[4, 1], [2, 3]])).tolist() == [0, 1, 2, 2, 1]
    assert face_components(3, np.zeros((0, 2), dtype=np.int64)).tolist() == [0, 1, 2]


def test_faces_that_share_only_a_vertex_are_two_components() -> None:
    assert components(BOWTIE).tolist() == [0, 1]
    assert components(BOOK).tolist() == [0, 0, 0]


def test_euler_characteristics_of_known_surfaces() -> None:
    torus = np.asarray(trimesh.creation.torus(1.0, 0.3).faces)
    tube = np.array(
        [[i, (i + 1) % 6, i + 6] for i in range(6)] + [[(i + 1) % 6, (i + 1) % 6 + 6, i + 6] for i in range(6)]
    )
    assert [euler_characteristic(faces) for faces in (TETRAHEDRON, grid(4), tube, torus)] == [2, 1, 0, 0]


def test_manifolds_are_told_from_others() -> None:
    assert all(is_manifold(faces) for faces in (TRIANGLE, TETRAHEDRON, grid(4)))
    assert not any(is_manifold(faces) for faces in (BOWTIE, BOOK, MOEBIUS, np.array([[0, 1, 2], [0, 1, 3]])))


def test_the_boundary_of_a_grid_is_one_loop_to_the_left_of_its_half_edges() -> None:
    faces = grid(3)
    (loop,) = boundary_loops(faces)
    assert len(loop) == 12
    half = {(a, b) for face in faces.tolist() for a, b in zip(face, face[1:] + face[:1], strict=True)}
    assert all((a, b) in half for a, b in zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True))


def test_loops_that_touch_in_a_vertex_stay_apart() -> None:
    assert sorted(loop.tolist() for loop in boundary_loops(BOWTIE)) == [[0, 1, 2], [0, 3, 4]]


def test_a_closed_surface_has_no_boundary() -> None:
    assert boundary_loops(TETRAHEDRON) == []


def test_a_manifold_comes_back_from_splitting_as_it_was() -> None:
    faces, vertex = split_non_manifold_vertices(grid(4))
    assert np.array_equal(faces, grid(4))
    assert np.array_equal(vertex, np.arange(25))


def test_a_vertex_with_two_fans_is_split() -> None:
    faces, vertex = split_non_manifold_vertices(BOWTIE)
    assert vertex.tolist() == [0, 0, 1, 2, 3, 4]
    assert np.array_equal(vertex[faces], BOWTIE)


def test_whatever_goes_in_splitting_gives_an_oriented_manifold() -> None:
    rng = np.random.default_rng(0)
    for case in (
        BOWTIE,
        BOOK,
        MOEBIUS,
        *(np.sort(rng.permuted(np.tile(np.arange(7), (9, 1)), axis=1)[:, :3]) for _ in range(30)),
    ):
        faces, vertex = split_non_manifold_vertices(case)
        assert is_manifold(faces)
        assert np.array_equal(vertex[faces], case)


def test_cutting_a_moebius_strip_where_it_disagrees_leaves_a_disk() -> None:
    faces, _ = split_non_manifold_vertices(MOEBIUS)
    assert euler_characteristic(faces) == 1
    assert len(boundary_loops(faces)) == 1


def test_cutting_a_grid_along_a_line_makes_two_pieces() -> None:
    table = edge_table(grid(4))
    across = (table.edges // 5 == 2).all(axis=1)
    faces, vertex = split_non_manifold_vertices(grid(4), across)
    assert components(faces).max() == 1
    assert len(vertex) == 30
    assert np.array_equal(vertex[faces], grid(4))


def test_a_slit_inside_a_disk_needs_two_edges_and_makes_an_annulus() -> None:
    table = edge_table(grid(4))
    one = (table.edges == [11, 12]).all(axis=1)
    two = one | (table.edges == [12, 13]).all(axis=1)
    assert euler_characteristic(split_non_manifold_vertices(grid(4), one)[0]) == 1
    faces, vertex = split_non_manifold_vertices(grid(4), two)
    assert euler_characteristic(faces) == 0
    assert np.bincount(vertex).tolist() == [2 if old == 12 else 1 for old in range(25)]


def test_the_table_of_bunny_counts_each_half_edge_once(models: Path) -> None:
    faces = welded(models / "bunny.obj")
    table = edge_table(faces)
    assert np.array_equal(np.bincount(table.face_edges.reshape(-1)), table.edge_count)
    assert components(faces, table).max() == 0

"""Back from the proxy: labels, slivers of labels, and a flattening carried as rotations."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.cutgraph import SeamPrices
from flexpara.runtime.geometry.overlap import flipped_triangles
from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.carry.carry import (
    carried_back,
    fragments_joined,
    is_the_same,
    laid_on,
    smoothed_in_band,
    votes,
    within_reach,
)
from flexpara.train.carry.layout import carried_uv, face_frames, near_faces, nearest_faces, turned_into
from flexpara.train.carry.proxy import simplified
from flexpara.train.config import CarryConfig, FinishConfig
from flexpara.train.finish.contact import excess_energy
from flexpara.train.finish.flatten import flatten
from flexpara.train.finish.slits import Flat
from flexpara.train.search.labels import DualGraph, borders_of, connected_pieces, dual_graph
from flexpara.train.search.search import Search

CONFIG = FinishConfig()
CARRY = CarryConfig()


def sample(name: str, resolution: int) -> Surface:
    return Surface(*make_sample(name, resolution=resolution))


def unit(name: str, resolution: int) -> Surface:
    """A sample at area 1."""
    surface = sample(name, resolution)
    return Surface(surface.vertices / np.sqrt(surface.face_areas().sum()), surface.faces)


def graph_of(surface: Surface) -> DualGraph:
    return dual_graph(surface, edge_table(surface.faces), SeamPrices())


def test_labels_of_the_surface_itself_come_back_as_they_are() -> None:
    sphere = sample("sphere", 24)
    label = np.random.default_rng(0).integers(0, 4, len(sphere.faces))
    label[:4] = np.arange(4)
    share = votes(label[near_faces(sphere, sphere, CARRY, 1)])
    assert np.array_equal(share, np.eye(4)[label])


def test_shares_are_a_partition() -> None:
    sphere, proxy = sample("sphere", 24), sample("sphere", 12)
    share = votes(near_faces(sphere, proxy, CARRY, CARRY.neighbours) % 5)
    assert share.shape == (len(sphere.faces), 5)
    assert share.sum(axis=1) == pytest.approx(1.0)
    assert (share >= 0.0).all()


def test_two_colours_of_a_sphere_come_back_right() -> None:
    sphere = sample("sphere", 96)
    proxy = simplified(sphere, 1000)
    upper = (proxy.triangles.mean(axis=1)[:, 2] > 0.0).astype(np.int64)
    share = votes(upper[near_faces(sphere, proxy, CARRY, CARRY.neighbours)])
    height = sphere.triangles.mean(axis=1)[:, 2]
    clear = np.abs(height) > 0.1
    assert np.array_equal(share.argmax(axis=1)[clear], (height[clear] > 0.0).astype(np.int64))


def test_the_normal_tells_the_two_sides_of_a_thin_plate_apart() -> None:
    cube = sample("cube", 48)
    plate = Surface(cube.vertices * [1.0, 1.0, 0.004], cube.faces)
    label = (plate.face_normals()[:, 2] > 0.5).astype(np.int64)
    shifted = Surface(plate.vertices - [0.0, 0.0, 0.004], plate.faces)  # as simplification may move a sheet
    faces = np.abs(plate.face_normals()[:, 2]) > 0.5
    seeing, blind = (
        label[nearest_faces(shifted, plate, CarryConfig(normal_weight=weight))][faces] for weight in (0.1, 0.0)
    )
    assert np.array_equal(seeing, label[faces])
    assert (blind != label[faces]).mean() > 0.3  # without normals it can't


def test_only_faces_near_a_border_change_sides() -> None:
    sphere = unit("sphere", 48)
    height = sphere.triangles.mean(axis=1)[:, 2]
    jagged = height + 0.03 * np.sin(40.0 * sphere.triangles.mean(axis=1)[:, 0]) > 0.0
    share = np.where(np.eye(2)[jagged.astype(np.int64)] > 0.0, 0.6, 0.4)
    share[np.abs(height) > 0.05] = np.round(share[np.abs(height) > 0.05])
    label = smoothed_in_band(share, sphere.face_areas(), graph_of(sphere), CONFIG)
    far = np.abs(height) > 0.15
    assert np.array_equal(label[far], jagged[far].astype(np.int64))
    graph = graph_of(sphere)
    seams = [graph.length[side[graph.pairs[:, 0]] != side[graph.pairs[:, 1]]].sum() for side in (jagged, label)]
    assert seams[1] < seams[0]


def is_same_partition(a: np.ndarray, b: np.ndarray) -> bool:
    return len(np.unique(np.stack([a, b]), axis=1).T) == len(np.unique(a)) == len(np.unique(b))


def test_fragments_join_the_neighbour_they_share_most_border_with() -> None:
    sphere = sample("sphere", 24)
    height = sphere.triangles.mean(axis=1)[:, 2]
    label = (height > 0.0).astype(np.int64)
    label[height.argmax()] = 0  # a fragment of the lower half within the upper
    joined = fragments_joined(label, sphere.face_areas(), graph_of(sphere), 0.01)
    assert is_same_partition(joined, (height > 0.0).astype(np.int64))
    assert connected_pieces(joined, graph_of(sphere)).max() == 1


def test_a_large_fragment_stays_a_piece_of_its_own() -> None:
    sphere = sample("sphere", 24)
    height = sphere.triangles.mean(axis=1)[:, 2]
    label = (height > 0.0).astype(np.int64)
    label[height > 0.8] = 0
    joined = fragments_joined(label, sphere.face_areas(), graph_of(sphere), 0.01)
    assert int(joined.max()) == 2
    assert len(np.unique(joined[height > 0.8])) == 1


def test_crumbs_are_joined_as_one_by_one_on_the_faces() -> None:
    """A slow twin that looks for pieces among the faces each time."""
    sphere = sample("sphere", 24)
    graph, areas = graph_of(sphere), sphere.face_areas()
    label = np.random.default_rng(0).integers(3, size=len(areas))
    slow, least = label, 0.01 * float(areas.sum())
    while True:
        piece = connected_pieces(slow, graph)
        count = int(piece.max()) + 1
        size = np.bincount(piece, areas)
        of = np.array([slow[piece == one][0] for one in range(count)])
        largest = {max(np.flatnonzero(of == one), key=lambda n: (size[n], -n)) for one in np.unique(of)}
        small = [one for one in range(count) if one not in largest and size[one] < least]
        if not small:
            break
        crumb = min(small, key=lambda one: size[one])
        slow = np.where(piece == crumb, of[borders_of(crumb, piece, count, graph).argmax()], slow)
    np.testing.assert_array_equal(fragments_joined(label, areas, graph, 0.01), piece)


def test_labels_without_fragments_are_only_renumbered() -> None:
    sphere = sample("sphere", 24)
    half = (sphere.triangles.mean(axis=1)[:, 2] > 0.0).astype(np.int64)
    assert is_same_partition(fragments_joined(3 + 4 * half, sphere.face_areas(), graph_of(sphere), 0.01), half)


def test_the_frame_of_a_face_is_orthonormal_and_right_handed() -> None:
    frame = face_frames(sample("cloth", 8))
    np.testing.assert_allclose(frame @ frame.transpose(0, 2, 1), np.broadcast_to(np.eye(3), frame.shape), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1.0)


def test_the_least_turn_brings_one_normal_onto_another_and_leaves_the_axis() -> None:
    x, y, z = np.eye(3)[:, None]
    vectors = np.stack([x, y, z], axis=1)  # (1, 3, 3)
    np.testing.assert_allclose(turned_into(vectors, z, x)[0], [-z[0], y[0], x[0]], atol=1e-12)
    np.testing.assert_allclose(turned_into(vectors, z, z)[0], np.eye(3), atol=1e-12)


def test_a_flattening_is_carried_from_a_coarse_sheet_to_a_fine_one() -> None:
    coarse, fine = sample("cloth", 12), sample("cloth", 40)
    source = Flat(coarse, flatten(coarse, 20), {})
    uv = carried_uv(fine, source, CARRY)
    assert not flipped_triangles(uv[fine.faces]).any()
    own = excess_energy(fine, flatten(fine, 20))
    assert excess_energy(fine, uv) < 3.0 * own + 0.01


def test_a_search_on_the_proxy_comes_back_with_its_charts_and_about_its_energy() -> None:
    sphere = unit("sphere", 96)
    proxy = simplified(sphere, 600)
    found = Search(proxy, graph_of(proxy), CONFIG)
    for half in (True, False):
        found.add_valid(np.flatnonzero((proxy.triangles.mean(axis=1)[:, 2] > 0.0) == half))
    back = carried_back(sphere, proxy, found, 2, CONFIG)
    assert len(back.pieces) == len(found.pieces) == 2
    covered = np.sort(np.concatenate([piece.ids for piece in back.pieces.values()]))
    assert np.array_equal(covered, np.arange(len(sphere.faces)))
    assert back.energy() == pytest.approx(found.energy(), abs=0.01)


def test_a_mark_reaches_one_face_farther_with_each_ring() -> None:
    chain = DualGraph(np.array([[0, 1], [1, 2], [3, 2]]), np.ones(3), np.ones(3))
    marked = np.array([[True, False], [False, False], [False, False], [False, True]])
    reached = [[True, False], [True, False], [False, True], [False, True]]
    assert within_reach(marked, chain, 0).tolist() == marked.tolist()
    assert within_reach(marked, chain, 1).tolist() == reached
    assert within_reach(marked, chain, 3).all()


def test_a_chart_of_the_same_faces_is_taken_as_it_is() -> None:
    surface = unit("sphere", 8)
    graph = dual_graph(surface, edge_table(surface.faces), SeamPrices())
    label = (surface.triangles.mean(axis=1)[:, 0] > 0.0).astype(np.int64)
    search = Search(surface, graph, CONFIG)
    search.add_all_valid([(np.flatnonzero(label == number), ()) for number in range(2)])
    pieces = list(search.pieces.values())
    again = laid_on(Search(surface, graph, CONFIG), label, label, pieces).pieces.values()
    assert all(np.array_equal(one.flat.uv, other.flat.uv) for one, other in zip(pieces, again, strict=True))
    larger = Surface(2.0 * surface.vertices, surface.faces)
    assert not is_the_same(larger, np.flatnonzero(label == 0), pieces[0])

"""The proxy: small meshes stay as they are, large ones keep their shape."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.spatial import KDTree

pytest.importorskip("igl")

from flexpara.runtime.geometry.topology import components, edge_table, euler_characteristic, is_manifold
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.mesh import Frame, Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.carry import proxy
from flexpara.train.carry.proxy import simplified, thinned, topology_of
from flexpara.train.config import FineConfig

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

FACES = 1000
CONFIG = FineConfig(faces=FACES)


def sample(name: str, resolution: int) -> Surface:
    return Surface(*make_sample(name, resolution=resolution))


def spread(surface: Surface, count: int) -> NDArray[np.float64]:
    """Points all over a surface, (count, 3)."""
    rng = np.random.default_rng(0)
    area = surface.face_areas()
    face = rng.choice(len(area), count, p=area / area.sum())
    share = rng.dirichlet(np.ones(3), count)
    return np.einsum("nc,ncd->nd", share, surface.triangles[face])


def distance(first: Surface, second: Surface) -> float:
    """About the Hausdorff distance of two surfaces, from dense samples (a few hundredths too large at most)."""
    a, b = spread(first, 20000), spread(second, 20000)
    return float(max(KDTree(a).query(b)[0].max(), KDTree(b).query(a)[0].max()))


def assert_sound(surface: Surface) -> None:
    assert surface.faces.dtype == np.int64
    assert surface.vertices.dtype == np.float64
    assert np.array_equal(np.unique(surface.faces), np.arange(len(surface.vertices)))  # no vertex unused
    assert (surface.face_areas() > 0.0).all()
    assert np.isfinite(surface.vertices).all()


def test_a_small_surface_is_its_own_proxy() -> None:
    sphere = sample("sphere", 12)
    assert simplified(sphere, FACES) is sphere


def test_a_little_too_large_is_left_alone() -> None:
    sphere = sample("sphere", 48)
    assert simplified(sphere, 900) is sphere
    assert simplified(sphere, 800) is not sphere


@pytest.mark.parametrize("name", ["sphere", "torus", "tube", "cloth", "bracket"])
def test_the_proxy_has_about_the_faces_asked_for_and_the_same_shape(name: str) -> None:
    if name == "bracket":
        pytest.importorskip("manifold3d")
    surface = sample(name, 72)
    proxy = simplified(surface, FACES)
    assert_sound(proxy)
    assert 0.9 * FACES <= len(proxy.faces) <= FACES
    assert euler_characteristic(proxy.faces) == euler_characteristic(surface.faces)
    assert is_manifold(proxy.faces)
    assert distance(surface, proxy) < 0.1
    assert proxy.face_areas().sum() == pytest.approx(surface.face_areas().sum(), rel=0.03)


def test_normals_stay_outwards() -> None:
    proxy = simplified(sample("sphere", 72), FACES)
    outwards = proxy.triangles.mean(axis=1)
    assert (np.einsum("fc,fc->f", proxy.face_normals(), outwards) > 0.9).all()


def test_the_border_stays_where_it_is() -> None:
    proxy = simplified(sample("tube", 72), FACES)
    table = edge_table(proxy.faces)
    assert np.abs(proxy.vertices[np.unique(table.edges[table.boundary])][:, 2]) == pytest.approx(1.0, abs=0.05)


def test_two_solids_that_share_a_vertex_are_simplified_apart() -> None:
    sphere = sample("sphere", 72)
    lowest = int(sphere.vertices[:, 2].argmin())
    above = sphere.vertices - sphere.vertices[lowest]
    index = np.arange(len(above)) + len(above) - (np.arange(len(above)) > lowest)
    index[lowest] = lowest
    below = -np.delete(above, lowest, axis=0)  # mirrored through the shared vertex, so it turns inside out
    kiss = Surface(np.concatenate([above, below]), np.concatenate([sphere.faces, index[sphere.faces][:, ::-1]]))
    assert not is_manifold(kiss.faces)
    proxy = simplified(kiss, FACES)
    assert_sound(proxy)
    assert len(proxy.faces) <= FACES
    assert components(proxy.faces).max() == 1
    assert is_manifold(proxy.faces)
    assert distance(kiss, proxy) < 0.15


def test_sheets_on_one_edge_are_simplified_apart() -> None:
    cloth = sample("cloth", 36)
    flat = cloth.vertices * [0.5, 0.5, 0.0] + [0.0, 0.5, 0.0]
    upright = flat[:, [0, 2, 1]]
    edge = flat[:, 1] == 0.0
    index = np.arange(len(flat)) + len(flat) - np.cumsum(edge)
    index[edge] = np.flatnonzero(edge)
    slanted = flat * [1.0, -1.0, 1.0]
    index2 = np.arange(len(flat)) + 2 * len(flat) - edge.sum() - np.cumsum(edge)
    index2[edge] = np.flatnonzero(edge)
    vertices = np.concatenate([flat, upright[~edge], slanted[~edge]])
    book = Surface(vertices, np.concatenate([cloth.faces, index[cloth.faces], index2[cloth.faces]]))
    assert (edge_table(book.faces).edge_count == 3).sum() == 36
    proxy = simplified(book, 600)
    assert_sound(proxy)
    assert components(proxy.faces).max() == 2
    assert distance(book, proxy) < 0.1


def test_the_source_is_not_written_to() -> None:
    sphere = sample("sphere", 72)
    vertices, faces = sphere.vertices.copy(), sphere.faces.copy()
    simplified(sphere, FACES)
    assert np.array_equal(sphere.vertices, vertices)
    assert np.array_equal(sphere.faces, faces)


def test_the_same_surface_gives_the_same_proxy() -> None:
    first, second = (simplified(sample("torus", 72), FACES) for _ in range(2))
    assert first.vertices.tobytes() == second.vertices.tobytes()
    assert first.faces.tobytes() == second.faces.tobytes()


@pytest.mark.parametrize("name", ["bunny", "homer"])
def test_the_proxy_of_a_real_mesh_keeps_its_shape(name: str, models: Path) -> None:
    surface = load_asset(models / f"{name}.obj").surface
    surface = Surface(Frame.of(surface.vertices).apply(surface.vertices), surface.faces)
    proxy = simplified(surface, 3000)
    assert_sound(proxy)
    assert 2700 <= len(proxy.faces) <= 3000
    assert euler_characteristic(proxy.faces) == euler_characteristic(surface.faces)
    assert distance(surface, proxy) < 0.06


@pytest.mark.parametrize("name", ["sphere", "torus", "cloth"])
def test_a_thinned_surface_keeps_shape_and_topology_without_slivers(name: str) -> None:
    surface = sample(name, 128)
    proxy = thinned(surface, CONFIG)
    assert_sound(proxy)
    assert 0.9 * FACES < len(proxy.faces) < 1.1 * FACES
    assert topology_of(proxy.faces) == topology_of(surface.faces)
    assert distance(surface, proxy) < 0.1
    assert proxy.face_areas().min() > 1e-4 * proxy.face_areas().mean()


def test_a_finely_divided_plane_leaves_no_slivers() -> None:
    cloth = sample("cloth", 96)
    proxy = thinned(Surface(cloth.vertices * [1.0, 1.0, 0.0], cloth.faces), FineConfig(faces=500))
    corner = proxy.triangles
    longest = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max(axis=1)
    assert (proxy.face_areas() / longest**2).min() > 0.003


def test_where_thinning_breaks_the_topology_the_careful_way_takes_over(monkeypatch: pytest.MonkeyPatch) -> None:
    surface = sample("torus", 48)
    broken = np.asfortranarray(surface.vertices), surface.faces[: len(surface.faces) // 2]
    monkeypatch.setattr(proxy.fast_simplification, "simplify", lambda *_, **__: broken)
    found = thinned(surface, CONFIG)
    assert_sound(found)
    assert euler_characteristic(found.faces) == 0


def test_thinning_twice_gives_the_same_and_leaves_the_source_alone() -> None:
    surface = sample("sphere", 64)
    before = surface.vertices.copy()
    first, second = thinned(surface, CONFIG), thinned(surface, CONFIG)
    assert np.array_equal(first.vertices, second.vertices)
    assert np.array_equal(first.faces, second.faces)
    assert np.array_equal(surface.vertices, before)

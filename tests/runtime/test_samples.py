"""Samples: topology and orientation that each promises."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from flexpara.runtime.errors import InputError, MissingDependencyError
from flexpara.runtime.io.clean.clean import clean
from flexpara.runtime.io.rawmesh import RawMesh
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import SAMPLES, make_sample

CLOSED = {"sphere": 0, "torus": 1, "trefoil": 1, "cube": 0, "bracket": 5}
OPEN = {"tube": 2, "cone": 1, "cloth": 1}
SOLID_MODELS = ("gyroid", "bracket")


def sample(name: str, resolution: int) -> tuple[np.ndarray, np.ndarray]:
    if name in SOLID_MODELS:
        pytest.importorskip("manifold3d")
    return make_sample(name, resolution=resolution)


def edges_of(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    directed = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    return np.unique(np.sort(directed, axis=1), axis=0, return_counts=True)


def euler(vertices: np.ndarray, faces: np.ndarray) -> int:
    return len(vertices) - len(edges_of(faces)[0]) + len(faces)


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = vertices[faces].transpose(1, 0, 2)
    return float(np.einsum("fc,fc->", np.cross(a, b), c)) / 6.0


@pytest.mark.parametrize("name", SAMPLES)
@pytest.mark.parametrize("resolution", [12, 48])
def test_a_sample_is_clean_and_consistently_oriented(name: str, resolution: int) -> None:
    vertices, faces = sample(name, resolution)
    asset = clean(RawMesh(positions=vertices, faces=faces))
    assert asset.changes == {}
    np.testing.assert_array_equal(asset.faces, faces)
    assert edges_of(faces)[1].max() <= 2
    assert vertices.dtype == np.float64
    assert faces.dtype == np.int64


@pytest.mark.parametrize("name", CLOSED)
def test_a_closed_sample_has_its_genus_and_faces_outwards(name: str) -> None:
    vertices, faces = sample(name, 48)
    assert (edges_of(faces)[1] == 2).all()
    assert euler(vertices, faces) == 2 - 2 * CLOSED[name]
    assert volume(vertices, faces) > 0.0


def test_the_gyroid_has_a_high_genus() -> None:
    vertices, faces = sample("gyroid", 64)
    assert (edges_of(faces)[1] == 2).all()
    assert 1 - euler(vertices, faces) // 2 >= 5
    assert volume(vertices, faces) > 0.0


@pytest.mark.parametrize("name", OPEN)
def test_an_open_sample_has_its_boundary_loops(name: str) -> None:
    vertices, faces = make_sample(name, resolution=24)
    assert euler(vertices, faces) == 2 - OPEN[name]


def test_volumes_approach_their_closed_forms() -> None:
    assert volume(*make_sample("sphere", resolution=160)) == pytest.approx(4.0 / 3.0 * np.pi, rel=2e-3)
    assert volume(*make_sample("torus", resolution=200)) == pytest.approx(2.0 * np.pi**2 * 0.7 * 0.09, rel=2e-3)
    assert volume(*make_sample("cube", resolution=12)) == pytest.approx(1.0, abs=1e-12)


def test_open_samples_have_the_normals_they_promise() -> None:
    for name, direction in (("tube", [1.0, 1.0, 0.0]), ("cone", [1.0, 1.0, 0.0])):
        surface = Surface(*make_sample(name, resolution=24))
        outwards = np.einsum("fc,fc->f", surface.face_cross(), surface.triangles.mean(axis=1) * direction)
        assert (outwards > 0.0).all()
    assert (Surface(*make_sample("cloth", resolution=24)).face_cross()[:, 2] > 0.0).all()


@pytest.mark.parametrize("name", SAMPLES)
def test_a_sample_stays_within_about_a_unit_and_the_same(name: str) -> None:
    vertices, faces = sample(name, 24)
    assert np.abs(vertices).max() <= 1.2
    again = make_sample(name, resolution=24)
    np.testing.assert_array_equal(vertices, again[0])
    np.testing.assert_array_equal(faces, again[1])


def test_an_unknown_sample_lists_those_there_are() -> None:
    with pytest.raises(InputError, match=r"'banana'.*sphere, torus, trefoil"):
        make_sample("banana")


@pytest.mark.parametrize("resolution", [2, -1, 100_000])
def test_a_resolution_out_of_range_is_refused(resolution: int) -> None:
    with pytest.raises(InputError, match="resolution"):
        make_sample("sphere", resolution=resolution)


def test_without_manifold3d_the_remedy_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "manifold3d", None)
    with pytest.raises(MissingDependencyError, match=r"flexpara\[samples\]"):
        make_sample("bracket")

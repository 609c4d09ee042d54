"""Raw meshes: what is refused, and how parts are moved, split and merged."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.errors import MeshError
from flexpara.runtime.io.clean.clean import clean
from flexpara.runtime.io.limits import Limits
from flexpara.runtime.io.rawmesh import RawMesh, check, merge, split_at_corners, transformed
from flexpara.runtime.material import Material
from flexpara.runtime.samples import make_sample

TRIANGLE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
SQUARE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])


def test_too_many_faces_are_refused() -> None:
    faces = np.broadcast_to(np.array([0, 1, 2]), (Limits().faces + 1, 3))
    with pytest.raises(MeshError, match="decimate"):
        check(RawMesh(positions=TRIANGLE, faces=faces))


def test_corner_uv_split_vertices_only_where_they_differ() -> None:
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    uv = SQUARE[faces][:, :, :2].copy()
    assert len(split_at_corners(RawMesh(positions=SQUARE, faces=faces), uv=uv).positions) == 4
    uv[1] += 5.0
    part = split_at_corners(RawMesh(positions=SQUARE, faces=faces), uv=uv)
    assert part.uv is not None
    assert len(part.positions) == 6
    np.testing.assert_array_equal(part.uv[part.faces], uv)
    np.testing.assert_array_equal(part.positions[part.faces], SQUARE[faces])


def test_a_mirroring_transform_keeps_the_outside_outside() -> None:
    vertices, faces = make_sample("sphere", resolution=12)
    world = np.diag([-2.0, 1.0, 3.0, 1.0])
    part = transformed(RawMesh(positions=vertices, faces=faces, normals=vertices), world)
    surface = clean(part).surface
    assert part.normals is not None
    assert (np.einsum("fc,fc->f", surface.face_cross(), surface.triangles.mean(axis=1)) > 0.0).all()
    assert (np.einsum("nc,nc->n", part.normals, part.positions) > 0.0).all()
    np.testing.assert_allclose(np.linalg.norm(part.normals, axis=1), 1.0)


def test_merging_counts_what_only_some_parts_have() -> None:
    rich = RawMesh(TRIANGLE, np.array([[0, 1, 2]]), normals=TRIANGLE, uv=TRIANGLE[:, :2])
    poor = RawMesh(TRIANGLE + 3.0, np.array([[0, 1, 2]]))
    whole = merge([rich, poor])
    assert whole.normals is None
    assert whole.uv is not None
    np.testing.assert_array_equal(whole.faces, [[0, 1, 2], [3, 4, 5]])
    assert whole.changes == {"dropped_normals": 3, "faces_without_uv": 1}


def test_merging_keeps_one_of_each_material_and_gives_the_rest_a_default() -> None:
    red, blue = Material(name="red"), Material(name="blue")
    face, zero = np.array([[0, 1, 2]]), np.zeros(1, dtype=np.int64)
    parts = [
        RawMesh(TRIANGLE, face, materials=(red,), face_material=zero),
        RawMesh(TRIANGLE, face),
        RawMesh(TRIANGLE, face, materials=(red, blue), face_material=zero + 1),
    ]
    whole = merge(parts)
    assert [material.name for material in whole.materials] == ["red", "blue", "default"]
    assert whole.face_material is not None
    assert whole.face_material.tolist() == [0, 2, 1]

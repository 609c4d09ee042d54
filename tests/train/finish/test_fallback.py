"""The last resort: whatever the faces, valid pieces come back, and they say who made them."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.finish.fallback import unwrapped_by_xatlas


def surface_of(name: str) -> Surface:
    vertices, faces = make_sample(name, resolution=16)
    return Surface(vertices, faces)


def assert_valid(pieces: list, faces: int) -> None:
    covered = np.sort(np.concatenate([piece.ids for piece in pieces]))
    np.testing.assert_array_equal(covered, np.arange(faces))
    for piece in pieces:
        uv = piece.flat.uv[piece.flat.surface.faces]
        assert not flipped_triangles(uv).any()
        assert len(overlapping_pairs(uv)) == 0
        assert piece.method == "xatlas"


@pytest.mark.parametrize("name", ["cube", "sphere", "torus", "cloth"])
def test_every_face_lies_in_one_valid_piece(name: str) -> None:
    surface = surface_of(name)
    pieces = unwrapped_by_xatlas(surface, np.arange(len(surface.faces)), surface.face_areas().sum())
    assert_valid(pieces, len(surface.faces))


def test_a_chart_keeps_the_scale_of_the_surface() -> None:
    surface = surface_of("cube")
    pieces = unwrapped_by_xatlas(surface, np.arange(len(surface.faces)), 1.0)
    assert sum(piece.energy for piece in pieces) < 0.05
    for piece in pieces:
        corner = surface.vertices[surface.faces[piece.ids]]
        np.testing.assert_allclose(piece.flat.surface.vertices[piece.flat.surface.faces], corner)

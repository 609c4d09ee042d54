"""Parts match by name: suffixes, materials, files, and what happens to a part that is alone."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.bake.highpoly.parts import face_parts, matching_faces
from flexpara.runtime.cli.partnames import part_name
from flexpara.runtime.errors import InputError
from flexpara.runtime.material import Material
from flexpara.runtime.mesh import Asset, Surface


def mesh(stem: str, *materials: str, face_material: list[int] | None = None, faces: int = 2) -> Asset:
    corners = np.arange(9.0 * faces).reshape(-1, 3)
    index = np.arange(3 * faces).reshape(-1, 3)
    of_face = None if face_material is None else np.array(face_material)
    made = tuple(Material(name) for name in materials)
    surface = Surface(corners, index)
    return Asset(corners, index, np.arange(len(corners)), surface, materials=made, face_material=of_face, stem=stem)


@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("wheel_low", "wheel"),
        ("Wheel_High", "wheel"),
        ("wheel_high_bolts", "wheel"),
        ("wheel_high.001", "wheel"),
        ("wheel-lowpoly", "wheel"),
        ("front wheel.hp", "front wheel"),
        ("wheel", "wheel"),
        ("below", "below"),
        ("low", "low"),
        ("highlight_low", "highlight"),
    ],
)
def test_suffixes_are_taken_off(name: str, part: str) -> None:
    assert part_name(name) == part


def test_one_material_takes_the_file_s_name() -> None:
    names, part = face_parts(mesh("Door_low", "steel"))
    assert names == ("door",)
    assert part.tolist() == [0, 0]


def test_several_materials_are_several_parts() -> None:
    names, part = face_parts(mesh("car", "rim_low", "unused", "body_low", face_material=[2, 0, 2], faces=3))
    assert names == ("body", "rim")
    assert part.tolist() == [0, 1, 0]


def test_faces_see_the_parts_of_their_name_in_all_files() -> None:
    low = mesh("car", "rim_low", "body_low", face_material=[0, 1])
    highs = [mesh("body_high"), mesh("more", "rim_high", "body_high_screws", face_material=[0, 1, 0], faces=3)]
    matches = matching_faces(low, highs)
    assert [own.tolist() for own, _ in matches] == [[False, True], [True, False]]
    assert [seen.tolist() for _, seen in matches] == [[0, 1, 3], [2, 4]]


def test_a_part_without_partner_is_named() -> None:
    with pytest.raises(InputError, match=r"no high-poly part is named like door \(there are body\)"):
        matching_faces(mesh("door_low"), [mesh("body_high")])

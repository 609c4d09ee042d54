"""Pages of a scene: some of its faces, with all that belongs to them; names that files can have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flexpara.runtime.errors import InputError
from flexpara.runtime.io.asset.pages import file_names, pages_of, part_of
from flexpara.runtime.io.gltf.buffers import GltfFile
from flexpara.runtime.io.gltf.document import Document, Part
from flexpara.runtime.io.meshfile import asset_from_arrays
from flexpara.runtime.material import Material
from flexpara.runtime.mesh import Asset


@pytest.fixture
def two_meshes(tmp_path_factory: pytest.TempPathFactory) -> Asset:
    """A strip of four triangles: faces 0 and 3 in mesh "Upper", 1 and 2 in mesh "Lower"; red are 0 and 1."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0], [1, 2, 0]], float)
    uv = points[:, :2] / 2.0
    asset = asset_from_arrays(points, [[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5]], uv=uv, stem="strip")
    tree = {"meshes": [{"name": "Upper", "primitives": []}, {"name": "Lower", "primitives": []}]}
    parts = (Part(0, 0, np.eye(4)), Part(1, 0, np.eye(4)))
    document = Document(GltfFile(tree, [], tmp_path_factory.getbasetemp()), parts, ())
    return replace(
        asset,
        document=document,
        part=np.array([0, 1, 1, 0]),
        origin=np.arange(6),
        materials=(Material("Red"), Material("Grey")),
        face_material=np.array([0, 0, 1, 1]),
    )


def test_each_mesh_is_a_page_and_keeps_the_order_of_its_faces(two_meshes: Asset) -> None:
    upper, lower = pages_of(two_meshes, "mesh")
    assert (upper.stem, lower.stem) == ("strip_Upper", "strip_Lower")
    np.testing.assert_array_equal(upper.positions[upper.faces], two_meshes.positions[two_meshes.faces[[0, 3]]])
    np.testing.assert_array_equal(lower.positions[lower.faces], two_meshes.positions[two_meshes.faces[[1, 2]]])


def test_each_material_is_a_page(two_meshes: Asset) -> None:
    red, grey = pages_of(two_meshes, "material")
    assert (red.stem, grey.stem) == ("strip_Red", "strip_Grey")
    assert red.face_material is not None
    assert red.face_material.tolist() == [0, 0]
    assert red.part is not None
    assert red.part.tolist() == [0, 1]
    assert len(grey.faces) == 2


def test_a_whole_scene_is_one_page_as_it_is(two_meshes: Asset) -> None:
    assert pages_of(two_meshes, "scene") == [two_meshes]


def test_a_page_knows_its_vertices_in_the_file_and_the_surface_around_it(two_meshes: Asset) -> None:
    page = pages_of(two_meshes, "mesh")[1]
    assert page.unsplit is not None
    np.testing.assert_array_equal(two_meshes.positions[page.unsplit], page.positions)
    np.testing.assert_array_equal(page.surface.vertices[page.weld], page.positions)
    np.testing.assert_array_equal(page.surface.faces, page.weld[page.faces])
    assert page.whole is two_meshes.surface
    assert page.uv is not None
    np.testing.assert_array_equal(page.uv, page.positions[:, :2] / 2.0)


def test_white_that_other_parts_colours_brought_is_no_colour_of_a_page(two_meshes: Asset) -> None:
    white = np.full((6, 4), 255, np.uint8)
    colored = replace(two_meshes, colors=white.copy())
    assert colored.colors is not None
    colored.colors[0, 0] = 9
    chosen = np.array([False, True, True, True])
    assert part_of(colored, chosen, "rest").colors is None
    assert part_of(colored, ~chosen, "first").colors is not None


def test_pages_want_a_scene(two_meshes: Asset) -> None:
    with pytest.raises(InputError, match="without a document"):
        pages_of(replace(two_meshes, document=None), "mesh")


def test_names_differ_as_names_of_files() -> None:
    assert file_names(["Red paint", "red/paint", "..", "rêd"]) == ["Red_paint", "red_paint_2", "part", "rêd"]
    assert file_names(["a", "A", "a_2"]) == ["a", "A_2", "a_2_2"]

"""A scene as USD: its tree of nodes, each mesh once, materials apart; Pixar's library judges."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenefile import whole_scene

from flexpara.bake.files.usd import write_usda
from flexpara.bake.files.usdmaterial import distinct
from flexpara.bake.files.usdshapes import Shape
from flexpara.bake.files.written import PartUv, Reading, corner_uv_of
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.mesh import Asset, Atlas
from flexpara.runtime.pack.packing import atlas_from_uv


def pxr(name: str) -> Any:
    """A module of usd-core; skips where that is absent."""
    return pytest.importorskip(f"pxr.{name}", reason="usd-core is not installed")


def shattered(asset: Asset) -> Atlas:
    """An atlas in which each triangle is a chart, in a grid."""
    count = len(asset.faces)
    side = int(np.ceil(np.sqrt(count)))
    corner = np.stack([np.arange(count) % side, np.arange(count) // side], axis=1)[:, None]
    uv = (corner + np.array([[0.1, 0.1], [0.8, 0.1], [0.1, 0.8]])) / side
    source = asset.faces.reshape(-1)
    normals = np.tile([0.0, 0.0, 1.0], (len(source), 1)) if asset.normals is None else asset.normals[source]
    faces = np.arange(3 * count).reshape(-1, 3)
    flat, chart = uv.reshape(-1, 2).astype(np.float32), np.arange(count)
    return Atlas(asset.positions[source], faces, flat, normals.astype(np.float32), chart, source, 64, 2)


def staged(source: Path) -> tuple[Asset, list[Shape], Any]:
    """A file as USD: what was read of it, what was written, and the stage that Pixar's library makes of it."""
    asset, path = load_asset(source), source.with_suffix(".usda")
    shapes = write_usda(shattered(asset), asset, {}, path)
    return asset, shapes, pxr("Usd").Stage.Open(str(path))


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "scene.glb"
    path.write_bytes(whole_scene().glb())
    return path


def meshes_of(stage: Any) -> list[Any]:
    """All meshes that are drawn, those of instances too."""
    usd, geometry = pxr("Usd"), pxr("UsdGeom")
    whole = usd.PrimRange(stage.GetPseudoRoot(), usd.TraverseInstanceProxies())
    return [prim for prim in whole if prim.IsA(geometry.Mesh)]


def in_the_world(prim: Any) -> np.ndarray:
    """(f, 3) centres of the triangles of a mesh, in the world."""
    mesh, world = pxr("UsdGeom").Mesh(prim), np.array(pxr("UsdGeom").XformCache().GetLocalToWorldTransform(prim))
    points = np.array(mesh.GetPointsAttr().Get(), np.float64)
    placed = np.column_stack([points, np.ones(len(points))]) @ world
    return placed[np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3), :3].mean(axis=1)


def test_nodes_are_xforms_with_their_meshes_below_them(scene: Path) -> None:
    _, _, stage = staged(scene)
    assert [str(prim.GetPath()) for prim in meshes_of(stage)] == [
        "/scene/Root/A/Board/Board",
        "/scene/Root/B/Board/Board",
        "/scene/Root/C/Board/Board",
        "/scene/Arm/Arm",
    ]
    assert stage.GetPrimAtPath("/scene/Shoulder/Bone").GetTypeName() == "Xform"
    assert stage.GetPrimAtPath("/scene/Eye")


def test_a_mesh_that_stands_several_times_is_one(scene: Path) -> None:
    _, shapes, stage = staged(scene)
    assert [shape.name for shape in shapes] == ["Board", "Arm"]
    boards = [stage.GetPrimAtPath(f"/scene/Root/{name}/Board") for name in "ABC"]
    assert all(board.IsInstance() for board in boards)
    assert len({board.GetPrototype().GetPath() for board in boards}) == 1


def test_every_triangle_stands_where_the_scene_has_it(scene: Path) -> None:
    _, _, stage = staged(scene)
    found = np.concatenate([in_the_world(prim) for prim in meshes_of(stage)])
    wanted = load_asset(scene, instances=True).surface.triangles.mean(axis=1)
    np.testing.assert_allclose(found[np.lexsort(found.round(4).T)], wanted[np.lexsort(wanted.round(4).T)], atol=1e-6)


def test_materials_stay_apart_as_subsets_of_faces(scene: Path) -> None:
    _, _, stage = staged(scene)
    shade, geometry = pxr("UsdShade"), pxr("UsdGeom")
    board = meshes_of(stage)[0]
    subsets = geometry.Subset.GetAllGeomSubsets(geometry.Mesh(board))
    bound = [shade.MaterialBindingAPI(each.GetPrim()).ComputeBoundMaterial()[0].GetPath() for each in subsets]
    assert [str(path) for path in bound] == ["/scene/Materials/Paint", "/scene/Materials/Glass"]
    faces = [list(each.GetIndicesAttr().Get()) for each in subsets]
    assert faces == [[0, 1, 2, 3], [4, 5, 6, 7]]
    surface = shade.Material(stage.GetPrimAtPath("/scene/Materials/Glass")).ComputeSurfaceSource()[0]
    assert surface.GetInput("opacity").Get() == 0.5


def test_pixar_s_validators_have_no_complaint(scene: Path) -> None:
    _, _, stage = staged(scene)
    validation = pxr("UsdValidation")
    validators = validation.ValidationRegistry().GetOrLoadAllValidators()
    found = validation.ValidationContext(validators).Validate(stage)
    assert [f"{error.GetName()}: {error.GetMessage()}" for error in found] == []


def test_what_is_read_back_is_what_was_written(scene: Path) -> None:
    asset, shapes, _ = staged(scene)
    atlas = shattered(asset)
    reading = Reading(parts=[PartUv(mirrored=shape.mirrored) for shape in shapes])
    wanted = np.concatenate([atlas.uv[shape.triangles] for shape in shapes])
    np.testing.assert_array_equal(corner_uv_of(scene.with_suffix(".usda"), reading), wanted)


def test_a_mesh_that_only_mirrors_keeps_its_winding_in_the_file(scene: Path) -> None:
    made = whole_scene()
    made.tree["nodes"][0]["children"] = [3]
    scene.write_bytes(made.glb())
    _, shapes, stage = staged(scene)
    board = next(shape for shape in shapes if shape.name == "Board")
    assert board.mirrored
    mesh = pxr("UsdGeom").Mesh(stage.GetPrimAtPath("/scene/Root/C/Board"))
    points = np.array(mesh.GetPointsAttr().Get())[np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)]
    across = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    assert (across[:, 2] > 0).all()  # as its normals point, in its own space
    assert (np.array(mesh.GetNormalsAttr().Get())[:, 2] > 0).all()


def test_objects_of_an_obj_file_are_meshes_and_its_polygons_stay(tmp_path: Path) -> None:
    path = tmp_path / "two.obj"
    corners = ["v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 1 0"]
    path.write_text(
        "\n".join([*corners, "o Lower part", "f 1 2 3 4", "o 2", "usemtl red", "f 1 2 3"]), encoding="utf-8"
    )
    asset = load_asset(path)
    asset = replace(asset, uv=asset.positions[:, :2] / 2.0, normals=np.tile([0.0, 0.0, 1.0], (len(asset.positions), 1)))
    write_usda(atlas_from_uv(asset), asset, {}, path.with_suffix(".usda"))
    stage, geometry = pxr("Usd").Stage.Open(str(path.with_suffix(".usda"))), pxr("UsdGeom")
    counts = {prim.GetName(): list(geometry.Mesh(prim).GetFaceVertexCountsAttr().Get()) for prim in meshes_of(stage)}
    assert counts == {"Lower_part": [4], "_2": [3]}
    assert [prim.GetDisplayName() for prim in meshes_of(stage)] == ["Lower part", "2"]


def test_names_that_are_no_identifiers_are_kept_beside_them(scene: Path) -> None:
    made = whole_scene()
    made.tree["nodes"][1]["name"] = 'Würfel "2"\n'
    made.tree["materials"][0]["name"] = "Öl"
    scene.write_bytes(made.glb())
    _, _, stage = staged(scene)
    assert [child.GetName() for child in stage.GetPrimAtPath("/scene/Root").GetChildren()] == ["W_rfel__2__", "B", "C"]
    assert stage.GetPrimAtPath("/scene/Root/W_rfel__2__").GetDisplayName() == 'Würfel "2"\n'
    assert stage.GetPrimAtPath("/scene/Root/B").GetDisplayName() == ""
    assert stage.GetPrimAtPath("/scene/Materials/_l").GetDisplayName() == "Öl"


def test_vertex_colours_are_display_colours_in_linear_light(tmp_path: Path) -> None:
    path = tmp_path / "dyed.ply"
    head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    head += "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n"
    rows = "0 0 0 255 0 0\n1 0 0 255 0 0\n0 1 0 255 188 0\n3 0 1 2\n"
    path.write_text(f"{head}property list uchar int vertex_indices\nend_header\n{rows}", encoding="utf-8")
    _, _, stage = staged(path)
    colors = pxr("UsdGeom").Mesh(meshes_of(stage)[0]).GetDisplayColorPrimvar()
    assert colors.GetInterpolation() == "vertex"
    np.testing.assert_allclose(np.array(colors.Get())[:, 1], [0, 0, 0.5029], atol=1e-4)


def test_names_that_would_be_alike_are_numbered() -> None:
    assert distinct(["a", "a", "a_1", "a b", "a-b"]) == ["a", "a_1", "a_1_1", "a_b", "a_b_1"]

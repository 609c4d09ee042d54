"""The .usda file is what Pixar's library understands: one mesh, its st, a preview surface with every texture."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexpara.bake.baker import bake
from flexpara.bake.files.targets import USD, write_target
from flexpara.bake.files.usd import prim_name, usda_text, write_usda
from flexpara.runtime.material import SLOTS, Material, Picture
from flexpara.runtime.mesh import Asset, Atlas

Pair = tuple[Atlas, Asset]

MAPS = ["base-color", "normal", "orm", "emissive", "position"]


def pxr(name: str) -> Any:
    """A module of usd-core; skips where that is absent."""
    return pytest.importorskip(f"pxr.{name}", reason="usd-core is not installed")


def rich(pair: Pair, **changes: Any) -> Pair:
    atlas, asset = pair
    noise = np.random.default_rng(1).integers(0, 256, (8, 8, 4)).astype(np.uint8)
    pictures: Any = {slot: Picture(noise) for slot in SLOTS}
    material = Material("rich", pictures=pictures, **{"emissive": (4.0, 1.0, 0.0), **changes})
    return atlas, replace(asset, uv=atlas.uv.astype(np.float64), materials=(material,))


def written(pair: Pair, folder: Path, maps: list[str]) -> Path:
    textures = bake(*pair, maps, size=16)
    files = {product: path.name for product, path in write_target(textures, folder, "mesh", USD).items()}
    alpha = "base-color" in textures and textures["base-color"].pixels.shape[2] == 4
    write_usda(*pair, files, folder / "mesh.usda", alpha=alpha)
    return folder / "mesh.usda"


def connected(shader: Any, slot: str) -> tuple[Any, str]:
    """The texture reader behind an input, and the output it is read from."""
    shade = pxr("UsdShade")
    source, output, _ = shader.GetInput(slot).GetConnectedSource()
    return shade.Shader(source.GetPrim()), str(output)


def complaints(path: Path) -> list[str]:
    """What the validators that come with USD say."""
    validation = pxr("UsdValidation")
    validators = validation.ValidationRegistry().GetOrLoadAllValidators()
    found = validation.ValidationContext(validators).Validate(pxr("Usd").Stage.Open(str(path)))
    return [f"{error.GetName()}: {error.GetMessage()}" for error in found]


def test_the_mesh_is_the_atlas_s(sphere: Pair, tmp_path: Path) -> None:
    geometry = pxr("UsdGeom")
    stage = pxr("Usd").Stage.Open(str(written(sphere, tmp_path, [])))
    mesh = geometry.Mesh(stage.GetPrimAtPath("/mesh/mesh"))
    np.testing.assert_array_equal(np.array(mesh.GetPointsAttr().Get()), sphere[0].positions.astype(np.float32))
    np.testing.assert_array_equal(np.array(mesh.GetFaceVertexIndicesAttr().Get()), sphere[0].faces.ravel())
    assert set(mesh.GetFaceVertexCountsAttr().Get()) == {3}
    st = geometry.PrimvarsAPI(mesh).GetPrimvar("st")
    assert (st.GetTypeName(), st.GetInterpolation()) == ("texCoord2f[]", "vertex")
    np.testing.assert_array_equal(np.array(st.Get()), sphere[0].uv)
    np.testing.assert_array_equal(np.array(mesh.GetNormalsAttr().Get()), sphere[0].normals)
    np.testing.assert_allclose(np.array(mesh.GetExtentAttr().Get())[0], sphere[0].positions.min(axis=0), atol=1e-6)


def test_every_texture_reaches_its_input(sphere: Pair, tmp_path: Path) -> None:
    stage = pxr("Usd").Stage.Open(str(written(rich(sphere, alpha_mode="MASK"), tmp_path, MAPS)))
    material, _ = pxr("UsdShade").MaterialBindingAPI(stage.GetPrimAtPath("/mesh/mesh")).ComputeBoundMaterial()
    surface = material.ComputeSurfaceSource()[0]
    assert surface.GetIdAttr().Get() == "UsdPreviewSurface"
    expected = {
        "diffuseColor": ("rgb", "sRGB", "mesh_diffuseColor.png"),
        "opacity": ("a", "sRGB", "mesh_diffuseColor.png"),
        "emissiveColor": ("rgb", "sRGB", "mesh_emissiveColor.png"),
        "normal": ("rgb", "raw", "mesh_normal.png"),
        "occlusion": ("r", "raw", "mesh_occlusionRoughnessMetallic.png"),
        "roughness": ("g", "raw", "mesh_occlusionRoughnessMetallic.png"),
        "metallic": ("b", "raw", "mesh_occlusionRoughnessMetallic.png"),
    }
    for slot, (channel, space, name) in expected.items():
        reader, output = connected(surface, slot)
        assert (output, reader.GetInput("sourceColorSpace").Get()) == (channel, space), slot
        assert reader.GetInput("file").Get().path == name
        assert Path(reader.GetInput("file").Get().resolvedPath).is_file()
        primvar, _ = connected(reader, "st")
        assert primvar.GetInput("varname").Get() == "st"
    assert tuple(connected(surface, "normal")[0].GetInput("bias").Get()) == (-1, -1, -1, 0)
    assert tuple(connected(surface, "emissiveColor")[0].GetInput("scale").Get()) == (4, 4, 4, 1)
    assert surface.GetInput("opacityThreshold").Get() == 0.5
    assert "position" not in usda_text(*sphere, {"position": "mesh_position.exr"})[0]


def test_pixar_s_validators_have_no_complaint(sphere: Pair, tmp_path: Path) -> None:
    path = written(rich(sphere), tmp_path, MAPS)
    assert complaints(path) == []
    path.write_text(path.read_text().replace('(\n        prepend apiSchemas = ["MaterialBindingAPI"]\n    )', ""))
    assert len(complaints(path)) == 1  # they can complain


def test_factors_stand_where_no_texture_is(quad: Pair) -> None:
    material = Material("m", (0.5, 0.25, 0.125, 0.75), metallic=0.5, roughness=0.375, emissive=(2.0, 0.0, 1.0))
    text, _ = usda_text(quad[0], replace(quad[1], materials=(material,)), {})
    for line in (
        "diffuseColor = (0.5, 0.25, 0.125)",
        "opacity = 0.75",
        "metallic = 0.5",
        "roughness = 0.375",
        "emissiveColor = (2, 0, 1)",
    ):
        assert line in text
    assert "UsdUVTexture" not in text
    assert "inputs:metallic = 0\n" in usda_text(quad[0], replace(quad[1], materials=(Material(),)), {})[0]


def test_any_name_becomes_an_identifier(quad: Pair) -> None:
    assert [prim_name(text) for text in ("bunny", "9 lives", "größe-2", "")] == ["bunny", "_9_lives", "gr__e_2", "mesh"]
    assert "@@@a@b.png@@@" in usda_text(*quad, {"base-color": "a@b.png"})[0]

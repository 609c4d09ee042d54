"""The GLB holds the atlas as it is, and the Khronos validator has nothing to say against it."""

from __future__ import annotations

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
import pytest
import trimesh
from trimesh.visual import TextureVisuals

from flexpara.bake.baker import bake
from flexpara.bake.files.gltf import glb_bytes, write_glb
from flexpara.bake.files.images import quantize, read_image
from flexpara.bake.maps.tangents import vertex_tangents
from flexpara.runtime.errors import ShapeError
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.material import SLOTS, Material, Picture
from flexpara.runtime.mesh import Asset, Atlas

Pair = tuple[Atlas, Asset]

VALIDATOR = Path(__file__).with_name("validate_gltf.mjs")
NUMPY_TYPES = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


def parse(data: bytes) -> pygltflib.GLTF2:
    document = pygltflib.GLTF2.load_from_bytes(data)
    assert document is not None
    return document


def blob(document: pygltflib.GLTF2) -> bytes:
    data = document.binary_blob()
    assert data is not None
    return data


def array(document: pygltflib.GLTF2, number: int) -> np.ndarray:
    """Contents of an accessor, (count, c)."""
    accessor = document.accessors[number]
    assert accessor.bufferView is not None
    view = document.bufferViews[accessor.bufferView]
    columns = COLUMNS[accessor.type]
    kind = np.dtype(NUMPY_TYPES[accessor.componentType])
    return np.frombuffer(blob(document), kind, accessor.count * columns, view.byteOffset or 0).reshape(-1, columns)


def attributes(document: pygltflib.GLTF2) -> dict[str, np.ndarray]:
    found = vars(document.meshes[0].primitives[0].attributes)
    return {name: array(document, number) for name, number in found.items() if number is not None}


def image_bytes(document: pygltflib.GLTF2, number: int) -> bytes:
    view = document.bufferViews[document.images[number].bufferView or 0]
    start = view.byteOffset or 0
    return blob(document)[start : start + view.byteLength]


def issues(path: Path) -> dict[str, object]:
    """The validator's verdict; skips where node or the package is absent."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed")
    done = subprocess.run([node, str(VALIDATOR), str(path)], capture_output=True, text=True, check=False, timeout=60)
    if "Cannot find module 'gltf-validator'" in done.stderr:
        pytest.skip("npm package gltf-validator is not installed")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def assert_valid(path: Path) -> None:
    verdict = issues(path)
    assert (verdict["numErrors"], verdict["numWarnings"]) == (0, 0), verdict["messages"]


def test_vertices_and_faces_are_the_atlas_s(sphere: Pair) -> None:
    atlas, asset = sphere
    document = parse(glb_bytes(atlas, asset, {}))
    found = attributes(document)
    assert set(found) == {"POSITION", "NORMAL", "TEXCOORD_0"}
    np.testing.assert_array_equal(found["POSITION"], atlas.positions.astype(np.float32))
    np.testing.assert_allclose(found["NORMAL"], atlas.normals, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(found["NORMAL"].astype(float), axis=1), 1.0, atol=1e-6)
    np.testing.assert_allclose(found["TEXCOORD_0"], np.column_stack([atlas.uv[:, 0], 1 - atlas.uv[:, 1]]), atol=1e-7)
    indices = document.meshes[0].primitives[0].indices
    assert indices is not None
    np.testing.assert_array_equal(array(document, indices).reshape(-1, 3), atlas.faces)
    position = document.accessors[document.meshes[0].primitives[0].attributes.POSITION or 0]
    np.testing.assert_array_equal(position.min, found["POSITION"].min(axis=0))
    np.testing.assert_array_equal(position.max, found["POSITION"].max(axis=0))
    assert document.nodes[0].translation is None


def test_many_vertices_take_wide_indices(fine_sphere: Pair) -> None:
    atlas, asset = fine_sphere
    narrow = parse(glb_bytes(atlas, asset, {}))
    assert narrow.accessors[-1].componentType == pygltflib.UNSIGNED_SHORT
    again = np.tile(np.arange(len(atlas.positions)), 7)
    shift = np.arange(7)[:, None, None] * len(atlas.positions)
    wide = replace(
        atlas,
        positions=atlas.positions[again],
        uv=atlas.uv[again],
        normals=atlas.normals[again],
        source_vertex=again,
        faces=(atlas.faces + shift).reshape(-1, 3),
    )
    document = parse(glb_bytes(wide, asset, {}))
    assert document.accessors[-1].componentType == pygltflib.UNSIGNED_INT
    np.testing.assert_array_equal(array(document, len(document.accessors) - 1).reshape(-1, 3), wide.faces)


def test_far_from_the_origin_the_node_carries_the_centre(sphere: Pair) -> None:
    atlas, asset = sphere
    far = replace(atlas, positions=atlas.positions + np.array([4.0e6, -7.0e6, 11.0]))
    document = parse(glb_bytes(far, asset, {}))
    translation = np.array(document.nodes[0].translation)
    again = attributes(document)["POSITION"].astype(np.float64) + translation
    assert np.abs(again - far.positions).max() < 1e-6 * np.linalg.norm(np.ptp(far.positions, axis=0))
    assert np.abs(far.positions.astype(np.float32) - far.positions).max() > 1e-2  # plain float32 would not do


def test_textures_are_embedded_as_8_bit_png(sphere: Pair, tmp_path: Path) -> None:
    textures = bake(*sphere, ["position", "uv-checker", "normal"], size=32)
    document = parse(glb_bytes(*sphere, textures))
    assert [image.name for image in document.images] == ["uv-checker", "normal"]
    for number in range(2):
        assert document.images[number].mimeType == "image/png"
        path = tmp_path / f"{number}.png"
        path.write_bytes(image_bytes(document, number))
        assert read_image(path).shape == (32, 32, 3)
        assert read_image(path).dtype == np.uint8
    material = document.materials[0]
    assert material.pbrMetallicRoughness is not None
    assert material.pbrMetallicRoughness.baseColorTexture is not None
    assert material.pbrMetallicRoughness.baseColorTexture.index == 0
    assert material.pbrMetallicRoughness.metallicFactor == 0.0
    assert material.normalTexture is not None
    assert material.normalTexture.index == 1
    (sampler,) = document.samplers
    assert (sampler.wrapS, sampler.wrapT) == (pygltflib.CLAMP_TO_EDGE, pygltflib.CLAMP_TO_EDGE)
    assert (sampler.magFilter, sampler.minFilter) == (pygltflib.LINEAR, pygltflib.LINEAR_MIPMAP_LINEAR)


def test_base_colour_goes_before_the_checker(quad: Pair) -> None:
    textures = bake(*quad, ["uv-checker", "chart", "base-color"], size=8)
    assert [image.name for image in parse(glb_bytes(*quad, textures)).images] == ["base-color"]


def test_tangents_come_with_a_normal_map_only(sphere: Pair) -> None:
    atlas, asset = sphere
    with_map = attributes(parse(glb_bytes(atlas, asset, bake(atlas, asset, ["normal"], size=8))))
    np.testing.assert_array_equal(with_map["TANGENT"], vertex_tangents(atlas))
    assert "TANGENT" not in attributes(parse(glb_bytes(atlas, asset, bake(atlas, asset, ["normal-object"], size=8))))


def test_green_points_up_in_the_glb_whatever_was_baked(quad: Pair, tmp_path: Path) -> None:
    atlas, asset = quad
    tilted = replace(asset, normals=np.tile(np.array([0.0, 0.6, 0.8]), (4, 1)))
    path = tmp_path / "normal.png"
    for normal_format in ("opengl", "directx"):
        textures = bake(atlas, tilted, ["normal"], size=8, normal_format=normal_format)
        path.write_bytes(image_bytes(parse(glb_bytes(atlas, tilted, textures)), 0))
        assert abs(read_image(path)[..., 1].astype(float).mean() - 0.8 * 255) < 0.2


def test_old_uv_and_colours_survive(quad: Pair) -> None:
    atlas, asset = quad
    colors = np.array([[255, 0, 0, 255], [188, 188, 188, 128], [0, 0, 0, 0], [1, 2, 3, 4]], np.uint8)
    rich = replace(asset, uv=np.array([[0.0, 3.0], [1, 2], [5, 5], [-1, 0]]), colors=colors)
    found = attributes(parse(glb_bytes(atlas, rich, {})))
    np.testing.assert_allclose(found["TEXCOORD_1"], [[0, -2], [1, -1], [5, -4], [-1, 1]])
    np.testing.assert_allclose(found["COLOR_0"][:2] / 65535, [[1, 0, 0, 1], [0.5029, 0.5029, 0.5029, 0.502]], atol=1e-3)
    textured = attributes(parse(glb_bytes(atlas, rich, bake(atlas, rich, ["vertex-color"], size=8))))
    assert "COLOR_0" not in textured  # it would be multiplied into the texture
    np.testing.assert_array_equal(textured["_COLOR_0"], found["COLOR_0"])


def test_a_single_material_keeps_its_name_and_factor(quad: Pair) -> None:
    atlas, asset = quad
    painted = replace(asset, materials=(Material("brass", (0.5, 0.25, 0.125, 1.0)),))
    material = parse(glb_bytes(atlas, painted, {})).materials[0]
    assert material.name == "brass"
    assert material.pbrMetallicRoughness is not None
    assert material.pbrMetallicRoughness.baseColorFactor == [0.5, 0.25, 0.125, 1.0]


def test_an_open_surface_is_seen_from_both_sides(quad: Pair, closed: Pair) -> None:
    assert parse(glb_bytes(*quad, {})).materials[0].doubleSided is True
    painted = closed[0], replace(closed[1], materials=(Material(),))
    assert parse(glb_bytes(*painted, {})).materials[0].doubleSided is False


def test_a_bare_mesh_has_uv_for_readers_that_find_them_by_material(closed: Pair, tmp_path: Path) -> None:
    write_glb(*closed, {}, tmp_path / "bare.glb")
    read = trimesh.load(tmp_path / "bare.glb", force="mesh", process=False)
    assert isinstance(read, trimesh.Trimesh)
    assert isinstance(read.visual, TextureVisuals)
    np.testing.assert_allclose(np.asarray(read.visual.uv), closed[0].uv, atol=1e-6)


def test_metadata_travels_in_the_extras(quad: Pair) -> None:
    document = parse(glb_bytes(*quad, {}, metadata={"charts": 1, "settings": {"seed": 3}}))
    assert document.asset.extras == {"flexpara": {"charts": 1, "settings": {"seed": 3}}}
    assert str(document.asset.generator).startswith("flexpara")


def test_the_same_atlas_gives_the_same_bytes(sphere: Pair) -> None:
    textures = bake(*sphere, ["normal", "chart"], size=32)
    assert glb_bytes(*sphere, textures) == glb_bytes(*sphere, textures)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"uv": np.zeros((3, 2), np.float32)}, "3 uv for 4 positions"),
        ({"faces": np.array([[0, 1, 9]])}, "indices in range"),
        ({"faces": np.zeros((0, 3), np.int64)}, "0 faces"),
        ({"source_vertex": np.array([0, 1, 2, 7])}, "source_vertex"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(quad: Pair, change: dict[str, np.ndarray], text: str) -> None:
    with pytest.raises(ShapeError, match=text):
        glb_bytes(replace(quad[0], **change), quad[1], {})


def test_the_validator_finds_faults(quad: Pair, tmp_path: Path) -> None:
    data = bytearray(glb_bytes(*quad, {}))
    document = parse(bytes(data))
    view = document.bufferViews[document.accessors[1].bufferView or 0]
    start = len(data) - len(blob(document)) + (view.byteOffset or 0)
    data[start : start + 12] = np.array([0, 0, 2], np.float32).tobytes()  # a normal twice too long
    (tmp_path / "bad.glb").write_bytes(data)
    assert issues(tmp_path / "bad.glb")["numErrors"] == 1


@pytest.mark.parametrize("maps", [[], ["normal", "uv-checker"], ["base-color"], ["normal", "vertex-color", "chart"]])
def test_the_khronos_validator_has_no_complaint(sphere: Pair, tmp_path: Path, maps: list[str]) -> None:
    atlas, asset = sphere
    count = len(asset.positions)
    colors = np.random.default_rng(0).integers(0, 256, (count, 4)).astype(np.uint8)
    rich = replace(asset, colors=colors, uv=atlas.uv.astype(np.float64) * 3)
    write_glb(atlas, rich, bake(atlas, rich, maps, size=64), tmp_path / "a.glb", metadata={"charts": 1})
    assert_valid(tmp_path / "a.glb")


SURFACE_MAPS = ["base-color", "normal", "orm", "emissive"]


def textured_pair(pair: Pair, **changes: Any) -> Pair:
    """The pair with a material of five textures on the atlas' own uv, repeated three times."""
    atlas, asset = pair
    noise = np.random.default_rng(1).integers(0, 256, (8, 8, 4)).astype(np.uint8)
    pictures: Any = {slot: Picture(noise) for slot in SLOTS}
    material = Material("rich", pictures=pictures, **{"emissive": (1.0, 0.5, 0.0), **changes})
    return atlas, replace(asset, uv=atlas.uv.astype(np.float64) * 3, materials=(material,))


@pytest.mark.parametrize("maps", [SURFACE_MAPS, ["metallic-roughness", "occlusion"], ["face-id", "distortion"]])
@pytest.mark.parametrize("mode", ["OPAQUE", "MASK", "BLEND"])
def test_the_validator_accepts_every_texture_and_alpha_mode(
    sphere: Pair, tmp_path: Path, maps: list[str], mode: Any
) -> None:
    pair = textured_pair(sphere, alpha_mode=mode, emissive=(3.0, 0.0, 1.0), double_sided=True)
    write_glb(*pair, bake(*pair, maps, size=32), tmp_path / "a.glb")
    assert_valid(tmp_path / "a.glb")


@pytest.mark.parametrize("changes", [{}, {"alpha_mode": "MASK", "alpha_cutoff": 0.3}, {"emissive": (8.0, 1.0, 0.0)}])
def test_the_validator_accepts_factors_alone(sphere: Pair, tmp_path: Path, changes: dict[str, Any]) -> None:
    atlas, asset = sphere
    material = Material("bare", (0.5, 0.25, 1.0, 0.5), metallic=0.75, roughness=0.125, **changes)
    write_glb(atlas, replace(asset, materials=(material,)), {}, tmp_path / "a.glb")
    assert_valid(tmp_path / "a.glb")
    (again,) = load_asset(tmp_path / "a.glb").materials
    for name in ("name", "base_color_factor", "metallic", "roughness", "emissive", *list(changes)):
        assert getattr(again, name) == pytest.approx(getattr(material, name)), name


def test_packed_maps_are_embedded_once(sphere: Pair) -> None:
    pair = textured_pair(sphere)
    document = parse(glb_bytes(*pair, bake(*pair, SURFACE_MAPS, size=16)))
    assert [image.name for image in document.images] == ["base-color", "orm", "normal", "emissive"]
    material = document.materials[0]
    assert material.pbrMetallicRoughness is not None
    assert material.pbrMetallicRoughness.metallicRoughnessTexture is not None
    assert material.occlusionTexture is not None
    assert material.pbrMetallicRoughness.metallicRoughnessTexture.index == material.occlusionTexture.index == 1
    assert (material.pbrMetallicRoughness.metallicFactor, material.pbrMetallicRoughness.roughnessFactor) == (1, 1)
    assert material.emissiveFactor == [1, 1, 1]


def test_emission_beyond_1_takes_the_extension(sphere: Pair) -> None:
    pair = textured_pair(sphere, emissive=(4.0, 0.0, 0.0))
    document = parse(glb_bytes(*pair, bake(*pair, ["emissive"], size=16)))
    assert document.materials[0].extensions == {"KHR_materials_emissive_strength": {"emissiveStrength": 4.0}}
    assert document.extensionsUsed == ["KHR_materials_emissive_strength"]


def test_what_was_written_is_read_again(sphere: Pair, tmp_path: Path) -> None:
    """Our reader on our file: every slot, clamped, with the pixels of the maps."""
    pair = textured_pair(sphere, alpha_mode="BLEND")
    textures = bake(*pair, SURFACE_MAPS, size=16)
    write_glb(*pair, textures, tmp_path / "a.glb")
    (material,) = load_asset(tmp_path / "a.glb").materials
    assert set(material.pictures) == set(SLOTS)
    assert {picture.wrap for picture in material.pictures.values()} == {("clamp", "clamp")}
    assert material.alpha_mode == "BLEND"
    maps = {"base-color": "base-color", "normal": "normal", "occlusion": "orm", "emissive": "emissive"}
    for slot, name in maps.items():
        stored = quantize(textures[name], bits=8)
        found = material.pictures[slot].pixels  # type: ignore[index]
        np.testing.assert_array_equal(found[..., : stored.shape[2]], stored)


def test_degenerate_normals_and_tangents_still_validate(quad: Pair, tmp_path: Path) -> None:
    atlas, asset = quad
    broken = replace(atlas, normals=np.zeros((4, 3), np.float32), uv=np.full((4, 2), 0.5, np.float32))
    write_glb(broken, asset, bake(atlas, asset, ["normal"], size=8), tmp_path / "a.glb")
    assert_valid(tmp_path / "a.glb")

"""What a file holds and no output does is counted, format by format."""

from __future__ import annotations

from pathlib import Path

import pytest
from scenefile import whole_scene

from flexpara.runtime.io.asset.changes import lost, told
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.mesh import Asset
from flexpara.runtime.options.unwrap import Outputs


@pytest.fixture
def scene(tmp_path: Path) -> Asset:
    path = tmp_path / "scene.glb"
    path.write_bytes(whole_scene().glb())
    return load_asset(path)


def losses(asset: Asset, *formats: str, maps: tuple[str, ...] = ()) -> dict[str, int]:
    return lost(asset, Outputs(formats=formats, maps=maps))


@pytest.mark.parametrize(
    ("formats", "joined"),
    [
        (("obj",), {"joined_nodes": 4}),
        (("ply",), {"joined_nodes": 4, "joined_materials": 2}),
        (("npz",), {"joined_nodes": 4, "joined_materials": 2}),
        (("usda",), {}),
        (("ply", "usda"), {}),
    ],
)
def test_what_is_joined_is_counted_where_no_format_keeps_it(
    scene: Asset, formats: tuple[str, ...], joined: dict[str, int]
) -> None:
    found = losses(scene, *formats)
    assert {name: count for name, count in found.items() if name.startswith("joined")} == joined
    still = {"skipped_animations": 1, "skipped_skins": 1, "skipped_morph_targets": 1, "skipped_cameras": 1}
    still |= {"skipped_lights": 1, "skipped_attributes": 1, "skipped_uv_sets": 1, "skipped_extras": 3}
    assert {name: found.get(name) for name in still} == still
    assert (found["skipped_extensions"], found["skipped_pictures"]) == (1, 1)


def test_gltf_loses_nothing_whatever_else_is_written(scene: Asset) -> None:
    assert losses(scene, "glb") == losses(scene, "obj", "gltf") == {}


def test_a_picture_that_a_map_is_baked_of_is_not_lost(scene: Asset) -> None:
    assert "skipped_pictures" not in losses(scene, "usda", maps=("base-color",))


def test_a_primitive_that_gets_a_material_is_counted_and_not_complained_of(tmp_path: Path) -> None:
    made = whole_scene()
    del made.tree["meshes"][1]["primitives"][0]["material"]
    path = tmp_path / "plain.glb"
    path.write_bytes(made.glb())
    found = losses(load_asset(path), "glb")
    assert found == {"given_materials": 1}
    assert told(found) == []
    assert lost(load_asset(path), Outputs(uv_set=2, maps=())) == {}


def test_objects_that_usd_has_as_meshes_are_not_lost_and_groups_are(tmp_path: Path) -> None:
    path = tmp_path / "named.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\no part\ng side\ns 1\nf 1 2 3\nl 1 2\ncurv 0 1 1 2\n", encoding="utf-8")
    asset, left = load_asset(path), {"skipped_lines": 1, "skipped_curves": 1}
    assert losses(asset, "glb") == {"skipped_names": 3, **left}
    assert losses(asset, "usda") == {"skipped_names": 2, **left}

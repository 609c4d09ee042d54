"""COLLADA: a mesh with bones stands where it was bound, and one whose material is absent is there all the same."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh

from flexpara.runtime.io.formats.collada import unskinned
from flexpara.runtime.io.meshfile import load_asset

if TYPE_CHECKING:
    from pathlib import Path

SKIN = """<library_controllers>
<controller id="skin" name="a"><skin source="#morph"><bind_shape_matrix>1 0 0 5 0 1 0 0 0 0 1 -2 0 0 0 1
</bind_shape_matrix></skin></controller>
<controller id='morph'><morph method="NORMALIZED" source='#{mesh}'><targets/></morph></controller>
</library_controllers><library_visual_scenes>"""
CONTROLLED = """<node><matrix>2 0 0 9 0 2 0 9 0 0 2 9 0 0 0 1</matrix>
<instance_controller sid="s" url="#skin"><skeleton>#bone</skeleton>{materials}</instance_controller></node>
<node><translate>0 3 0</translate><instance_controller url='#morph'/></node></visual_scene>"""


@pytest.fixture
def skinned(tmp_path: Path) -> Path:
    """A box in its place, as a skin of its morph controller, and as that controller alone."""
    pytest.importorskip("collada")
    trimesh.creation.box().export(tmp_path / "box.dae")
    text = (tmp_path / "box.dae").read_text(encoding="utf-8")
    mesh = text.split('<geometry id="')[1].split('"')[0]
    materials = text.split(f'<instance_geometry url="#{mesh}">')[1].split("</instance_geometry>")[0]
    text = text.replace("<library_visual_scenes>", SKIN.format(mesh=mesh))
    text = text.replace("</visual_scene>", CONTROLLED.format(materials=materials))
    (tmp_path / "skinned.dae").write_text(text, encoding="utf-8")
    return tmp_path / "skinned.dae"


def test_a_skinned_mesh_stands_where_it_was_bound_and_is_said_to_have_lost_its_skin(skinned: Path) -> None:
    asset, box = load_asset(skinned), load_asset(skinned.parent / "box.dae")
    middles = asset.positions[asset.faces].reshape(3, -1, 3).mean(axis=1)
    np.testing.assert_allclose(middles, [[0, 0, 0], [5, 0, -2], [0, 0, 0]], atol=1e-9)
    assert len(asset.faces) == 3 * len(box.faces)
    assert asset.changes["skipped_skins"] == 2
    assert asset.changes["skipped_morph_targets"] == 1


def test_a_file_without_controllers_stays_as_it_is() -> None:
    assert unskinned(b"<node><instance_geometry url='#a'/></node>") == b"<node><instance_geometry url='#a'/></node>"


def test_each_mesh_stays_in_its_scene() -> None:
    scene = b"<visual_scene><node><instance_controller url='#%b'/></node></visual_scene>"
    found = unskinned(scene % b"a" + scene % b"b")
    plain = b'<visual_scene><node></node><node><instance_geometry url="#%b"></instance_geometry></node></visual_scene>'
    assert found == plain % b"a" + plain % b"b"


@pytest.mark.parametrize("share", np.linspace(0.05, 0.95, 19))
def test_a_file_that_is_cut_off_anywhere_keeps_what_it_has(skinned: Path, share: float) -> None:
    data = skinned.read_bytes()
    cut = data[: int(share * len(data))]
    assert len(unskinned(cut)) >= 0.5 * len(cut)


def test_controllers_that_name_each_other_end() -> None:
    ring = b"<controller id='a'><skin source='#b'/></controller><controller id='b'><skin source='#a'/></controller>"
    assert b"instance_geometry" in unskinned(ring + b"<instance_controller url='#a'/>")


@pytest.mark.parametrize("broken", ["target", "instance_effect url"])
def test_a_mesh_whose_material_is_not_in_the_file_is_read_without_it(tmp_path: Path, broken: str) -> None:
    pytest.importorskip("collada")
    trimesh.creation.box().export(tmp_path / "box.dae")
    head, mesh, tail = (tmp_path / "box.dae").read_text(encoding="utf-8").rpartition(f'{broken}="#')
    assert mesh
    (tmp_path / "broken.dae").write_text(head + mesh + "absent" + tail, encoding="utf-8")
    asset = load_asset(tmp_path / "broken.dae")
    assert len(asset.faces) == 12
    assert asset.changes["unreadable_materials"] == 1
    assert "unreadable_materials" not in load_asset(tmp_path / "box.dae").changes


def test_decimal_commas_are_read_as_points(tmp_path: Path) -> None:
    pytest.importorskip("collada")
    trimesh.creation.box().export(tmp_path / "box.dae")
    text = (tmp_path / "box.dae").read_text(encoding="utf-8")
    (tmp_path / "commas.dae").write_text(re.sub(r"(?<=\d)\.(?=\d)", ",", text), encoding="utf-8")
    point, comma = (load_asset(tmp_path / f"{name}.dae") for name in ("box", "commas"))
    np.testing.assert_array_equal(comma.positions, point.positions)

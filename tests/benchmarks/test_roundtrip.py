"""The table of round trips: what it calls the same, what it calls different, and what it says without Blender."""

from __future__ import annotations

import copy
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.roundtrip import differences, held, main, without_given


def one_square() -> dict[str, Any]:
    thing = {"name": "A", "type": "MESH", "polygons": 1, "keys": [], "uv_sets": 1}
    facts = {"objects": [thing], "meshes": ["A"], "materials": {"Red": "DITHERED"}, "actions": []}
    normals, poses = np.tile([0.0, 0.0, 1.0], (4, 1)), np.stack([np.array([[0.0, 0.0, z]]) for z in (0, 1, 2)])
    return {"facts": facts, "sizes_0": np.array([4]), "normals_0": normals, "poses_0": poses}


def test_equal_files_are_the_same_and_another_uv_set_is_no_difference() -> None:
    after = copy.deepcopy(one_square())
    after["facts"]["objects"][0]["uv_sets"] = 2
    assert differences(one_square(), after) == "the same; normals 0°, poses 0"
    assert held(after) == "1 meshes, 1 polygons, 1 materials"


def test_each_difference_is_said() -> None:
    after = copy.deepcopy(one_square())
    after["facts"]["materials"] = {"Blue": "DITHERED"}
    after["sizes_0"] = np.array([3, 3])
    assert differences(one_square(), after) == "materials: ['Red'] → ['Blue']; A: 1 polygons → 2"
    turned = copy.deepcopy(one_square())
    turned["normals_0"][0] = [0.0, 1.0, 0.0]
    turned["poses_0"][2] += 0.5
    assert differences(one_square(), turned) == "the same; normals 90°, poses 0.4"


def test_a_material_given_to_what_had_none_is_no_difference() -> None:
    before, after = one_square(), copy.deepcopy(one_square())
    before["facts"]["objects"][0]["materials"] = []
    after["facts"]["objects"][0]["materials"] = ["material"]
    after["facts"]["materials"]["material"] = "DITHERED"
    assert differences(before, after).startswith("objects")
    assert differences(before, without_given(after)) == "the same; normals 0°, poses 0"


def test_without_bpy_it_says_so_and_ends_well(capsys: pytest.CaptureFixture[str]) -> None:
    python = sys.executable if "bpy" not in sys.modules else "/nowhere"
    assert main(["--blender-python", python, str(Path(__file__).parent)]) == 0
    assert "has no bpy, nothing is compared" in capsys.readouterr().out

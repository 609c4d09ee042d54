"""Materials: what stays a factor and what needs a map."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from flexpara.runtime.io.meshfile import asset_from_arrays
from flexpara.runtime.material import SLOTS, Material, Picture, seen_through, source_maps, used_materials


def asset_with(*materials: Material, uv: bool = True) -> Any:
    asset = asset_from_arrays([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 3, 2]])
    corners = np.zeros((len(asset.positions), 2)) if uv else None
    return replace(asset, materials=materials, uv=corners, face_material=np.arange(2) % len(materials))


def test_the_source_s_maps_are_those_that_vary() -> None:
    picture = Picture(np.zeros((1, 1, 4), np.uint8))
    full = Material(pictures=dict.fromkeys(SLOTS, picture))
    assert source_maps(asset_with(full)) == ("normal", "base-color", "orm", "emissive")
    assert source_maps(asset_with(full, uv=False)) == ()
    assert source_maps(asset_with(Material())) == ()
    assert source_maps(asset_with(Material(metallic=1.0), Material())) == ("metallic-roughness",)
    assert source_maps(asset_with(Material(pictures={"occlusion": picture}))) == ("occlusion",)
    assert source_maps(asset_with(Material(), Material(base_color_factor=(1, 0, 0, 1)))) == ("base-color",)


def test_materials_that_glow_alike_need_no_map() -> None:
    lamp, plain = Material(emissive=(1.0, 1.0, 1.0)), Material()
    assert source_maps(asset_with(lamp, lamp)) == ()
    assert source_maps(asset_with(lamp, plain)) == ("emissive",)


def test_used_are_the_materials_that_some_face_has() -> None:
    one, two = Material("one"), Material("two")
    asset = asset_with(one, two)
    assert used_materials(replace(asset, face_material=np.array([1, 1]))) == [two]
    assert used_materials(replace(asset, face_material=None)) == [one]
    assert used_materials(replace(asset, face_material=None, materials=())) == []


def test_alpha_of_factor_or_texture_is_seen_through() -> None:
    solid, glass = Picture(np.full((1, 1, 4), 255, np.uint8)), Picture(np.full((1, 1, 4), 254, np.uint8))
    assert not seen_through((1, 1, 1, 1), None)
    assert not seen_through((1, 1, 1, 1), solid)
    assert seen_through((1, 1, 1, 1), glass)
    assert seen_through((1, 1, 1, 0.5), solid)

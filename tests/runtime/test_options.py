"""Options and outputs: defaults, every bound, and what "auto" stands for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from flexpara.runtime.errors import InputError
from flexpara.runtime.material import Material, Picture
from flexpara.runtime.mesh import Asset, Surface
from flexpara.runtime.options import Options, Outputs

SURFACE = Surface(np.eye(3), np.array([[0, 1, 2]]))


def asset(**parts: Any) -> Asset:
    return Asset(SURFACE.vertices, SURFACE.faces, np.arange(3), SURFACE, **parts)


@pytest.mark.parametrize(("size", "margin"), [(256, 2), (1024, 4), (2048, 8), (4096, 16)])
def test_padding_follows_the_size_unless_given(size: int, margin: int) -> None:
    assert Options(size=size).margin == margin
    assert Options(size=size, padding=0).margin == 0


@pytest.mark.parametrize(
    ("wrong", "right"),
    [
        ({"charts": 0}, {"charts": 1}),
        ({"size": 15}, {"size": 16}),
        ({"size": 16385}, {"size": 16384}),
        ({"padding": -1}, {"padding": 0}),
        ({"padding": 257}, {"padding": 256}),
        ({"seed": -1}, {"seed": 0}),
        ({"seed": 2**32}, {"seed": 2**32 - 1}),
        ({"preset": "slow"}, {"preset": "fast"}),
        ({"mode": "both", "preset": "paper"}, {"mode": "global", "preset": "paper"}),
        ({"mode": "global"}, {"mode": "multi-chart"}),
        ({"steps": 0, "preset": "paper"}, {"steps": 1, "preset": "paper"}),
        ({"steps": 5}, {"steps": None}),
        ({"width": 0, "preset": "paper"}, {"width": 1, "preset": "paper"}),
        ({"width": 8193, "preset": "paper"}, {"width": 8192, "preset": "paper"}),
        ({"points": 15, "preset": "paper"}, {"points": 16, "preset": "paper"}),
        ({"points": 100}, {"points": None}),
        ({"precision": "int8", "preset": "paper"}, {"precision": "bfloat16", "preset": "paper"}),
        ({"ablation": ("upper",), "preset": "paper"}, {"ablation": ("no-upper",), "preset": "paper"}),
        ({"ablation": ("no-upper",)}, {"ablation": ()}),
    ],
)
def test_each_bound_is_exact_and_named(wrong: dict[str, Any], right: dict[str, Any]) -> None:
    name = next(iter(wrong))
    with pytest.raises(InputError, match=f"{name} is .*expected .*;"):
        Options(**wrong)
    Options(**right)


@pytest.mark.parametrize(
    "wrong", [{"formats": ("fbx",)}, {"formats": ()}, {"texture_format": "jpg"}, {"normal_format": "vulkan"}]
)
def test_an_unknown_format_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=r"format is .*expected"):
        Outputs(**wrong)


def test_auto_shows_the_colours_of_the_source_or_else_a_checker() -> None:
    picture = Material(pictures={"base-color": Picture(np.zeros((1, 1, 4), np.uint8))})
    assert Outputs().for_asset(asset()).maps == ("normal", "position", "uv-checker")
    assert Outputs().for_asset(asset(materials=(Material(),))).maps[-1] == "uv-checker"
    assert Outputs().for_asset(asset(materials=(picture,), uv=np.zeros((3, 2)))).maps[-1] == "base-color"
    assert Outputs().for_asset(asset(colors=np.zeros((3, 4), np.uint8))).maps[-1] == "base-color"


def test_maps_are_kept_in_order_and_once() -> None:
    outputs = Outputs(maps=("chart", "auto", "normal")).for_asset(asset())
    assert outputs.maps == ("chart", "normal", "position", "uv-checker")
    assert Outputs(maps=()).for_asset(asset()).maps == ()

"""Options and outputs: defaults, every bound, and what "auto" stands for."""

from __future__ import annotations

import ast
import inspect
import textwrap
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexpara.bake.commands import BakeOptions
from flexpara.runtime.cli.console import Console
from flexpara.runtime.errors import InputError
from flexpara.runtime.material import Material, Picture
from flexpara.runtime.mesh import Asset, Surface
from flexpara.runtime.options.keywords import from_keywords
from flexpara.runtime.options.sources import MapSources
from flexpara.runtime.options.unwrap import CheckpointOptions, Options, Outputs, TrainOptions

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
        ({"crease_angle": -0.1}, {"crease_angle": 0.0}),
        ({"crease_angle": 180.5}, {"crease_angle": 180.0}),
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
    name = next(iter(wrong)).replace("_", "-")
    with pytest.raises(InputError, match=f"{name} is .*expected .*;"):
        Options(**wrong)
    Options(**right)


@pytest.mark.parametrize(
    "wrong", [{"formats": ("fbx",)}, {"formats": ()}, {"texture_format": "jpg"}, {"normal_format": "vulkan"}]
)
def test_an_unknown_format_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=r"format is .*expected"):
        Outputs(**wrong)


@pytest.mark.parametrize("wrong", [{"target": "unreal"}, {"formats": ("glb", "obj")}, {"formats": ("usda",)}])
def test_layers_do_not_fit_what_names_one_file_a_map(wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=r"layers with .*expected .*leave"):
        Outputs(layers=True, **wrong)
    Outputs(layers=True)


def test_a_whole_number_of_degrees_is_taken() -> None:
    assert from_keywords(Options, None, {"crease_angle": 45}).crease_angle == 45.0
    with pytest.raises(InputError, match=r"crease_angle is '45', expected .*; pass one of type float"):
        from_keywords(Options, None, {"crease_angle": "45"})


def test_files_are_named_by_words_or_paths_one_or_several_and_a_cage_by_a_number() -> None:
    for given in ("a.obj", Path("a.obj"), ["a.obj"], (Path("a.obj"),)):
        assert from_keywords(Outputs, None, {"high": given, "cage": 0.1}).high == (Path("a.obj"),)
    assert from_keywords(Outputs, None, {"high": "a.obj", "cage": 0.1}).cage == "0.1"
    assert from_keywords(Options, None, {"start": "a.obj"}).start == Path("a.obj")
    assert from_keywords(Options, Options(start=Path("a.obj")), {"start": None}).start is None
    for wrong in (3, [3], [["a.obj"]], [None], None, {"a": 1}):
        with pytest.raises(InputError, match=r"high is .*, expected the name of a file"):
            from_keywords(Outputs, None, {"high": wrong})
    for wrong in (3, ["a.obj"], True):
        with pytest.raises(InputError, match=r"start is .*, expected the name of a file"):
            from_keywords(Options, None, {"start": wrong})


def test_auto_stands_for_what_the_source_has() -> None:
    picture = Material(pictures={"base-color": Picture(np.zeros((1, 1, 4), np.uint8))})
    assert Outputs().for_asset(asset()).maps == ()
    assert Outputs().for_asset(asset(materials=(Material(),))).maps == ()
    assert Outputs().for_asset(asset(materials=(picture,), uv=np.zeros((3, 2)))).maps == ("base-color",)
    assert Outputs().for_asset(asset(colors=np.zeros((3, 4), np.uint8))).maps == ("base-color",)


def test_maps_are_kept_in_order_and_once() -> None:
    outputs = Outputs(maps=("chart", "auto", "normal", "chart")).for_asset(asset(colors=np.zeros((3, 4), np.uint8)))
    assert outputs.maps == ("chart", "base-color", "normal")
    assert Outputs(maps=()).for_asset(asset()).maps == ()


def test_a_preview_is_drawn_where_maps_are_unless_decided() -> None:
    assert Outputs().for_asset(asset()).preview is True
    assert Outputs(maps=()).for_asset(asset()).preview is False
    assert Outputs(maps=(), preview=True).for_asset(asset()).preview is True
    assert Outputs(preview=False).for_asset(asset()).preview is False


def helps(kind: type) -> dict[str, str]:
    """The text under each field, by the field's name; of the classes it inherits too."""
    found: dict[str, str] = {}
    for owner in reversed(kind.__mro__[:-1]):
        body = next(iter(ast.parse(textwrap.dedent(inspect.getsource(owner))).body))
        assert isinstance(body, ast.ClassDef)
        for field, text in zip(body.body, body.body[1:], strict=False):
            if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant):
                found[ast.unparse(field.target)] = str(text.value.value)
    return found


@pytest.mark.parametrize("kind", [Options, Outputs, TrainOptions, CheckpointOptions, BakeOptions, MapSources, Console])
def test_every_option_is_explained_in_a_sentence(kind: Any) -> None:
    texts = helps(kind)
    assert {field.name for field in fields(kind)} <= set(texts)
    assert [name for name, text in texts.items() if not (text[0].isupper() or text.startswith("auto"))] == []
    assert [name for name, text in texts.items() if not text.endswith((".", "…"))] == []


def test_keywords_replace_fields_of_what_was_made() -> None:
    made = Options(charts=3, seed=5)
    assert from_keywords(Options, made, {"charts": 4}) == Options(charts=4, seed=5)
    assert from_keywords(Outputs, None, {"maps": "ao, normal", "formats": ["obj"]}).maps == ("ao", "normal")
    with pytest.raises(InputError, match="seed is -1"):
        from_keywords(Options, made, {"seed": -1})


@pytest.mark.parametrize(
    "wrong", [{"charts": "8"}, {"charts": 2.5}, {"seed": True}, {"padding": "4"}, {"preset": None}]
)
def test_a_keyword_of_another_type_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="expected"):
        from_keywords(Options, None, wrong)


def test_an_integer_of_numpy_is_an_integer() -> None:
    charts = from_keywords(Options, None, {"charts": np.int64(5)}).charts
    assert (charts, type(charts)) == (5, int)


@pytest.mark.parametrize("color", ["black", "#fff", "#12345g", "000000"])
def test_a_background_is_six_hexadecimal_digits(color: str) -> None:
    with pytest.raises(InputError, match=r"background is .*, expected a colour as #rrggbb; pass --background"):
        Outputs(background=color)
    assert Outputs(background="#12aBcd").background == "#12aBcd"


def test_seams_have_a_price_a_bound_and_charts_may_be_as_many_as_pay() -> None:
    asked = from_keywords(Options, None, {"charts": "auto", "seam_price": 0.01, "max_stretch": 1.025})
    assert (asked.charts, asked.seam_price, asked.max_stretch) == ("auto", 0.01, 1.025)
    assert asked.most_charts > 1000
    assert Options(charts=3).most_charts == 3


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"charts": 0}, "charts is 0"),
        ({"charts": "some"}, "charts is 'some'"),
        ({"seam_price": 0.0}, "seam-price is 0.0"),
        ({"page_price": -0.1}, "page-price is -0.1"),
        ({"max_stretch": 1.0}, "max-stretch is 1.0"),
        ({"max_stretch": 1.1, "preset": "paper"}, "max-stretch with preset paper"),
        ({"charts": "auto", "preset": "paper"}, "charts auto with preset paper"),
    ],
)
def test_what_seams_and_charts_can_not_be_is_refused(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Options(**wrong)

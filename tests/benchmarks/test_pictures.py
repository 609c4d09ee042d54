"""The pictures of the documents: each is there and shown, and each option that changes what one sees has one."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

import pytest

pytest.importorskip("moderngl")

from benchmarks.pictures.maps import MAPS, shown_maps
from benchmarks.pictures.options import OTHERS, SHOWN, words_of
from flexpara.bake.commands import BakeOptions
from flexpara.runtime.options.pack import PackOptions
from flexpara.runtime.options.sources import MapSources
from flexpara.runtime.options.unwrap import MapOptions, Options, PaperOptions

DOCS = Path(__file__).resolve().parents[2] / "docs"
KINDS = (Options, PackOptions, MapOptions, BakeOptions, MapSources)
ELSEWHERE = {"maps": "each map", "normal_format": "map-normal-format", "denoise": "map-denoise", "rays": "map-rays"}
ELSEWHERE |= {"background": "map-background", "samples": "map-samples-16", "size": "map-size-64"}
ELSEWHERE |= {"keep_islands": "keep-seams", "cage": "high", "importance_density": "importance"}
"""Options whose picture has another name, or stands beside others."""
NOT_SEEN = {"select", "preset", "time_budget", "texel_density", "fields", "uv_set", "match_names"}
"""Which meshes, which method, how long, whose uv and parts, and a number of texels that says itself what is seen."""
STORED = {"target", "texture_format", "layers", "exr_bits", "exr_compression"}
"""How files are named and stored."""


def test_each_option_that_changes_what_one_sees_has_a_picture() -> None:
    paper = {field.name for field in fields(PaperOptions)}
    every = {field.name for kind in KINDS for field in fields(kind)} - paper
    drawn = {name.replace("-", "_") for name in (*SHOWN, *OTHERS)}
    assert every - drawn - set(ELSEWHERE) - NOT_SEEN - STORED == set()
    assert drawn <= every


def test_each_picture_is_made_and_shown() -> None:
    names = [*SHOWN, *OTHERS, *(f"map-{shown.name}" for shown in shown_maps()), "map-background"]
    text = (DOCS / "reference" / "options.md").read_text(encoding="utf-8")
    shown = set(re.findall(r"pictures/([\w-]+)\.webp\)", text))
    assert sorted(set(names) - shown) == []
    assert [name for name in names if not (DOCS / "pictures" / f"{name}.webp").is_file()] == []
    assert set(MAPS) <= {name.removeprefix("map-") for name in names}


def test_settings_read_as_one_types_them() -> None:
    assert words_of({}) == "by default"
    assert words_of({"keep_seams": ("uv", "hard"), "keep_islands": True}) == "--keep-seams uv,hard --keep-islands"

"""The metadata of an exported file: what is written comes back, and what is wrong is named."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import numpy as np
import pytest

from flexpara.runtime.errors import BundleError, InputError
from flexpara.runtime.mesh import Frame
from flexpara.runtime.sessions.bundle import BundleMetadata

FACTS = BundleMetadata(
    chart_count=2,
    patch_count=3,
    frame=Frame(centre=(0.1, -2e-17, 3e8), scale=0.3),
    placement=(((0.5, 0.0, 0.25), (0.0, 0.5, 0.5)), ((0.0, -0.25, 0.5), (0.25, 0.0, 1.0 / 3.0))),
    patch_chart=(0, 1, 1),
    size=256,
    padding=2,
    source_sha256="ab" * 32,
    settings={"charts": 2, "net": {"width": 64}},
    metrics={"isometric_mean": 0.1, "charts": ["slim", "slit"]},
    producer_name="flexpara",
    producer_version="0.1.0",
)


def test_what_is_written_comes_back() -> None:
    assert BundleMetadata.from_json(FACTS.to_json()) == FACTS


def test_the_text_is_one_line_and_the_same_whatever_the_order_of_keys() -> None:
    turned = dataclasses.replace(FACTS, settings={"net": {"width": 64}, "charts": 2})
    assert turned.to_json() == FACTS.to_json()
    assert "\n" not in FACTS.to_json()


def test_other_languages_find_the_promised_keys() -> None:
    content = json.loads(FACTS.to_json())
    assert content["producer"] == {"name": "flexpara", "version": "0.1.0"}
    assert content["frame"] == {"centre": [0.1, -2e-17, 3e8], "scale": 0.3}
    assert (content["format_version"], content["chart_count"], content["source_sha256"]) == (1, 2, "ab" * 32)
    assert "v up" in content["conventions"]["uv"]


def test_placement_is_an_array_of_charts() -> None:
    assert FACTS.placement_array().shape == (2, 2, 3)
    assert FACTS.placement_array()[1, 1].tolist() == [0.25, 0.0, 1.0 / 3.0]


@pytest.mark.parametrize("value", [float("nan"), float("inf"), np.zeros(2), b"bytes", {1, 2}], ids=repr)
def test_what_json_cannot_hold_is_refused(value: object) -> None:
    with pytest.raises(InputError, match="convert them first"):
        dataclasses.replace(FACTS, metrics={"value": value}).to_json()


@pytest.mark.parametrize(
    "text",
    ["", "{", "[]", "3", "null", '{"a": NaN}', "[" * 100_000, '{"format_version": ' + "1" * 5000 + "}"],
    ids=["empty", "cut", "list", "number", "null", "NaN", "deep", "long number"],
)
def test_a_text_that_is_no_metadata_is_refused(text: str) -> None:
    with pytest.raises(BundleError, match=r"a\.onnx: flexpara metadata") as caught:
        BundleMetadata.from_json(text, "a.onnx")
    assert len(str(caught.value)) < 300
    assert "\n" not in str(caught.value)


HUGE = [[[1e308, 0.0, 0.0], [0.0, 1.0, 0.0]]] * 2
WRONG: list[tuple[str, Any]] = [
    ("format_version", 2),
    ("format_version", "1"),
    ("format_version", True),
    ("format_version", None),
    ("chart_count", 0),
    ("chart_count", 3),
    ("chart_count", 2.0),
    ("chart_count", 10**30),
    ("patch_count", -1),
    ("patch_count", 2),
    ("frame", None),
    ("frame", {"centre": [0.0, 0.0], "scale": 1.0}),
    ("frame", {"centre": [0.0, 0.0, "0"], "scale": 1.0}),
    ("frame", {"centre": [0.0, 0.0, 1e999], "scale": 1.0}),
    ("frame", {"centre": [0.0, 0.0, 0.0], "scale": 0.0}),
    ("frame", {"centre": [0.0, 0.0, 0.0], "scale": [1.0]}),
    ("frame", {"centre": [0.0, 0.0, 0.0], "scale": 1e-320}),
    ("placement", [[0.0] * 6] * 2),
    ("placement", [[[0.0] * 3, [0.0] * 2]] * 2),
    ("placement", "x" * 10_000),
    ("patch_chart", [0, 1]),
    ("patch_chart", [0, 1, 2]),
    ("patch_chart", [0, 1, -1]),
    ("patch_chart", [0, 1, 0.5]),
    ("patch_chart", [False, True, True]),
    ("size", 0),
    ("size", 10**9),
    ("padding", -1),
    ("source_sha256", 5),
    ("settings", []),
    ("metrics", None),
    ("producer", "me"),
    ("producer", {"name": "x"}),
]


@pytest.mark.parametrize(("key", "value"), WRONG, ids=lambda value: repr(value)[:40])
def test_a_wrong_value_is_named(key: str, value: object) -> None:
    content = json.loads(FACTS.to_json()) | {key: value}
    text = json.dumps(content).replace("Infinity", "1e999")
    with pytest.raises(
        BundleError, match=r"a\.onnx: flexpara metadata has .* expected .*; export the file again"
    ) as caught:
        BundleMetadata.from_json(text, "a.onnx")
    assert len(str(caught.value)) < 250
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("key", [key for key in json.loads(FACTS.to_json()) if key != "conventions"])
def test_a_missing_value_is_named(key: str) -> None:
    content = json.loads(FACTS.to_json())
    del content[key]
    with pytest.raises(BundleError, match=rf"has {key}.* = None, expected"):
        BundleMetadata.from_json(json.dumps(content))

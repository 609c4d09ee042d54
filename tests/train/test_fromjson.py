"""Configs read back from JSON: what was saved is what is used again, and nothing else passes."""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import pytest

from flexpara.runtime.errors import InputError
from flexpara.train.config import TrainConfig
from flexpara.train.deploy.config import FitConfig, GrowConfig, WrapConfig
from flexpara.train.fromjson import fit_in_force, from_json, wrap_in_force

FIT = FitConfig(grow=GrowConfig(steepest=7.0), tolerance=0.25)
WRAP = WrapConfig(normal=0.5)
CONFIG = replace(TrainConfig(), fit=FIT, wrap=WRAP)


def test_a_config_survives_json() -> None:
    assert from_json(FitConfig, json.loads(json.dumps(asdict(FIT))), "fit") == FIT


def test_the_numbers_in_force_are_those_of_the_result_in_either_preset() -> None:
    fast, paper = {"preset": "fast", **asdict(CONFIG)}, {"preset": "paper", "steps": 3, "deploy": asdict(CONFIG)}
    for settings in (fast, paper):
        assert fit_in_force(settings) == FIT
        assert wrap_in_force(settings) == WRAP


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"extra": 1}, "extra"),
        ({"tolerance": "small"}, r"fit\.tolerance is 'small', expected float"),
        ({"tolerance": True}, r"fit\.tolerance is 'True'"),
        ({"grow": None}, r"fit\.grow has missing or unknown fields \(NoneType\)"),
        ({"grow": {**asdict(FIT.grow), "most": 1.5}}, r"fit\.grow\.most is '1.5', expected int"),
    ],
)
def test_facts_that_are_no_config_are_refused_by_name(change: dict[str, object], named: str) -> None:
    with pytest.raises(InputError, match=named):
        from_json(FitConfig, {**asdict(FIT), **change}, "fit")


def test_settings_without_numbers_of_the_fit_are_refused() -> None:
    with pytest.raises(InputError, match=r"settings\.fit has missing or unknown fields"):
        fit_in_force({"preset": "fast", "seed": 0})

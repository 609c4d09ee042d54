"""What a user asks of a preset reaches its config: one option, one number, and no other."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

pytest.importorskip("torch")
from flexpara.__main__ import main
from flexpara.runtime.io.points.cloud import PointCloud
from flexpara.runtime.options.unwrap import ABLATIONS, TrainOptions
from flexpara.runtime.process.progress import Clock
from flexpara.train import presets
from flexpara.train.cloud.config import CloudConfig
from flexpara.train.paper import pipeline
from flexpara.train.paper.config import PaperConfig
from flexpara.train.presets import paper_config, train_cloud

if TYPE_CHECKING:
    from pathlib import Path

REACHED: dict[str, tuple[Any, str, Any]] = {
    "charts": (3, "charts", 3),
    "seed": (7, "seed", 7),
    "mode": ("global", "mode", "global"),
    "steps": (12, "steps", 12),
    "points": (99, "points", 99),
    "width": (24, "nets.hidden", 24),
    "precision": ("bfloat16", "dtype", "bfloat16"),
}
PARTS = {
    "no-triangle": ("triangle", False),
    "no-differential": ("differential", False),
    "no-upper": ("upper", False),
    "no-lower": ("lower", False),
    "bidirectional": ("chart_bidirectional", True),
    "chart-differential": ("chart_differential", True),
}


def flat(config: PaperConfig) -> dict[str, Any]:
    """Every number by its dotted name."""
    found: dict[str, Any] = {}
    for name, value in asdict(config).items():
        found |= (
            {f"{name}.{part}": inner for part, inner in value.items()} if isinstance(value, dict) else {name: value}
        )
    return found


def changed(options: TrainOptions) -> dict[str, Any]:
    """What these options make other than a plain multi-chart run of preset paper has."""
    plain, asked = (flat(paper_config(each)) for each in (TrainOptions(preset="paper"), options))
    return {name: value for name, value in asked.items() if value != plain[name]}


def test_without_options_preset_paper_is_as_published_but_for_the_mode() -> None:
    assert paper_config(TrainOptions(preset="paper")) == PaperConfig(mode="multi-chart")


@pytest.mark.parametrize("name", REACHED)
def test_an_option_reaches_its_number_and_no_other(name: str) -> None:
    value, target, expected = REACHED[name]
    assert changed(TrainOptions(**{"preset": "paper", name: value})) == {target: expected}


def test_every_ablation_is_tried_here() -> None:
    assert set(PARTS) == set(ABLATIONS)


@pytest.mark.parametrize("name", ABLATIONS)
def test_an_ablation_changes_its_part_and_no_other(name: str) -> None:
    part, present = PARTS[name]
    assert changed(TrainOptions(preset="paper", ablation=(name,))) == {f"ablation.{part}": present}


def test_ablations_are_taken_together() -> None:
    found = changed(TrainOptions(preset="paper", mode="global", ablation=("no-triangle", "no-upper")))
    assert found == {"mode": "global", "ablation.triangle": False, "ablation.upper": False}


def test_the_command_line_reaches_the_config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[PaperConfig] = []

    def train_paper_surface(_surface: object, config: PaperConfig, *_: object, **__: object) -> None:
        seen.append(config)
        raise KeyboardInterrupt

    monkeypatch.setattr(pipeline, "train_paper_surface", train_paper_surface)
    mesh = tmp_path / "triangle.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", encoding="utf-8")
    words = "--preset paper --mode global --ablation no-lower,no-differential --width 32 --precision bfloat16 --seed 5"
    assert main(["train", str(mesh), "-o", str(tmp_path / "out"), *words.split()]) == 130
    (config,) = seen
    assert (config.mode, config.nets.hidden, config.dtype, config.seed) == ("global", 32, "bfloat16", 5)
    assert (config.ablation.lower, config.ablation.differential) == (False, False)
    assert (config.ablation.upper, config.ablation.triangle) == (True, True)


@pytest.mark.usefixtures("instant_training")
def test_the_numbers_of_a_point_cloud_are_saved() -> None:
    side = np.linspace(0.0, 1.0, 12)
    x, y = (axis.reshape(-1) for axis in np.meshgrid(side, side))
    cloud = PointCloud(np.stack([x, y, np.zeros_like(x)], axis=1))
    mesh, trained = train_cloud(cloud, TrainOptions(), Clock())
    assert trained.settings["cloud"] == asdict(CloudConfig())
    assert len(mesh.asset.faces) == 2 * 11 * 11
    assert presets.reconstruct(cloud).asset.faces.tolist() == mesh.asset.faces.tolist()

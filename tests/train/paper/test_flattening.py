"""Preset paper at reduced width and steps: it flattens, and finds a seam where the surface needs one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from benchmarks.paper_shapes import BAR, TASKS, flatten, shape
from flexpara.train.paper.batches import PaperInput
from flexpara.train.paper.config import PaperConfig, PaperNets
from flexpara.train.paper.pipeline import vertex_normals
from flexpara.train.paper.training import train_paper


@pytest.mark.parametrize("name", ["hemisphere", "tube"])
def test_a_simple_surface_is_flattened_and_cut_only_where_it_is_closed(name: str) -> None:
    task = TASKS[name]
    result = flatten(name, task.coarse, task.fine, task.config)
    assert result.conformality <= BAR
    assert result.flipped < 0.02
    assert bool(result.cut.any()) is task.closed
    assert result.cut.mean() < 0.05


def test_a_knotted_tube_is_cut_open_and_laid_out_in_strips() -> None:
    """Half the width and a quarter of the steps with which `benchmarks.paper_shapes` reaches 0.1; folded: 0.37.

    Strips may be mirrored, each by itself, so the share of flipped faces says nothing here.
    """
    task = TASKS["trefoil"]
    small = replace(task.config, steps=1500, points=324, nets=PaperNets(hidden=128), seed=1)
    result = flatten("trefoil", task.coarse, task.fine, small)
    assert result.conformality <= 0.19
    assert 0.01 < result.cut.mean() < 0.12


def test_charts_share_a_torus_with_little_stretch() -> None:
    config = PaperConfig(mode="multi-chart", charts=6, steps=400, points=300, nets=PaperNets(hidden=64), device="cpu")
    surface = shape("torus", 48)
    networks = train_paper(
        PaperInput(surface.vertices, vertex_normals(surface), surface.faces), config, lambda _step, _loss: None
    )
    with torch.no_grad():
        logits, every = networks(torch.from_numpy(surface.vertices).float())
    chart = logits.argmax(dim=1).numpy()
    assert 3 <= len(set(chart.tolist())) <= 6
    whole = surface.faces[(chart[surface.faces] == chart[surface.faces[:, :1]]).all(axis=1)]
    uv, xyz = every.numpy()[whole, chart[whole]], surface.vertices[whole]
    flat, solid = (np.linalg.norm(side - np.roll(side, -1, axis=1), axis=-1) for side in (uv, xyz))
    stretch = float(np.abs(flat / solid - 1.0).mean())
    assert stretch < 0.06
    score = torch.softmax(logits, dim=1).amax(dim=1)
    assert score.mean() > 0.9

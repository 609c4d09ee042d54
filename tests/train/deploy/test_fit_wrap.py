"""The inverse: half a pipe and back, normals, charts that lie over each other, and nothing at all."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from flexpara.runtime.errors import InputError
from flexpara.runtime.mesh import Charts, Surface
from flexpara.train.deploy.config import SampleConfig, WrapConfig
from flexpara.train.deploy.fit_wrap import HEIGHT, fit_wrap, on_layers
from flexpara.train.deploy.gated import Answer

QUICK = WrapConfig(samples=SampleConfig(even=20_000, beside=5000))
Packed = tuple[Surface, Charts, NDArray[np.float64]]


def silence(stage: str, step: int, steps: int, loss: float | None = None) -> None:
    """Progress that nobody watches."""


def on_the_pipe(uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points of a pipe of radius ½ at chart uv (n, 2); their x and y, doubled, are the normal."""
    return np.stack([0.5 * np.cos(2.0 * uv[:, 0]), 0.5 * np.sin(2.0 * uv[:, 0]), uv[:, 1]], axis=1)


def half_pipe(rows: int = 60) -> Packed:
    """Half a pipe about z, unrolled to (angle / 2, z) as one chart; in the atlas at half that scale."""
    corner = np.arange((rows + 1) ** 2).reshape(rows + 1, rows + 1)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    angle, z = np.meshgrid(np.linspace(0.0, np.pi, rows + 1), np.linspace(-0.8, 0.8, rows + 1), indexing="ij")
    uv = np.stack([0.5 * angle.ravel(), z.ravel()], axis=1)
    none = np.zeros(len(faces), np.int64)
    charts = Charts(none, uv[faces], none, np.zeros(1, np.int64), ("slim",))
    return Surface(on_the_pipe(uv), faces), charts, 0.5 * (uv[faces] + [0.1, 0.9])


def ask(packed: Packed, uv: NDArray[np.float64], chart: NDArray[np.int64]) -> Answer:
    networks = fit_wrap(*packed, QUICK, progress=silence)
    return networks(on_layers(uv.astype(np.float32), chart, len(packed[1].method)))


def test_a_pipe_comes_back_with_its_normals() -> None:
    inside = np.random.default_rng(1).uniform([0.0, -0.8], [0.5 * np.pi, 0.8], (2000, 2))
    found = ask(half_pipe(), 0.5 * (inside + np.array([0.1, 0.9])), np.zeros(2000, np.int64)).value
    truth = on_the_pipe(inside)
    normal = found[:, 3:] / np.linalg.norm(found[:, 3:], axis=1, keepdims=True)
    assert np.linalg.norm(found[:, :3] - truth, axis=1).max() < 2e-3
    cosine = np.einsum("nd,nd->n", normal[:, :2], 2.0 * truth[:, :2])
    assert np.arccos(cosine.clip(-1.0, 1.0)).mean() < np.deg2rad(1.5)


def test_charts_that_lie_over_each_other_are_told_apart_by_their_number() -> None:
    surface, charts, packed = half_pipe(20)
    moved = surface.vertices * [0.5, 0.5, 0.5] + [0.1, -0.4, 0.0]
    both = Surface(
        np.concatenate([surface.vertices, moved]), np.concatenate([surface.faces, surface.faces + len(moved)])
    )
    chart = np.repeat([0, 1], len(surface.faces))
    two = Charts(chart, np.tile(charts.corner_uv, (2, 1, 1)), chart, np.arange(2), ("slim",) * 2)
    inside = np.random.default_rng(2).uniform([0.01, -0.79], [0.5 * np.pi - 0.01, 0.79], (1000, 2))
    ask_for = np.arange(1000) % 2
    found = ask((both, two, np.tile(packed, (2, 1, 1))), 0.5 * (inside + np.array([0.1, 0.9])), ask_for)
    truth = on_the_pipe(inside)
    truth[ask_for == 1] = truth[ask_for == 1] * 0.5 + [0.1, -0.4, 0.0]
    assert (found.label == ask_for).mean() > 0.99
    assert np.median(np.linalg.norm(found.value[:, :3] - truth, axis=1)) < 2e-3


def test_layers_lie_below_the_height_and_apart() -> None:
    layers = on_layers(np.zeros((3, 2), np.float32), np.array([0, 1, 999]), 1000)
    assert layers.dtype == np.float32
    assert layers[:, 2].tolist() == pytest.approx([0.0, HEIGHT / 1000, HEIGHT * 0.999])


def test_the_same_seed_gives_the_same_inverse() -> None:
    first, again = (fit_wrap(*half_pipe(10), QUICK, seed=3, progress=silence) for _ in range(2))
    assert np.array_equal(first.weights, again.weights)


def test_no_faces_are_refused() -> None:
    none = np.zeros(0, np.int64)
    charts = Charts(none, np.zeros((0, 3, 2)), none, none, ())
    with pytest.raises(InputError, match="charts of 0 faces"):
        fit_wrap(Surface(np.zeros((0, 3)), np.zeros((0, 3), np.int64)), charts, np.zeros((0, 3, 2)), progress=silence)


def test_progress_is_told() -> None:
    told: list[tuple[str, int, int]] = []

    def note(stage: str, step: int, steps: int, loss: float | None = None) -> None:
        del loss
        told.append((stage, step, steps))

    fit_wrap(*half_pipe(6), QUICK, progress=note)
    assert told == [("fit points", i, 2) for i in range(3)]

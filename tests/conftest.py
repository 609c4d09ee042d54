"""What all tests share: the import rule of this layout, real meshes, and a training that takes no time."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import pytest

if TYPE_CHECKING:
    from flexpara.runtime.mesh import Surface
    from flexpara.runtime.progress import Progress

MODELS = Path(__file__).resolve().parent.parent.parent / "shared" / "models"


class _RootIsNoTestPackage:
    """The root's __init__.py is the package `flexpara`: pytest must not import it under another name."""

    @pytest.hookimpl(tryfirst=True)
    def pytest_collect_directory(self, path: Path, parent: pytest.Collector) -> pytest.Collector | None:
        if path == parent.config.rootpath:
            return pytest.Dir.from_parent(parent, path=path)
        return None


def pytest_configure(config: pytest.Config) -> None:
    """Register the import rule."""
    config.pluginmanager.register(_RootIsNoTestPackage())


@pytest.fixture
def models() -> Path:
    """The folder of real meshes; tests that use it skip where it is absent."""
    if not MODELS.is_dir():
        pytest.skip(f"no real meshes at {MODELS}")
    return MODELS


@pytest.fixture
def instant_training(monkeypatch: pytest.MonkeyPatch) -> list[Surface]:
    """Replaces training: one chart, the projection onto the xy plane, with networks that know nothing of it.

    Returns the surfaces it was asked to train, for tests of what happens before and after training.
    """
    torch = pytest.importorskip("torch")
    from flexpara.runtime.mesh import Charts, Frame
    from flexpara.train import presets
    from flexpara.train.config import NetConfig, TrainConfig
    from flexpara.train.learn.networks import AtlasNetworks

    trained: list[Surface] = []

    def train(surface: Surface, settings: TrainConfig, progress: Progress | None = None) -> SimpleNamespace:
        trained.append(surface)
        if progress is not None:
            progress("train", 1, 1, 0.5)
        none = np.zeros(len(surface.faces), np.int64)
        return SimpleNamespace(
            charts=Charts(none, surface.triangles[..., :2].copy(), none, np.zeros(1, np.int64), ("slim",)),
            networks=AtlasNetworks(1, NetConfig(), generator=torch.Generator().manual_seed(0)),
            frame=Frame.of(surface.vertices),
            settings={"preset": "fast", **asdict(settings)},
            report={},
            paper=None,
        )

    monkeypatch.setattr(presets, "train", train)
    return trained

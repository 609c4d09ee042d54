"""What all tests share: the import rule of this layout, real meshes or what stands in for them, instant training.

At the end of a run one line says what was skipped and why.  Where pytest-xdist runs tests side by side, each worker
gets its share of the cores: libraries read their number of threads from the environment, once, when they are imported.
"""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from house import write_house
from standins import FACTS, write_standins

import flexpara.train  # noqa: F401  # before torch, whose threads it tells how to wait
from flexpara.runtime.samples import make_sample

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from flexpara.runtime.mesh import Surface
    from flexpara.runtime.process.deadline import Deadline
    from flexpara.runtime.process.progress import Progress

MODELS = Path(__file__).resolve().parent.parent.parent / "shared" / "models"
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class _RootIsNoTestPackage:
    """The root's __init__.py is the package `flexpara`: pytest must not import it under another name."""

    @pytest.hookimpl(tryfirst=True)
    def pytest_collect_directory(self, path: Path, parent: pytest.Collector) -> pytest.Collector | None:
        if path == parent.config.rootpath:
            return pytest.Dir.from_parent(parent, path=path)
        return None


def pytest_configure(config: pytest.Config) -> None:
    """Register the import rule; give the workers that are about to start their share of the cores."""
    config.pluginmanager.register(_RootIsNoTestPackage())
    workers = len(getattr(config.option, "tx", None) or ())
    if workers > 1:
        share = max(1, len(os.sched_getaffinity(0)) // workers)
        os.environ.update({name: os.environ.get(name, str(share)) for name in THREADS})


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """One line for all skipped tests: how many, and for which reasons."""
    skipped = terminalreporter.stats.get("skipped", [])
    reasons = Counter(report.longrepr[2].removeprefix("Skipped: ") for report in skipped)
    if reasons:
        told = " · ".join(f"{count} × {reason}" for reason, count in reasons.most_common())
        terminalreporter.write_line(f"{len(skipped)} tests were skipped: {told}")


@pytest.fixture(scope="session")
def models(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of real meshes, or of made ones of the same names and kinds where that is absent."""
    if MODELS.is_dir():
        return MODELS
    folder = tmp_path_factory.mktemp("standins")
    write_standins(folder)
    return folder


@pytest.fixture
def house(tmp_path: Path) -> Path:
    """An OBJ file of two quads on half of a texture: the first red, the second blue."""
    return write_house(tmp_path)


@pytest.fixture(scope="session")
def write_samples() -> Callable[[Path, Sequence[str]], Path]:
    """Writes NAME.obj of coarse samples into a folder, and gives the folder back."""

    def write(folder: Path, names: Sequence[str]) -> Path:
        for name in names:
            vertices, faces = make_sample(name, resolution=4)
            lines = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
            (folder / f"{name}.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")
        return folder

    return write


@pytest.fixture(scope="session")
def facts(models: Path) -> dict[str, tuple[int, dict[str, int]]]:
    """Name → faces and what cleaning changes, of the meshes in `models` for which somebody counted."""
    real = {
        "bunny": (56172, {}),
        "spot": (5856, {"welded_vertices": 295}),
        "fandisk": (12946, {}),
        "suzanne": (968, {"welded_vertices": 2, "coincident_faces": 2, "components": 5}),
    }
    return real if models == MODELS else FACTS


@pytest.fixture
def instant_training(monkeypatch: pytest.MonkeyPatch) -> list[Surface]:
    """Replaces training: one chart, the projection onto the xy plane.

    Returns the surfaces it was asked to train, for tests of what happens before and after training.
    """
    pytest.importorskip("torch")
    import numpy as np

    from flexpara.runtime.io.asset.wantedseams import NO_WISH, WantedSeams
    from flexpara.runtime.mesh import Charts, Frame, Surface
    from flexpara.train import presets
    from flexpara.train.config import TrainConfig
    from flexpara.train.deploy.fit import fit_networks
    from flexpara.train.pipeline import Trained
    from flexpara.train.workers import Beside

    trained: list[Surface] = []

    def train(
        surface: Surface,
        settings: TrainConfig,
        progress: Progress | None = None,
        deadline: Deadline | None = None,
        wanted: WantedSeams = NO_WISH,
    ) -> Trained:
        assert wanted == NO_WISH, (wanted, deadline)
        trained.append(surface)
        if progress is not None:
            progress("train", 1, 1, 0.5)
        none, frame = np.zeros(len(surface.faces), np.int64), Frame.of(surface.vertices)
        charts = Charts(none, surface.triangles[..., :2].copy(), none, np.zeros(1, np.int64), ("slim",))
        ball = Surface(frame.apply(surface.vertices), surface.faces)
        return Trained(
            charts=charts,
            fitted=Beside.known(fit_networks(ball, charts, settings.fit, settings.seed)),
            frame=frame,
            settings={"preset": "fast", **asdict(settings)},
            report={},
            paper=None,
        )

    monkeypatch.setattr(presets, "train", train)
    return trained

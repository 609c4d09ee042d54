"""What the tests of training share: finished charts by hand, moved surfaces, and one torch thread."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import torch

from flexpara.runtime.mesh import Charts, Frame, Surface
from flexpara.runtime.samples import make_sample

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray


@pytest.fixture(scope="module", autouse=True)
def one_torch_thread() -> Iterator[None]:
    """Run torch on one thread while these modules run."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture
def moved() -> Callable[..., Surface]:
    """A surface turned, scaled and moved; mirrored where asked, with its faces still outwards."""

    def move(surface: Surface, *, size: float = 1.0, seed: int = 0, mirrored: bool = False) -> Surface:
        rng = np.random.default_rng(seed)
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn)) * (-1.0 if mirrored else 1.0)
        vertices = size * surface.vertices @ turn.T + rng.normal(size=3) * 5.0
        return Surface(vertices, surface.faces[:, [0, 2, 1]] if mirrored else surface.faces)

    return move


def charts_by(face_chart: NDArray[np.int64], corner_uv: NDArray[np.float64]) -> Charts:
    """Charts of one patch each."""
    count = int(face_chart.max()) + 1
    return Charts(face_chart, corner_uv, face_chart, np.arange(count), ("slim",) * count)


@pytest.fixture
def sheet() -> Surface:
    """The square [−0.7, 0.7]² in the plane z = 0."""
    corner = np.arange(11**2).reshape(11, 11)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    line = np.linspace(-0.7, 0.7, 11)
    x, y = np.meshgrid(line, line, indexing="ij")
    xyz = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    return Surface(xyz, np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3))


@pytest.fixture
def two_halves(sheet: Surface) -> tuple[Surface, Charts]:
    """A sheet cut at x = 0: the left half keeps xy as uv, the right half is turned by 90° and moved far away."""
    right = (sheet.triangles[:, :, 0].mean(axis=1) > 0.0).astype(np.int64)
    xy = sheet.triangles[:, :, :2]
    turned = np.stack([5.0 - xy[..., 1], xy[..., 0] - 3.0], axis=-1)
    return sheet, charts_by(right, np.where(right[:, None, None] == 1, turned, xy))


@pytest.fixture
def six_sides() -> tuple[Surface, Charts]:
    """A cube in the unit ball, each side a chart with its own coordinates as uv."""
    vertices, faces = make_sample("cube", resolution=24)
    surface = Surface(Frame.of(vertices).apply(vertices), faces)
    normal = surface.face_normals()
    axis = np.abs(normal).argmax(axis=1)
    u, v = (np.take_along_axis(surface.triangles, ((axis + i) % 3)[:, None, None], axis=2) for i in (1, 2))
    return surface, charts_by(axis * 2 + (normal.sum(axis=1) > 0.0), np.concatenate([u, v], axis=2))

"""Small maps to export: random networks of plain layers and batched products, a surface, charts and a placement."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from flexpara.export.graph.metadata import PlacedCharts, Provenance, bundle_metadata
from flexpara.export.graph.parity import probe_points
from flexpara.runtime.mesh import Atlas, Charts, Frame
from flexpara.runtime.sessions.bundle import BundleMetadata


class PlainNetworks(nn.Module):
    """Sectors around the z axis as patches; an embedding and p Unwrap-Nets as batched products."""

    def __init__(self, patches: int, width: int = 16, seed: int = 0) -> None:
        super().__init__()
        rng = torch.Generator().manual_seed(seed)
        self.embedding = nn.Sequential(nn.Linear(3, width), nn.ReLU(), nn.Linear(width, width), nn.SiLU())
        self.assign = nn.Linear(3, patches)
        self.hidden = nn.Parameter(torch.randn(patches, width, width, generator=rng) / width**0.5)
        self.offset = nn.Parameter(torch.randn(patches, 1, width, generator=rng))
        self.last = nn.Parameter(torch.randn(patches, width, 2, generator=rng) / width**0.5)
        with torch.no_grad():
            for layer in self.modules():
                if isinstance(layer, nn.Linear):
                    layer.weight.normal_(std=layer.in_features**-0.5, generator=rng)
                    layer.bias.normal_(std=0.5, generator=rng)
            angle = torch.arange(patches) * (2.0 * torch.pi / patches)
            self.assign.weight.copy_(8.0 * torch.stack([angle.cos(), angle.sin(), 0.1 * angle], dim=1))

    def forward(self, xyz: Tensor) -> tuple[Tensor, Tensor]:
        feature = self.embedding(xyz)
        copies = feature.unsqueeze(0).expand(self.hidden.shape[0], -1, -1)
        hidden = torch.relu(torch.baddbmm(self.offset, copies, self.hidden))
        return self.assign(xyz), torch.einsum("pnw,pwc->npc", hidden, self.last)


@dataclass(frozen=True)
class Map:
    """All that export_onnx takes."""

    model: nn.Module
    frame: Frame
    atlas: Atlas
    charts: Charts

    def probes(self, count: int, seed: int = 0) -> np.ndarray:
        return probe_points(self.atlas, self.frame, self.charts.face_patch, count, seed)

    @property
    def metadata(self) -> BundleMetadata:
        return bundle_metadata(PlacedCharts(self.frame, self.atlas, self.charts), Provenance())


def sphere_points(count: int, centre: tuple[float, float, float], radius: float) -> np.ndarray:
    rng = np.random.default_rng(7)
    direction = rng.normal(size=(count, 3))
    return np.asarray(centre) + radius * direction / np.linalg.norm(direction, axis=1, keepdims=True)


def build_map(
    patch_chart: tuple[int, ...] = (0, 1, 1, 2),
    *,
    model: nn.Module | None = None,
    centre: tuple[float, float, float] = (3.0, -2.0, 5.0),
    radius: float = 2.5,
) -> Map:
    patches, charts = len(patch_chart), max(patch_chart) + 1
    positions = sphere_points(300, centre, radius)
    faces = np.arange(300, dtype=np.int64).reshape(-1, 3)
    turn = np.linspace(0.3, 1.2, charts)
    placement = np.zeros((charts, 2, 3))
    placement[:, 0, :2] = np.stack([np.cos(turn), -np.sin(turn)], axis=1) * 0.15
    placement[:, 1, :2] = np.stack([np.sin(turn), np.cos(turn)], axis=1) * 0.15
    placement[:, :, 2] = np.random.default_rng(1).uniform(0.3, 0.7, (charts, 2))
    face_patch = np.arange(len(faces), dtype=np.int64) % patches
    chart_of_patch = np.asarray(patch_chart, dtype=np.int64)
    return Map(
        model=model or PlainNetworks(patches),
        frame=Frame.of(positions),
        atlas=Atlas(
            positions=positions,
            faces=faces,
            uv=np.zeros((300, 2), np.float32),
            normals=np.zeros((300, 3), np.float32),
            face_chart=chart_of_patch[face_patch],
            source_vertex=np.arange(300),
            size=1024,
            padding=4,
            placement=placement,
        ),
        charts=Charts(
            face_chart=chart_of_patch[face_patch],
            corner_uv=np.zeros((len(faces), 3, 2)),
            face_patch=face_patch,
            patch_chart=chart_of_patch,
            method=("slim",) * charts,
        ),
    )


@pytest.fixture
def make_map() -> Callable[..., Map]:
    return build_map

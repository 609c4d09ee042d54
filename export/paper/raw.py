"""The networks of preset paper as they were trained, in the same kind of ONNX file as a finished map.

f faces · p charts.  uv are the networks' own, at one scale, each chart's box in a cell of a grid; seams are steep bands
of a continuous network, triangles across them are torn, charts may overlap themselves: for study, not for engines.
"""

from __future__ import annotations

import math
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np
import torch

from ...runtime.mesh import Atlas, Charts
from ...runtime.pack.growing.growth import apply_placement
from ...runtime.pagesize import PageSize
from ..graph.metadata import PlacedCharts
from .torchfile import export_onnx
from .torchmodel import frozen_copy

if TYPE_CHECKING:
    from torch import nn

    from ...runtime.mesh import Frame, Surface
    from ...runtime.pagesize import Size
    from ..graph.metadata import Provenance

MARGIN = 0.01
"""Free space around a chart's box, as a share of its cell."""


def raw_onnx(model: nn.Module, surface: Surface, frame: Frame, size: Size, facts: Provenance) -> bytes:
    """The ONNX file's bytes.

    Args:
        model: unit ball (n, 3) → logits (n, p), uv (n, p, 2).
        surface: in source units; its vertices say how far each chart's uv reach.
        frame: source units → unit ball.
        size: of the page.
        facts: for the metadata.

    Raises: ParityError when the exported network and torch disagree.
    """
    charts = raw_charts(model, surface, frame)
    atlas = raw_atlas(surface, charts, size)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "paper.onnx"
        export_onnx(model, PlacedCharts(frame, atlas, charts), path, metadata=facts)
        return path.read_bytes()


def raw_charts(model: nn.Module, surface: Surface, frame: Frame) -> Charts:
    """Each face on the chart that is most probable at its centre, its corners at the uv of that chart."""
    frozen = frozen_copy(model)
    with torch.no_grad():
        ball = torch.from_numpy(frame.apply(surface.vertices).astype(np.float32))
        uv = torch.cat([frozen(rows)[1] for rows in ball.split(16_384)]).double().numpy()
        centres = ball[torch.from_numpy(surface.faces)].mean(dim=1)
        chart = torch.cat([frozen(rows)[0].argmax(dim=1) for rows in centres.split(16_384)]).numpy()
    count = uv.shape[1]
    return Charts(chart, uv[surface.faces, chart[:, None]], chart, np.arange(count), ("raw",) * count)


def raw_atlas(surface: Surface, charts: Charts, size: Size) -> Atlas:
    """The charts' boxes in cells of a grid on the page, all at one scale; every face has corners of its own."""
    count = len(charts.patch_chart)
    cells = math.ceil(math.sqrt(count))
    low = np.zeros((count, 2))
    widest = 0.0
    for k in range(count):
        corner = charts.corner_uv[charts.face_chart == k].reshape(-1, 2)
        if len(corner):
            low[k], widest = corner.min(axis=0), max(widest, float(np.ptp(corner, axis=0).max()))
    scale = (1.0 - 2.0 * MARGIN) / (cells * (widest or 1.0))
    origin = (np.stack([np.arange(count) % cells, np.arange(count) // cells], axis=1) + MARGIN) / cells
    placement = np.zeros((count, 2, 3))
    placement[:, 0, 0] = placement[:, 1, 1] = scale
    placement[:, :, 2] = origin - scale * low
    extent = PageSize.of(size).extent
    placement *= (extent.min() / extent)[:, None]
    placed = apply_placement(placement, charts.face_chart, charts.corner_uv)
    corners = 3 * len(surface.faces)
    return Atlas(
        positions=surface.triangles.reshape(-1, 3),
        faces=np.arange(corners).reshape(-1, 3),
        uv=np.clip(placed, 0.0, 1.0).reshape(-1, 2).astype(np.float32),
        normals=np.repeat(surface.face_normals(), 3, axis=0).astype(np.float32),
        face_chart=charts.face_chart,
        source_vertex=surface.faces.reshape(-1),
        size=size,
        padding=0,
        placement=placement,
    )

"""The inverse of a finished atlas: networks that answer which surface point and normal lie at a uv.

n samples · p patches · k charts · w waves.  uv: chart coordinates (any unit); xyz: unit ball; normals: unit.

Inside a chart uv is injective, so the inverse needs no search: an Assign-Net of the chart picks the patch, and the
Wrap-Net of that patch answers.  Both are networks of one hidden layer of sines with random frequencies (Rahimi & Recht
2007, "Random Features for Large-Scale Kernel Machines"), whose last layer is solved for exactly by ridge regression:
no descent, one to two seconds of one core in all.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from ...runtime.errors import InputError
from ...runtime.geometry.normals import corner_normals, interpolated_normals
from ...runtime.geometry.triangles import signed_areas
from ...runtime.mesh import Surface
from ..config import WrapConfig
from ..sampling import sample_surface

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Charts
    from ...runtime.progress import Progress


class SineNets(nn.Module):
    """c networks uv → sines → outputs, side by side; all parameters are (c, ·, ·).

    f(uv) = sin((uv − centre) · frequency + phase) · last + (uv − centre) · slope + bias: the slope carries the plane
    that the sines bend.  All zero until they are fitted.
    """

    def __init__(self, copies: int, waves: int, outputs: int) -> None:
        super().__init__()
        self.waves = waves
        self.centre = nn.Parameter(torch.zeros(copies, 1, 2))
        self.frequency = nn.Parameter(torch.zeros(copies, 2, waves))
        self.phase = nn.Parameter(torch.zeros(copies, 1, waves))
        self.last = nn.Parameter(torch.zeros(copies, waves, outputs))
        self.slope = nn.Parameter(torch.zeros(copies, 2, outputs))
        self.bias = nn.Parameter(torch.zeros(copies, 1, outputs))

    def forward(self, uv: Tensor, index: Tensor) -> Tensor:
        """Outputs (n, c) at uv (n, 2) of the networks ``index``, int64 (n,), or (1,) where one answers for all rows.

        Gathers a network a row: meant for some thousand rows.  The exported graph gathers rows by network instead.
        """
        plane = uv.unsqueeze(1) - self.centre[index]
        hidden = torch.sin(plane @ self.frequency[index] + self.phase[index])
        found = hidden @ self.last[index] + plane @ self.slope[index] + self.bias[index]
        return found.squeeze(1)

    def design(self, index: int, uv: Tensor) -> Tensor:
        """(n, waves + 3) float64: what network ``index`` makes its outputs of, the sines, uv − centre, and 1."""
        plane = uv.double() - self.centre[index].double()
        hidden = torch.sin(plane @ self.frequency[index].double() + self.phase[index].double())
        return torch.cat([hidden, plane, torch.ones_like(plane[:, :1])], dim=1)

    def last_layer(self, index: int) -> Tensor:
        """(waves + 3, outputs) float64: design @ last_layer are the outputs."""
        return torch.cat([self.last[index], self.slope[index], self.bias[index]]).double()


class AtlasWrap(nn.Module):
    """p Wrap-Nets and k Assign-Nets: what export/wrap.py deploys.

    table: (k, m) int64, the patches of each chart in ascending order, −1 behind the last.
    """

    def __init__(self, patch_chart: NDArray[np.int64], charts: int, config: WrapConfig) -> None:
        super().__init__()
        self.table = patch_table(patch_chart, charts)
        self.surface = SineNets(len(patch_chart), config.waves, 6)
        self.assign = SineNets(charts, config.assign_waves, self.table.shape[1])

    def patch_scores(self, uv: Tensor, chart: Tensor) -> Tensor:
        """Scores (n, m) at uv (n, 2) of charts (n,): column i is the chart's i-th patch; the largest wins."""
        return self.assign(uv, chart)

    def wrap(self, uv: Tensor, patch: Tensor) -> tuple[Tensor, Tensor]:
        """Points xyz (n, 3), unit ball, and normals (n, 3) of about unit length at uv (n, 2) of patches (n,)."""
        found = self.surface(uv, patch)
        return found[:, :3], found[:, 3:]


def patch_table(patch_chart: NDArray[np.int64], charts: int) -> NDArray[np.int64]:
    """(k, m) int64, the patches of each chart in ascending order, −1 behind the last."""
    order = np.argsort(patch_chart, kind="stable")
    counts = np.bincount(patch_chart, minlength=charts)
    column = np.arange(len(order)) - np.repeat(np.cumsum(counts) - counts, counts)
    table = np.full((charts, int(counts.max(initial=1))), -1, dtype=np.int64)
    table[patch_chart[order], column] = order
    return table


class SheetSamples(NamedTuple):
    """Points of a surface with all that the inverse has to know.

    uv (n, 2), xyz (n, 3), normal (n, 3) float64; patch, chart (n,) int64; area (n,) float64: what a sample stands for.
    """

    uv: NDArray[np.float64]
    xyz: NDArray[np.float64]
    normal: NDArray[np.float64]
    patch: NDArray[np.int64]
    chart: NDArray[np.int64]
    area: NDArray[np.float64]


def sample_sheets(surface: Surface, charts: Charts, per_patch: int, rng: np.random.Generator) -> SheetSamples:
    """``per_patch`` points of each patch, stratified by area; area in chart coordinates."""
    normals, flat_area = corner_normals(surface), np.abs(signed_areas(charts.corner_uv))
    faces, barycentric, area = [], [], []
    for patch in range(len(charts.patch_chart)):
        ids = np.flatnonzero(charts.face_patch == patch)
        if len(ids) == 0:
            continue
        samples = sample_surface(Surface(surface.vertices, surface.faces[ids]), per_patch, rng)
        faces.append(ids[samples.face])
        barycentric.append(samples.barycentric)
        area.append(np.full(per_patch, flat_area[ids].sum() / per_patch))
    face, weight = np.concatenate(faces), np.concatenate(barycentric)
    return SheetSamples(
        uv=np.einsum("nc,ncd->nd", weight, charts.corner_uv[face]),
        xyz=np.einsum("nc,ncd->nd", weight, surface.triangles[face]),
        normal=interpolated_normals(normals, face, weight),
        patch=charts.face_patch[face],
        chart=charts.face_chart[face],
        area=np.concatenate(area),
    )


@torch.no_grad()
def draw_waves(nets: SineNets, index: int, uv: Tensor, area: float, band: float, generator: torch.Generator) -> None:
    """Random frequencies of network ``index`` for a region of that area around the uv (n, 2) float64.

    A region of area A has A f² / 4π modes up to the angular frequency f: f = √(4π w / A) is where w sines run out.
    Radii are drawn a little denser towards low frequencies than the modes lie.
    """
    highest = band * math.sqrt(4.0 * math.pi * nets.waves / area)
    radius, angle, phase = torch.rand((3, nets.waves), generator=generator, dtype=torch.float64)
    radius, angle = highest * radius**0.7, 2.0 * math.pi * angle
    nets.centre[index] = uv.mean(dim=0, keepdim=True)
    nets.frequency[index] = torch.stack([radius * torch.cos(angle), radius * torch.sin(angle)])
    nets.phase[index] = 2.0 * math.pi * phase


def penalty(waves: int) -> Tensor:
    """(waves + 3,) float64: 1 for the sines; for slope and bias only what keeps the equations solvable."""
    return torch.tensor([1.0, 1e-6], dtype=torch.float64).repeat_interleave(torch.tensor([waves, 3]))


@torch.no_grad()
def solve(nets: SineNets, index: int, uv: Tensor, target: Tensor, weight: Tensor, ridge: float) -> None:
    """Ridge regression of target (n, c) on the hidden layer of network ``index``, weights (n,) of sum 1; in float64.

    The ridge holds back the sines alone: what is flat comes back flat.  Outputs behind the c of the target stay as
    they are.
    """
    design = nets.design(index, uv)
    size = design.abs().amax(dim=0).clamp(min=1e-300)  # the products are to be of one size, in any unit of uv
    design = design / size
    weighted = (design * weight[:, None]).T
    gram = weighted @ design
    gram.diagonal().add_(ridge * gram.diagonal().mean() * penalty(nets.waves))
    solution = torch.cholesky_solve(weighted @ target, torch.linalg.cholesky(gram)) / size[:, None]
    parts = solution.split([nets.waves, 2, 1])
    for layer, part in zip((nets.last, nets.slope, nets.bias), parts, strict=True):
        layer[index, :, : target.shape[1]] = part


@torch.no_grad()
def fit_assign(model: AtlasWrap, samples: SheetSamples, config: WrapConfig, generator: torch.Generator) -> Tensor:
    """Assign-Nets by least squares on one-hot patches; returns the scores (n, m) float64 at the samples.

    A chart of one patch needs none; its score is 1.
    """
    uv, area = torch.from_numpy(samples.uv), torch.from_numpy(samples.area)
    scores = torch.ones((len(uv), model.table.shape[1]), dtype=torch.float64)
    for chart, patches in enumerate(model.table):
        count = int((patches >= 0).sum())
        rows = torch.from_numpy(np.flatnonzero(samples.chart == chart))
        if count < 2 or len(rows) == 0:
            continue
        one_hot = torch.from_numpy(samples.patch[rows.numpy()][:, None] == patches[:count]).double()
        total = float(area[rows].sum())
        draw_waves(model.assign, chart, uv[rows], total, config.band, generator)
        solve(model.assign, chart, uv[rows], one_hot, area[rows] / total, config.ridge)
        scores[rows] = model.assign.design(chart, uv[rows]) @ model.assign.last_layer(chart)
    return scores


@torch.no_grad()
def fit_surface(
    model: AtlasWrap, samples: SheetSamples, scores: Tensor, config: WrapConfig, generator: torch.Generator
) -> None:
    """Wrap-Nets by least squares on position and normal.

    Each patch also learns from its neighbours' samples in the chart, by their score: borders inside a chart agree, and
    a point that the Assign-Net gives to the neighbour gets the right answer there.
    """
    uv = torch.from_numpy(samples.uv)
    target = torch.from_numpy(np.concatenate([samples.xyz, samples.normal], axis=1))
    for chart, patches in enumerate(model.table):
        for column, patch in enumerate(patches[patches >= 0].tolist()):
            own = samples.patch == patch
            if not own.any():
                continue
            score = np.where(own, 1.0, np.clip(scores[:, column].numpy(), 0.0, 1.0))
            rows = np.flatnonzero(own | ((samples.chart == chart) & (score >= config.shared)))
            weight = torch.from_numpy(samples.area[rows] * score[rows])
            total = float(weight.sum())
            draw_waves(model.surface, patch, uv[rows], total, config.band, generator)
            solve(model.surface, patch, uv[rows], target[rows], weight / total, config.ridge)


def fit_wrap(
    surface: Surface, charts: Charts, config: WrapConfig | None = None, *, seed: int = 0, progress: Progress
) -> AtlasWrap:
    """The inverse of finished charts.

    Args:
        surface: in the unit ball.
        charts: of that surface; their uv in any unit.
        config: None = WrapConfig().
        seed: of samples and frequencies.
        progress: told of the stages "fit points".

    Raises:
        InputError: no patch has a face.
    """
    config = config or WrapConfig()
    if len(charts.face_patch) == 0:
        raise InputError("charts of 0 faces, expected at least one; pass the charts of a surface")
    rng, generator = np.random.default_rng(seed), torch.Generator().manual_seed(seed)
    model = AtlasWrap(charts.patch_chart, len(charts.method), config)
    samples = sample_sheets(surface, charts, max(config.samples // len(charts.patch_chart), config.fewest), rng)
    progress("fit points", 0, 2)
    scores = fit_assign(model, samples, config, generator)
    progress("fit points", 1, 2)
    fit_surface(model, samples, scores, config, generator)
    progress("fit points", 2, 2)
    return model.eval().requires_grad_(False)

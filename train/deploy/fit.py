"""Networks fitted to finished charts, so that they answer for any surface point what the atlas says.   unit ball.

n samples · p patches.  Two regressions: uv by the Unwrap-Nets, each on its own patch; the patch by the Assign-Net.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import torch
from scipy.spatial import KDTree
from torch import Tensor, nn

from ...runtime.geometry.topology import edge_table
from ...runtime.geometry.triangles import signed_areas
from ..learn.networks import AtlasNetworks
from ..learn.optimizer import OneCycleAdam
from ..sampling import sample_surface

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Charts, Surface
    from ...runtime.progress import Progress
    from ..config import FitConfig, NetConfig


class PatchSamples(NamedTuple):
    """The same number of samples on each patch.  xyz (p, m, 3), uv (p, m, 2) float32, uv centred and scaled per patch.

    centre (p, 1, 2) and scale (p, 1, 1) bring them back: uv_chart = uv · scale + centre.
    """

    xyz: Tensor
    uv: Tensor
    centre: Tensor
    scale: Tensor


def sample_patches(surface: Surface, charts: Charts, per_patch: int, rng: np.random.Generator) -> PatchSamples:
    """``per_patch`` area-weighted samples of each patch with their chart uv."""
    xyz, uv = [], []
    for patch in range(len(charts.patch_chart)):
        ids = np.flatnonzero(charts.face_patch == patch)
        samples = sample_surface(type(surface)(surface.vertices, surface.faces[ids]), per_patch, rng)
        xyz.append(samples.xyz)
        uv.append(np.einsum("nc,ncd->nd", samples.barycentric, charts.corner_uv[ids[samples.face]]))
    flat = np.stack(uv)
    centre = flat.mean(axis=1, keepdims=True)
    scale = np.abs(flat - centre).max(axis=(1, 2), keepdims=True) + 1e-12
    arrays = np.stack(xyz), (flat - centre) / scale, centre, scale
    return PatchSamples(*(torch.from_numpy(a.astype(np.float32)) for a in arrays))


def fit_unwrap(
    networks: AtlasNetworks, samples: PatchSamples, config: FitConfig, generator: torch.Generator, progress: Progress
) -> None:
    """Least squares on uv; the last layers are solved for exactly at the end, and take the chart's own units."""
    patches, count = samples.xyz.shape[:2]
    optimizer = OneCycleAdam(networks.unwrap, config.unwrap_steps, config.rate)
    rows = torch.arange(patches)[:, None]
    for step in range(config.unwrap_steps):
        pick = torch.randint(count, (patches, config.unwrap_batch), generator=generator)
        flat = networks.unwrap(networks.unwrap_features(samples.xyz[rows, pick]))
        loss = ((flat - samples.uv[rows, pick]) ** 2).mean()
        optimizer.step(loss)
        if step % 25 == 0:
            progress("fit uv", step, config.unwrap_steps, loss.item())
    solve_last_layer(networks, samples)


@torch.no_grad()
def solve_last_layer(networks: AtlasNetworks, samples: PatchSamples) -> None:
    """Ridge regression of uv (chart units) on the last hidden layer: the best last layer for the features found."""
    hidden = networks.unwrap_features(samples.xyz)
    for layer in networks.unwrap.layers[:-1]:
        hidden = nn.functional.silu(layer(hidden))
    hidden = hidden.double()
    design = torch.cat([hidden, torch.ones_like(hidden[..., :1])], dim=-1)
    gram = design.mT @ design
    ridge = (
        1e-7 * gram.diagonal(dim1=-2, dim2=-1).mean(dim=-1)[:, None, None] * torch.eye(gram.shape[-1], dtype=gram.dtype)
    )
    target = (samples.uv * samples.scale + samples.centre).double()
    solution = torch.linalg.solve(gram + ridge, design.mT @ target)
    weight, bias = networks.unwrap.layers[-1].parameters()
    weight.copy_(solution[:, :-1])
    bias.copy_(solution[:, -1:])


def sample_seams(
    surface: Surface, charts: Charts, count: int, reach: float, rng: np.random.Generator
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Points beside seams, evenly up to ``reach`` from them: their faces (count,) and barycentrics (count, 3).

    No points where there is no seam.
    """
    half = seam_halfedges(surface, charts)
    if len(half) == 0:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 3))
    face, corner = half // 3, half % 3
    corners = surface.triangles[face]
    row = np.arange(len(half))
    a, b = corners[row, corner], corners[row, (corner + 1) % 3]
    length = np.linalg.norm(b - a, axis=1)
    height = 2.0 * surface.face_areas()[face] / np.maximum(length, 1e-300)
    cumulative = np.cumsum(length)
    pick = np.searchsorted(cumulative, rng.random(count) * cumulative[-1]).clip(max=len(half) - 1)
    depth = np.minimum(rng.random(count) * reach / np.maximum(height[pick], 1e-300), 1.0)
    along = rng.random(count)
    barycentric = np.zeros((count, 3))
    for i, weight in enumerate(((1.0 - along) * (1.0 - depth), along * (1.0 - depth), depth)):
        barycentric[np.arange(count), (corner[pick] + i) % 3] = weight
    return face[pick], barycentric


def sample_thin(
    surface: Surface, charts: Charts, count: int, reach: float, rng: np.random.Generator
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Points where the surface comes close to itself with another answer: both sides of an ear, a fin, a sheet.

    Out of ``count`` samples, those with one of another patch within ``reach`` whose uv are elsewhere: their faces (n,)
    and barycentrics (n, 3).
    """
    pool = sample_surface(surface, count, rng)
    scale = np.sqrt(uv_area(charts) / surface.face_areas().sum())
    uv = np.einsum("nc,ncd->nd", pool.barycentric, charts.corner_uv[pool.face]) / scale
    distance, index = KDTree(pool.xyz).query(pool.xyz, k=16, distance_upper_bound=reach)
    near = np.isfinite(distance)
    other = np.where(near, index, 0)
    patch, chart = charts.face_patch[pool.face], charts.face_chart[pool.face]
    gap = np.linalg.norm(uv[:, None] - uv[other], axis=2)
    elsewhere = (chart[:, None] != chart[other]) | (gap > 3.0 * distance)
    thin = (near & (patch[:, None] != patch[other]) & elsewhere).any(axis=1)
    return pool.face[thin], pool.barycentric[thin]


def uv_area(charts: Charts) -> float:
    """Total area of all uv triangles."""
    return float(np.abs(signed_areas(charts.corner_uv)).sum())


def seam_halfedges(surface: Surface, charts: Charts) -> NDArray[np.int64]:
    """Half-edges 3·face + corner along borders between two charts, and along slits that divide two patches."""
    table = edge_table(surface.faces)
    half = table.edge_halfedges[table.edge_count >= 2]
    face, corner = half // 3, half % 3
    chart, patch = charts.face_chart[face], charts.face_patch[face]
    start, end = charts.corner_uv[face, corner], charts.corner_uv[face, (corner + 1) % 3]
    torn = (start[:, 0] != end[:, 1]).any(axis=1) | (end[:, 0] != start[:, 1]).any(axis=1)
    apart = (chart[:, 0] != chart[:, 1]) | (torn & (patch[:, 0] != patch[:, 1]))
    return half[apart].reshape(-1)


@torch.no_grad()
def right_answers(
    networks: AtlasNetworks,
    charts: Charts,
    xyz: Tensor,
    face: NDArray[np.int64],
    barycentric: NDArray[np.float64],
    tolerance: float,
) -> Tensor:
    """(n, p) share of the right answer for each patch: ∝ exp(−(uv error / tolerance)²) inside the face's chart.

    ``tolerance`` is a share of the charts' extent, √(total uv area).
    """
    reach = tolerance * float(np.sqrt(uv_area(charts)))
    truth = torch.from_numpy(np.einsum("nc,ncd->nd", barycentric, charts.corner_uv[face]).astype(np.float32))
    chart = torch.from_numpy(charts.face_chart[face])
    answers = torch.zeros(len(xyz), len(charts.patch_chart))
    for number in range(int(charts.patch_chart.max()) + 1):
        patches = torch.from_numpy(np.flatnonzero(charts.patch_chart == number))
        for rows in torch.nonzero(chart == number)[:, 0].split(4096):
            uv = networks.unwrap.among(networks.unwrap_features(xyz[rows]), patches)
            closeness = -(((uv - truth[rows]).norm(dim=-1) / reach) ** 2)
            answers[rows[:, None], patches] = torch.softmax(closeness, dim=0).T
    return answers


def fit_assign(
    networks: AtlasNetworks,
    surface: Surface,
    charts: Charts,
    config: FitConfig,
    generators: tuple[np.random.Generator, torch.Generator],
    progress: Progress,
) -> None:
    """Cross-entropy on the patch, most samples close to seams and where the surface comes close to itself.

    Where several patches of the right chart give the right uv, each is a right answer: the borders inside a chart that
    are no cuts may lie anywhere, and all of the network's precision goes to the seams.
    """
    rng, generator = generators
    uniform = sample_surface(surface, int(config.samples * (1.0 - config.seam_share)), rng)
    near_face, near = sample_seams(surface, charts, int(config.samples * config.seam_share), config.seam_reach, rng)
    thin_face, thin = sample_thin(surface, charts, config.samples, config.thin_reach, rng)
    face = np.concatenate([uniform.face, near_face, thin_face])
    barycentric = np.concatenate([uniform.barycentric, near, thin])
    xyz = torch.from_numpy(np.einsum("nc,ncd->nd", barycentric, surface.triangles[face]).astype(np.float32))
    label = right_answers(networks, charts, xyz, face, barycentric, config.tolerance)
    optimizer = OneCycleAdam(networks.assign, config.assign_steps, config.rate)
    for step in range(config.assign_steps):
        pick = torch.randint(len(xyz), (config.assign_batch,), generator=generator)
        loss = nn.functional.cross_entropy(networks.scores(xyz[pick]), label[pick])
        optimizer.step(loss)
        if step % 25 == 0:
            progress("fit charts", step, config.assign_steps, loss.item())


def fit_networks(
    surface: Surface, charts: Charts, net: NetConfig, config: FitConfig, seed: int, progress: Progress
) -> AtlasNetworks:
    """Assign- and Unwrap-Nets for finished charts of a surface in the unit ball; charts' uv in the same units."""
    rng, generator = np.random.default_rng(seed), torch.Generator().manual_seed(seed)
    patches = len(charts.patch_chart)
    networks = AtlasNetworks(patches, net, generator=generator)
    samples = sample_patches(surface, charts, max(config.samples // patches, 500), rng)
    fit_unwrap(networks, samples, config, generator, progress)
    fit_assign(networks, surface, charts, config, (rng, generator), progress)
    return networks.eval()

"""The deployed inverse in torch, and the proof that an exported one equals it.

n rows · p patches · k charts · m patches of the chart that has most.  uv: atlas, [0, 1]², v up.  plane: chart
coordinates.  xyz: unit ball.  points: source units.  This is the truth; wrap.py builds the ONNX graph another way.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
import torch
from torch import Tensor, nn

from ..runtime.errors import InputError, ParityError, ShapeError
from ..train.deploy.fit_wrap import patch_table
from .graph import fold_frame
from .parity import largest_difference, load_model, run_model

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..runtime.mesh import Atlas
    from ..runtime.sessions.bundle import BundleMetadata


class WrapNetworks(Protocol):
    """Any nn.Module of this signature can be deployed, as long as it is made of the operations lowering.py lists."""

    def wrap(self, uv: Tensor, patch: Tensor) -> tuple[Tensor, Tensor]:
        """Points xyz (n, 3) in the unit ball and normals (n, 3) of any length at uv (n, 2) in chart coordinates.

        ``patch`` is (n,) int64, or (1,) for all rows; it picks parameters of shape (p, ·, ·), or results made of them.
        """
        ...


class PatchChooser(Protocol):
    """What a WrapNetworks offers besides where a chart has several patches."""

    def patch_scores(self, uv: Tensor, chart: Tensor) -> Tensor:
        """Scores (n, m) at uv (n, 2) of charts (n,) or (1,): column i is the chart's i-th patch in ascending order."""
        ...


class FoldedPlacement(NamedTuple):
    """Atlas uv → chart coordinates, float32: plane = turn[chart] @ (uv − shift[chart]).

    turn (k, 2, 2), shift (k, 2).
    """

    turn: NDArray[np.float32]
    shift: NDArray[np.float32]


def fold_placement(metadata: BundleMetadata) -> FoldedPlacement:
    """The inverse of the placement.  Raises: InputError where it has none."""
    placement = metadata.placement_array()
    determinant = np.linalg.det(placement[:, :, :2])
    size = np.abs(placement[:, :, :2]).max(axis=(1, 2))
    if not (np.abs(determinant) > 1e-12 * size**2).all():
        flat = int((np.abs(determinant) <= 1e-12 * size**2).argmax())
        found = f"placement of chart {flat} has determinant {determinant[flat]:.3g}"
        raise InputError(f"{found}, expected one that can be inverted; pack the charts again")
    turn = np.linalg.inv(placement[:, :, :2])
    return FoldedPlacement(turn.astype(np.float32), placement[:, :, 2].astype(np.float32))


class WrapGraph(nn.Module):
    """uv (n, 2) float32 in the atlas, chart (n,) int64 → points (n, 3) float32 in source units, normals (n, 3) float32.

    xyz is clamped to [−1, 1]³, so that no uv leads out of the frame's box.  Rows of a chart that does not exist, or
    that has no patch, are NaN.
    """

    centre: Tensor
    centre_rest: Tensor
    scale: Tensor
    turn: Tensor
    shift: Tensor
    table: Tensor

    def __init__(self, model: nn.Module, metadata: BundleMetadata) -> None:
        super().__init__()
        self.model = model
        frame, placement = fold_frame(metadata), fold_placement(metadata)
        for name, array in (*frame._asdict().items(), *placement._asdict().items()):
            self.register_buffer(name, torch.from_numpy(array))
        table = patch_table(np.asarray(metadata.patch_chart, dtype=np.int64), metadata.chart_count)
        self.register_buffer("table", torch.from_numpy(table))

    def forward(self, uv: Tensor, chart: Tensor) -> tuple[Tensor, Tensor]:
        """See the class."""
        known = (chart >= 0) & (chart < len(self.table))
        inside = chart.clamp(0, len(self.table) - 1)
        plane, scores = self.plane_and_scores(uv, inside)
        patch = self.table[inside].gather(1, scores.argmax(dim=1, keepdim=True))[:, 0]
        xyz, normal = self.model.wrap(plane, patch.clamp(min=0))  # type: ignore[operator]
        points = xyz.clamp(-1.0, 1.0) * self.scale + self.centre_rest + self.centre
        lost = ~(known & (patch >= 0))[:, None]
        normals = nn.functional.normalize(normal, dim=1)
        return points.masked_fill(lost, torch.nan), normals.masked_fill(lost, torch.nan)

    def plane_and_scores(self, uv: Tensor, chart: Tensor) -> tuple[Tensor, Tensor]:
        """Chart coordinates (n, 2), and the scores (n, m) of the chart's patches: −∞ where it has fewer than m."""
        plane = (self.turn[chart] @ (uv - self.shift[chart])[:, :, None])[:, :, 0]
        missing = self.table[chart] < 0
        if self.table.shape[1] == 1:
            return plane, torch.zeros_like(plane[:, :1])
        scores: Tensor = self.model.patch_scores(plane, chart)  # type: ignore[operator]
        return plane, scores.masked_fill(missing, -torch.inf)


@dataclass(frozen=True)
class WrapParitySpec:
    """Where torch and onnxruntime are compared, and how closely they must agree."""

    sizes: tuple[int, ...] = (1, 2, 1000)
    """Numbers of rows n; 1 finds a frozen axis, 2 a squeezed one."""
    points_atol: float = 1e-4
    """Largest |Δpoints| as a share of the frame's scale, a fifth of what the networks miss the surface by at best.

    What float32 loses at the frame's centre comes on top: WrapSession does not."""
    normals_atol: float = 1e-3
    """Largest |Δnormals|."""
    tie: float = 1e-4
    """Two scores closer than this × (1 + max |score|) are a tie: either patch may win, and the row is left out."""
    seed: int = 0
    """Seed of the probes."""


@dataclass(frozen=True)
class WrapParityReport:
    """What the proof found.

    compared, ties: rows of all sizes together, and those left out.  points_error: max |Δ| as a share of the frame's
    scale.  normals_error: max |Δ|.
    """

    sizes: tuple[int, ...]
    compared: int
    ties: int
    points_error: float
    normals_error: float


def probe_uv(
    atlas: Atlas, face_patch: NDArray[np.int64], count: int, seed: int
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Atlas uv (count, 2) float32 and their charts (count,): three of four inside charts, the others a little beside.

    They visit the patches that have faces in turn, each face of a patch being as likely as the next.
    """
    rng = np.random.default_rng(seed)
    by_patch = np.argsort(face_patch, kind="stable")
    _, first, faces = np.unique(face_patch[by_patch], return_index=True, return_counts=True)
    turn = np.arange(count) % len(faces)
    face = by_patch[first[turn] + rng.integers(faces[turn])]
    uv = np.einsum("nc,ncx->nx", rng.dirichlet(np.ones(3), size=count), atlas.corner_uv[face])
    beside = rng.permutation(count) < count // 4
    uv[beside] += rng.normal(scale=0.01, size=uv.shape)[beside]
    return uv.clip(0.0, 1.0).astype(np.float32), atlas.face_chart[face]


def check_shapes(model: nn.Module, metadata: BundleMetadata) -> None:
    """The model keeps to WrapNetworks, and to PatchChooser where that is needed.

    Raises:
        ShapeError: it does not, or it has other patches than the metadata.
    """
    patches, most = metadata.patch_count, np.bincount(metadata.patch_chart).max()
    uv, last = torch.zeros((3, 2)), torch.full((3,), patches - 1)
    wanted = f"xyz (3, 3) and normals (3, 3) at 3 uv of patch {patches - 1}"
    try:
        shapes = [tuple(part.shape) for part in model.wrap(uv, last)]  # type: ignore[operator]
        if most > 1:
            wanted = f"{wanted}, and patch_scores (3, {most})"
            shapes.append(tuple(model.patch_scores(uv, torch.zeros(3, dtype=torch.int64)).shape))  # type: ignore[operator]
    except (IndexError, AttributeError, RuntimeError) as error:
        reason = str(error).splitlines()[0]
        raise ShapeError(f"the model fails ({reason}), expected {wanted}; pass the charts it was fitted to") from error
    if shapes != [(3, 3), (3, 3), (3, most)][: 2 + (most > 1)]:
        raise ShapeError(f"the model gives {shapes}, expected {wanted}; pass the charts it was fitted to")


def ties_between(scores: Tensor, tie: float) -> Tensor:
    """(n,) True where the two largest scores of (n, m) are too close to say which patch wins; −∞ never ties."""
    if scores.shape[1] == 1:
        return torch.zeros(len(scores), dtype=torch.bool)
    best, second = scores.topk(2, dim=1).values.unbind(dim=1)
    return best - second <= tie * (1.0 + best.abs())


def prove_inverse(
    graph: WrapGraph, content: bytes, probes: tuple[NDArray[np.float32], NDArray[np.int64]], spec: WrapParitySpec
) -> WrapParityReport:
    """Compare the torch graph with the ONNX model ``content`` at the first n of the probes, n in spec.sizes.

    Raises:
        ParityError: names the output, n, max |Δ| and what was allowed; or most rows are ties and prove nothing.
    """
    session, scale = load_model(content), float(graph.scale)
    rounding = 4.0 * float(np.spacing(np.float32(float(graph.centre.abs().max()) + scale)))
    compared = ties = 0
    errors = [0.0, 0.0]
    for n in spec.sizes:
        uv, chart = (part[:n] for part in probes)
        found = run_model(session, ("points", "normals"), {"uv": uv, "chart": chart})
        with torch.no_grad():
            inputs = torch.from_numpy(uv), torch.from_numpy(chart)
            truth = [part.numpy() for part in graph(*inputs)]
            clear = ~ties_between(graph.plane_and_scores(*inputs)[1], spec.tie).numpy()
        allowed = (spec.points_atol * scale + rounding, spec.normals_atol)
        for i, name in enumerate(("points", "normals")):
            errors[i] = max(errors[i], largest_difference(name, found[i], truth[i], clear, n, allowed[i]))
        compared, ties = compared + int(clear.sum()), ties + int((~clear).sum())
    if ties > compared:
        found_ties = f"{ties} of {compared + ties} probes are ties between patches"
        raise ParityError(f"{found_ties}, expected under half; fit the networks")
    return WrapParityReport(tuple(spec.sizes), compared, ties, errors[0] / scale, errors[1])

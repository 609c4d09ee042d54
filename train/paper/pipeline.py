"""Preset ``paper``, from a surface to finished charts: the paper's training, its raw figures, then valid charts.

n points · f faces · v vertices · p charts.
surface (source units) → unit ball → train_paper → raw figures → finishing → fit.
The raw figures are those of the networks' own map, as the paper measures it; the finished ones are those of the charts
that come back, in source units.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from ...runtime.geometry.metrics import measure
from ...runtime.geometry.triangles import corner_angles, edge_lengths, signed_areas, triangle_areas
from ...runtime.mesh import Charts, Frame, Surface
from ...runtime.process.progress import Stages
from ..charts.charts import chart_surface
from ..charts.starts import Known
from ..config import TrainConfig
from ..deploy.fit import fit_networks
from ..pipeline import Trained, as_charts
from ..sampling import sample_surface
from ..workers import Beside
from .batches import PaperInput
from .finishing import GlobalFinishConfig, finish_global
from .learnedseams import SeamConfig, cut_points, tears
from .training import train_paper

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ...runtime.process.progress import Progress
    from ..charts.charts import Finished
    from .checkpoint import Checkpoints
    from .config import PaperConfig
    from .networks import PaperNetworks

    Learned = Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]]


def train_paper_surface(
    surface: Surface,
    config: PaperConfig,
    progress: Progress,
    checkpoints: Checkpoints | None = None,
    deploy: TrainConfig | None = None,
    *,
    samples: PaperInput | None = None,
) -> Trained:
    """Charts and networks of a welded surface by the paper's method.

    Args:
        surface: source units.
        config: mode, charts, and every number of training.
        progress: told stage, step, steps and loss.
        checkpoints: where training is saved and goes on from; None: nowhere.
        samples: what is trained on, in the unit ball; None: the surface's vertices, their normals, and its faces.
        deploy: numbers of finishing, patches and the fit of the deployed networks; None: as preset ``fast`` has them.

    Raises:
        MeshError: fewer than 16 vertices.
        InputError: the device is absent, or the checkpoint is of another run.
        FlexparaError: training diverged.
        FinishError: no valid charts could be made (a defect).
    """
    deploy = deploy or TrainConfig()
    frame = Frame.of(surface.vertices)
    ball = Surface(frame.apply(surface.vertices), surface.faces)
    samples = samples or PaperInput(ball.vertices, vertex_normals(ball), ball.faces)
    steps, finishing = config.steps, GlobalFinishConfig(finish=deploy.finish)
    paper = train_paper(samples, config, lambda step, loss: progress("train", step, steps, loss), checkpoints)
    finished, report = finish_learned(ball, as_numpy(paper), config, Stages(progress), finishing)
    charts = as_charts(ball, finished)
    charts = replace(charts, corner_uv=charts.corner_uv * frame.scale)
    report["finished"] = finished_figures(surface, charts, finished)
    fitted = Beside(partial(fit_networks, ball, charts, deploy.fit, config.seed))
    settings = {"preset": "paper", **asdict(config), "deploy": asdict(deploy)}
    if config.mode == "global":
        settings["global_finish"] = {name: part for name, part in asdict(finishing).items() if name != "finish"}
    return Trained(charts, fitted, frame, settings, report, paper)


def finish_learned(
    ball: Surface,
    learned: Learned,
    config: PaperConfig,
    stage: Stages,
    finishing: GlobalFinishConfig,
) -> tuple[Finished, dict[str, Any]]:
    """Valid charts of a surface in the unit ball from a learned map, and the map's raw figures.

    ``learned``: (n, 3) → log probabilities (n, p) and uv (n, p, 2); p = 1 in global mode.  In multi-chart mode labels
    are the most probable charts, smoothed; connected pieces of a label are charts of their own, pieces are split and
    merged under the limit of ``config.charts``, and fewer are left where fewer suffice.
    """
    logits, uv = learned(ball.vertices)
    if config.mode == "global":
        report = {"raw": raw_global(ball, learned, config, finishing.seam)}
        found = finish_global(ball, uv[:, 0], stage, finishing)
        return found.finished, {**report, "components": found.components}
    report = {"raw": raw_charts(ball, logits, uv)}
    found = chart_surface(ball, config.charts, finishing.finish, config.seed, stage, Known(lambda xyz: learned(xyz)[0]))
    return found, report


def vertex_normals(surface: Surface) -> NDArray[np.float64]:
    """(v, 3) unit normals, the mean of the faces' by area; +z where they cancel out."""
    corner = surface.faces.reshape(-1)
    cross = np.repeat(surface.face_cross(), 3, axis=0)
    total = np.stack([np.bincount(corner, axis, minlength=len(surface.vertices)) for axis in cross.T], axis=1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > 0.0, total / np.maximum(length, np.finfo(np.float64).tiny), [0.0, 0.0, 1.0])


def as_numpy(networks: PaperNetworks, chunk: int = 16_384) -> Learned:
    """The networks as a numpy function: (n, 3) unit ball → (n, p) log probabilities and (n, p, 2) uv, float64."""

    @torch.no_grad()
    def evaluate(xyz: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        parts = [networks(rows) for rows in torch.from_numpy(xyz.astype(np.float32)).split(chunk)]
        logits, uv = (torch.cat(part).double() for part in zip(*parts, strict=True))
        return torch.log_softmax(logits, dim=-1).numpy(), uv.numpy()

    return evaluate


def raw_global(ball: Surface, learned: Learned, config: PaperConfig, seam: SeamConfig) -> dict[str, Any]:
    """Figures of the learned map itself.

    cut_points: share of surface samples on the seam as the paper extracts it.  seam_faces: share of the area whose
    faces the band tears.  all: distortions over all faces, as the paper's tables have them; off_seam: over the faces
    that don't cross the seam, with a scale of their own.
    """
    points = sample_surface(ball, seam.counted, np.random.default_rng(config.seed)).xyz
    on_seam = cut_points(points, learned(points)[1][:, 0], config.cut_neighbours, config.cut_share)
    uv = learned(ball.vertices)[1][:, 0]
    torn = tears(ball, uv, seam).face > seam.torn
    areas = ball.face_areas()
    return {
        "cut_points": float(on_seam.mean()),
        "seam_faces": float(areas[torn].sum() / areas.sum()),
        "all": distortions(ball.triangles, uv[ball.faces]),
        "off_seam": distortions(ball.triangles[~torn], uv[ball.faces[~torn]]),
    }


def raw_charts(ball: Surface, logits: NDArray[np.float64], uv: NDArray[np.float64]) -> dict[str, Any]:
    """Figures of the learned charts themselves: vertices take their most probable chart, logits (v, p), uv (v, p, 2).

    seam_faces: share of the area whose faces have corners in several charts; these count nowhere else.  all: over the
    other faces, all charts at one scale.  charts: per chart that has faces, each at its own scale.
    """
    label = logits.argmax(axis=1)[ball.faces]
    inside = (label == label[:, :1]).all(axis=1)
    faces, chart = ball.faces[inside], label[inside, 0]
    triangles, flat = ball.vertices[faces], uv[faces, chart[:, None]]
    areas = ball.face_areas()
    rows = [
        {"chart": k, "area": float(areas[inside][chart == k].sum() / areas.sum())}
        | distortions(triangles[chart == k], flat[chart == k])
        for k in np.unique(chart).tolist()
    ]
    return {
        "seam_faces": float(areas[~inside].sum() / areas.sum()),
        "all": distortions(triangles, flat),
        "charts": rows,
    }


def distortions(triangles: NDArray[np.float64], uv: NDArray[np.float64]) -> dict[str, float | int | None]:
    """The paper's metrics of triangles (f, 3, 3) and their uv (f, 3, 2) scaled to the same area; None without area.

    conformal_mean: |angle − uv angle|, radians.  equiareal_mean: |area − uv area|.  isometric_mean: |length − uv
    length|, both in unit-ball units.  flipped: share of faces against the majority's orientation.
    """
    area, signed = triangle_areas(triangles), signed_areas(uv)
    names = ("conformal_mean", "equiareal_mean", "isometric_mean", "flipped")
    if not np.abs(signed).sum() > 0.0:
        return {"faces": len(triangles), **dict.fromkeys(names)}
    scale = float(np.sqrt(area.sum() / np.abs(signed).sum()))
    flipped = min(float((signed > 0.0).mean()), float((signed < 0.0).mean()))
    values = (
        float(np.abs(corner_angles(triangles) - corner_angles(uv)).mean()),
        float(np.abs(area - scale**2 * np.abs(signed)).mean()),
        float(np.abs(edge_lengths(triangles) - scale * edge_lengths(uv)).mean()),
        flipped,
    )
    return {"faces": len(triangles), **dict(zip(names, values, strict=True))}


def finished_figures(surface: Surface, charts: Charts, finished: Finished) -> dict[str, Any]:
    """Figures of the charts that come back, as `flexpara evaluate` has them, and how they came to be."""
    found = measure(surface, side_by_side(charts), charts.face_chart).to_dict()
    names = ("conformal_mean", "equiareal_mean", "isometric_mean", "symmetric_dirichlet_mean", "seam_length", "charts")
    return {name: found[name] for name in (*names, "flipped_faces", "overlap_fraction")} | {
        "patches": len(charts.patch_chart),
        "objective": finished.objective,
        "slit_length": sum(piece.slit_length for piece in finished.pieces),
        "unwrapped_by_xatlas": [k for k, method in enumerate(charts.method) if method == "xatlas"],
    }


def side_by_side(charts: Charts) -> NDArray[np.float64]:
    """(f, 3, 2) corner uv with the charts moved apart along u: each has coordinates of its own until it is packed."""
    low = np.full(len(charts.method), np.inf)
    np.minimum.at(low, charts.face_chart, charts.corner_uv[..., 0].min(axis=1))
    high = np.full(len(charts.method), -np.inf)
    np.maximum.at(high, charts.face_chart, charts.corner_uv[..., 0].max(axis=1))
    wide = 1.01 * (high - low)
    shift = np.append(0.0, np.cumsum(wide)[:-1]) - low
    return charts.corner_uv + shift[charts.face_chart][:, None, None] * [1.0, 0.0]

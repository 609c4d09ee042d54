"""The presets: a mesh and what a user asks for → charts and networks.   Positions in source units.

"fast" is pipeline.train; "paper" trains as published (Zhao et al. 2025) and finishes what was learned.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import TYPE_CHECKING

from ..runtime.extras import requires
from ..runtime.io.asset.facevalues import face_values
from ..runtime.io.asset.wantedseams import wanted_seams
from ..runtime.mesh import Frame
from .charts.kept import kept_islands
from .charts.objective import priced
from .cloud.config import CloudConfig
from .cloud.reconstruct import reconstruct
from .config import TrainConfig
from .paper.config import Ablation, PaperConfig
from .pipeline import train, with_networks

if TYPE_CHECKING:
    from pathlib import Path

    from ..runtime.io.points.cloud import CloudMesh, PointCloud
    from ..runtime.mesh import Asset
    from ..runtime.options.unwrap import TrainOptions
    from ..runtime.process.progress import Clock
    from .pipeline import Trained

    Keep = tuple[Path, int]


def train_asset(
    asset: Asset, options: TrainOptions, clock: Clock, keep: Keep | None = None, cloud: PointCloud | None = None
) -> Trained:
    """Charts and networks by the preset asked for.

    Args:
        asset: what is charted.
        options: preset and what it needs.
        clock: told the stages.
        keep: where and how often preset paper keeps checkpoints.
        cloud: the points that the asset's triangles were laid over: preset paper is then trained on points alone.

    Raises: InputError for checkpoints of another run; FinishError (a defect).
    """
    if options.keep_islands:
        config = fast_config(options)
        important = None if options.importance is None else face_values(asset, options.importance)
        with clock.stage("relax"):
            finished = kept_islands(asset, config.finish)
        return with_networks(asset.surface, finished, config, important)
    if options.preset != "paper":
        wanted = wanted_seams(asset, options, options.crease_angle)
        polygon = None if asset.polygons is None else asset.polygons.of_faces
        surface = replace(asset.surface, polygon=polygon)
        return train(surface, fast_config(options), clock, clock.deadline, wanted)
    with requires("train"):
        from .paper.batches import PaperInput
        from .paper.checkpoint import Checkpoints
        from .paper.pipeline import train_paper_surface

    samples = None
    if cloud is not None:
        ball = Frame.of(asset.surface.vertices).apply(asset.surface.vertices)
        samples = PaperInput(ball, None if cloud.normals is None else asset.normals)
    checkpoints = None if keep is None else Checkpoints(*keep)
    return train_paper_surface(asset.surface, paper_config(options), clock, checkpoints, samples=samples)


def train_cloud(
    cloud: PointCloud, options: TrainOptions, clock: Clock, keep: Keep | None = None
) -> tuple[CloudMesh, Trained]:
    """Triangles laid over the points of a cloud, and their charts and networks; the settings hold both's numbers.

    Raises: as train_asset; MeshError where the points show no surface.
    """
    config = CloudConfig()
    with clock.stage("triangulate"):
        mesh = reconstruct(cloud, config)
    trained = train_asset(mesh.asset, options, clock, keep, cloud)
    return mesh, replace(trained, settings={**trained.settings, "cloud": asdict(config)})


def fast_config(options: TrainOptions) -> TrainConfig:
    """The settings of preset fast that these options ask for."""
    plain = TrainConfig(charts=options.most_charts, seed=options.seed)
    stretch = 0.0 if options.max_stretch is None else options.max_stretch - 1.0
    finish = replace(plain.finish, slit=replace(plain.finish.slit, price=options.seam_price), stretch=stretch)
    finish = replace(finish, page=replace(finish.page, price=options.page_price))
    finish = replace(finish, energy=replace(finish.energy, kind=options.energy))
    finish = replace(finish, symmetry=replace(finish.symmetry, axis=options.symmetry))
    if options.seams == "crease":
        finish = priced(finish, replace(finish.slit.seams, counted=True))
    places = replace(plain.places, hidden=options.seams == "hidden")
    return replace(plain, finish=finish, places=places, importance=options.importance_density)


def paper_config(options: TrainOptions) -> PaperConfig:
    """The settings of preset paper that these options ask for."""
    plain = PaperConfig()
    names = options.ablation
    return replace(
        plain,
        mode=options.mode,
        charts=options.most_charts,
        seed=options.seed,
        steps=options.steps or plain.steps,
        points=options.points or plain.points,
        dtype=options.precision,
        nets=replace(plain.nets, hidden=options.width or plain.nets.hidden),
        ablation=Ablation(
            triangle="no-triangle" not in names,
            differential="no-differential" not in names,
            upper="no-upper" not in names,
            lower="no-lower" not in names,
            chart_bidirectional="bidirectional" in names,
            chart_differential="chart-differential" in names,
        ),
    )

"""From a surface to finished charts and the networks that answer for them.

surface (source units) → unit ball → charts → fit.  Charts come back in source units.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..runtime.geometry.places import priced_places
from ..runtime.geometry.topology import edge_table, split_non_manifold_vertices
from ..runtime.io.asset.wantedseams import NO_WISH
from ..runtime.mesh import Charts, Frame, Surface
from ..runtime.process.progress import Stages
from .charts.charts import Finished, chart_surface
from .charts.objective import priced
from .charts.starts import Known
from .deploy.fit import fit_networks
from .workers import Beside

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from torch import nn

    from ..runtime.geometry.places import PlaceConfig
    from ..runtime.io.asset.wantedseams import WantedSeams
    from ..runtime.process.deadline import Deadline
    from ..runtime.process.progress import Progress
    from .config import FinishConfig, TrainConfig
    from .deploy.gated import GatedExperts


@dataclass(frozen=True, eq=False)
class Trained:
    """Result of training.

    charts: valid, in source units.  fitted: the networks, which may still be on their way.
    frame: source units → unit ball.  settings: of the run; report: facts; both ready for JSON.  The sentences under
    "notes" of the report are shown to the user.
    paper: the networks of preset paper as they were trained: unit ball → logits (n, p), raw uv (n, p, 2); else None.
    """

    charts: Charts
    fitted: Beside[GatedExperts]
    frame: Frame
    settings: dict[str, Any]
    report: dict[str, Any]
    paper: nn.Module | None = None

    @property
    def networks(self) -> GatedExperts:
        """Unit ball (n, 3) → chart uv (n, 2) in source units, chart, score; waits until they are fitted."""
        return self.fitted.result()


def train(
    surface: Surface,
    config: TrainConfig,
    progress: Progress,
    deadline: Deadline | None = None,
    wanted: WantedSeams = NO_WISH,
) -> Trained:
    """Charts and networks of a welded surface.

    Args:
        surface: in source units.
        config: numbers.
        progress: told the stages.
        deadline: when the search ends with the best it has; None: it ends by itself, the same every time.
        wanted: edges that become seams, the surface is cut open there before it is charted; faces that seams keep
            away from, and that want texels; and uv of an atlas to improve.

    Raises:
        FinishError: no valid charts could be made (a defect).
    """
    frame = Frame.of(surface.vertices)
    calm = None if surface.calm is None else frame.apply(surface.calm)
    ball = replace(surface, vertices=frame.apply(surface.vertices), calm=calm)
    opened = ball if wanted.cut is None else cut_along(ball, wanted.cut)
    finish = at_places(config.finish, ball, config.places, wanted.protected)
    known = Known(corner_uv=wanted.start)
    finished = chart_surface(opened, config.charts, finish, config.seed, Stages(progress, deadline), known)
    return with_networks(surface, finished, config, wanted.important)


def with_networks(
    surface: Surface, finished: Finished, config: TrainConfig, important: NDArray[np.float64] | None = None
) -> Trained:
    """Charts of a surface (source units) that were finished in its unit ball, and the networks that answer for them.

    These are fitted beside whatever comes next, which may be packing.  important: (f,) how much a face asks for more
    texels, 0 to 1.
    """
    frame = Frame.of(surface.vertices)
    ball = Surface(frame.apply(surface.vertices), surface.faces)
    charts = as_charts(ball, finished)
    density = densities(ball, charts, important, config.importance)
    # the unit ball's charts, at the scale of the source: uv in source units, more where texels are asked for
    charts = replace(charts, corner_uv=charts.corner_uv * (frame.scale * density[charts.face_chart, None, None]))
    fitted = Beside(partial(fit_networks, ball, charts, config.fit, config.seed))
    report = {
        "objective": finished.objective,
        "parts": finished.parts,
        "notes": list(finished.notes),
        **({} if important is None else {"density": density.tolist()}),
        **({} if finished.start is None else {"start": finished.start._asdict()}),
        "slit_length": sum(piece.slit_length for piece in finished.pieces),
        "unwrapped_by_xatlas": [k for k, method in enumerate(charts.method) if method == "xatlas"],
    }
    return Trained(charts, fitted, frame, {"preset": "fast", **asdict(config)}, report)


def densities(
    surface: Surface, charts: Charts, important: NDArray[np.float64] | None, most: float
) -> NDArray[np.float64]:
    """(k,) texels per length of each chart, beside those of one without importance; most: of one of importance 1."""
    count = len(charts.method)
    if important is None:
        return np.ones(count)
    area = surface.face_areas()
    total = np.maximum(np.bincount(charts.face_chart, area, minlength=count), np.finfo(np.float64).tiny)
    mean = np.bincount(charts.face_chart, area * important, minlength=count) / total
    return 1.0 + (most - 1.0) * mean


def at_places(
    finish: FinishConfig, surface: Surface, config: PlaceConfig, protected: NDArray[np.float64] | None
) -> FinishConfig:
    """The same with prices of seams by place, where hidden ones are asked for or faces (f,) protected."""
    if not config.hidden and protected is None:
        return finish
    return priced(finish, replace(finish.slit.seams, places=priced_places(surface, config, protected)))


def cut_along(surface: Surface, wanted: NDArray[np.bool_]) -> Surface:
    """The surface, its faces in their order, open along edges (e,) of its table."""
    faces, old = split_non_manifold_vertices(surface.faces, wanted, edge_table(surface.faces))
    calm = None if surface.calm is None else surface.calm[old]
    return replace(surface, vertices=surface.vertices[old], faces=faces, calm=calm)


def as_charts(surface: Surface, finished: Finished) -> Charts:
    """Finished pieces as Charts; each chart is one patch."""
    face_chart = np.zeros(len(surface.faces), dtype=np.int64)
    corner_uv = np.zeros((len(surface.faces), 3, 2))
    for chart, piece in enumerate(finished.pieces):
        face_chart[piece.ids] = chart
        corner_uv[piece.ids] = piece.flat.uv[piece.flat.surface.faces]
    methods = tuple(piece.method for piece in finished.pieces)
    return Charts(face_chart, corner_uv, face_chart, np.arange(len(methods)), methods)

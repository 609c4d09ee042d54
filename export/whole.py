"""A whole unwrap: charts first, then all that follows, whose modules are loaded while charts are found."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..runtime.pack.room import demand_room_for_parts
from ..runtime.pack.square import square_of
from ..runtime.process.meanwhile import load_meanwhile
from ..train.presets import train_asset, train_cloud

if TYPE_CHECKING:
    from ..runtime.io.points.cloud import CloudMesh, PointCloud
    from ..runtime.mesh import Asset
    from ..runtime.options.unwrap import Options
    from ..runtime.process.progress import Clock
    from ..train.presets import Keep
    from .assemble import Unwrapped

ROOT = __name__.removesuffix(".export.whole")
PACKAGES = ("scipy.optimize", "onnx", "onnxruntime")
MODULES = ("runtime.pack.asked", "runtime.geometry.metrics", "runtime.sessions.agreement", "export.assemble")
"""What follows the charts: modules of other people, and of ours."""


def load_what_follows() -> None:
    """Have what follows the charts loaded while they are found.  Raises: MissingDependencyError for an absent one."""
    load_meanwhile(PACKAGES, [f"{ROOT}.{name}" for name in MODULES])


def unwrapped(asset: Asset, options: Options, clock: Clock, keep: Keep | None = None) -> Unwrapped:
    """Train, finish, pack, measure, export.  Raises: NoRoomError at once, where parts don't fit; as `assemble`."""
    demand_room_for_parts(asset.surface, options)
    load_what_follows()
    trained = train_asset(asset, options, clock, keep)
    from .assemble import assemble

    return assemble(asset, trained, clock, square_of(options))


def unwrapped_cloud(
    cloud: PointCloud, options: Options, clock: Clock, keep: Keep | None = None
) -> tuple[CloudMesh, Unwrapped]:
    """Triangles laid over the points, and the same of these.  Raises: as `train_cloud` and `assemble`."""
    load_what_follows()
    mesh, trained = train_cloud(cloud, options, clock, keep)
    from .assemble import assemble

    return mesh, assemble(mesh.asset, trained, clock, square_of(options))

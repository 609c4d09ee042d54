"""Whatever a user hands over: a mesh, or points without faces."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from .meshfile import load
from .points.cloud import PointCloud
from .points.cloudfile import is_cloud, load_cloud

if TYPE_CHECKING:
    from ..mesh import Asset
    from .meshfile import MeshLike


def load_any(source: MeshLike | PointCloud, select: tuple[str, ...] = ()) -> Asset | PointCloud:
    """A mesh as an Asset, a file without faces as a PointCloud.  select: as for `load`.

    Raises: InputError when it is neither.
    """
    if isinstance(source, PointCloud):
        return source
    if isinstance(source, str | Path) and is_cloud(Path(source)):
        return load_cloud(Path(source))
    return load(source, select)

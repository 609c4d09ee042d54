"""Maps on an atlas: OpenGL, or numpy where there is none; rays through Embree; image files through OpenImageIO."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .baker import bake

__all__ = ["bake"]


def __getattr__(name: str) -> object:
    """Load `bake` the first time it is asked for."""
    if name == "bake":
        from .baker import bake

        return bake
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

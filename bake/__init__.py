"""Baking: maps of an atlas by OpenGL, or numpy where there is none, rays through Embree; the files that hold them.

Public face: `bake` (baker.py) makes textures in memory, `results.output.write_outputs` writes all that a run leaves.
raster/ finds the surface under each texel, maps/ make values of it, highpoly/ take them from another mesh, seams/ close
seams, files/ write one file each, pictures/ draw the preview, results/ write all of it.  Imports run in this order:
colors, texture, bakemap, settings → raster → seams, maps → highpoly, files → pictures, windows → baker → checks,
config → results → commands.
"""

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

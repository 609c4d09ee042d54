"""What a PLY file holds beyond what is read of it, counted: properties of anyone's making, and the shapes of splats."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .header import FACES

if TYPE_CHECKING:
    from .header import PlyHeader

COLORS = ("red", "green", "blue", "alpha")
UV = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
"""Names that uv have, by program."""
CORNERS = ("vertex_indices", "vertex_index")
USED = {*("x", "y", "z", "nx", "ny", "nz"), *sum(UV, ())}
USED |= {f"{prefix}{name}" for prefix in ("", "diffuse_") for name in COLORS}
"""Properties of vertices that a mesh is made of."""
READ = USED | {*("f_dc_0", "f_dc_1", "f_dc_2", "opacity"), *CORNERS, *("texcoord", "texnumber")}
"""Properties of vertices and faces that are taken."""
SPLATS = ("scale_", "rot_", "f_rest_")
"""How names of a Gaussian splat's extent and turn begin, and of how its colour changes with the view."""


def left_out(header: PlyHeader) -> dict[str, int]:
    """Changes that reading makes, name → count."""
    tables = [element for element in header.elements if element.name in ("vertex", *FACES) and element.count]
    unread = [name for element in tables for name in element.names if name not in READ]
    splats = [name for name in unread if name.startswith(SPLATS)]
    found = {
        "skipped_splat_shapes": header.count("vertex") if splats else 0,
        "skipped_properties": len(unread) - len(splats),
        "skipped_elements": sum(element.count > 0 for element in header.elements) - len(tables),
    }
    return {name: count for name, count in found.items() if count}

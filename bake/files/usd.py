"""A .usda file: meshes with primvar st in the tree of the scene's nodes, and materials that read the baked textures.

n atlas vertices · f faces.  Written as text, so that no USD library is needed.  st is uv as it stands: USD's origin is
the lower left corner, v up.  Positions are float32; the unit of the source is taken for a metre.
"""

from __future__ import annotations

from textwrap import indent
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.io.pictures.colors import source_colors
from ...runtime.material import used_materials
from ..colors.color import linear_from_srgb
from ..maps.material import emissive_strength
from .usdmaterial import Shown, distinct, material_text, prim_name
from .usdshapes import shapes_of
from .usdtree import MATERIALS, Prim, plain_tree, scene_tree

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from ...runtime.mesh import Asset, Atlas
    from .usdshapes import Shape

INSET = "    "
BY_VERTEX = '(\n            interpolation = "vertex"\n        )'


def write_usda(
    atlas: Atlas, asset: Asset, textures: Mapping[str, str], path: Path, *, alpha: bool = False
) -> list[Shape]:
    """Write the meshes and materials that name texture files beside the file.

    Args:
        atlas: what is written.
        asset: source of names, of the tree of nodes, of colours, and of the factors that no texture holds.
        textures: product of `targets.USD` → file name in the same folder; products without a slot are left out.
        path: ends in .usda.
        alpha: whether the base colour has four channels, which are read as opacity.

    Returns: what each Mesh has, in the order of the file.
    """
    text, shapes = usda_text(atlas, asset, textures, alpha=alpha)
    path.write_text(text, encoding="utf-8")
    return shapes


def usda_text(
    atlas: Atlas, asset: Asset, textures: Mapping[str, str], *, alpha: bool = False
) -> tuple[str, list[Shape]]:
    """The text of the file, and what each of its meshes has; same arguments, same text.  Arguments as `write_usda`."""
    root, shapes = prim_name(asset.stem), shapes_of(atlas, asset)
    used = dict(zip(_numbers(asset), used_materials(asset) or [None], strict=True))
    names = distinct("material" if entry is None else entry.name for entry in used.values())
    paths = {number: f"/{root}/{MATERIALS}/{name}" for number, name in zip(used, names, strict=True)}
    prims = [Prim(shape, list(_mesh_lines(atlas, asset, shape, paths))) for shape in shapes]
    document = asset.document
    tree = plain_tree(root, prims) if document is None else scene_tree(root, prims, document)
    shown = Shown(textures, alpha=alpha, strength=emissive_strength(asset) if "emissive" in textures else 1.0)
    materials = [indent(material_text(paths[number], entry, shown), INSET) for number, entry in used.items()]
    ends = "\n\n".join(materials)
    body = "\n".join(tree.lines)
    text = f"""#usda 1.0
(
    defaultPrim = "{root}"
    doc = "flexpara"
    metersPerUnit = 1
    upAxis = "Y"
)

def Xform "{root}" (
    kind = "component"
)
{{
{body}

    def Scope "{MATERIALS}"
    {{
{ends}
    }}
}}
"""
    return text, tree.written


def _numbers(asset: Asset) -> list[int]:
    """Which of the asset's materials its faces have; 0 where they don't say."""
    if not asset.materials or asset.face_material is None:
        return [0]
    return np.unique(asset.face_material).tolist()


def _mesh_lines(atlas: Atlas, asset: Asset, shape: Shape, paths: Mapping[int, str]) -> Iterator[str]:
    """Attributes of a mesh, and its subsets where it has several materials."""
    positions = shape.positions(atlas)
    yield f"float3[] extent = [{_tuples(np.stack([positions.min(axis=0), positions.max(axis=0)]))}]"
    yield f"int[] faceVertexCounts = [{', '.join(map(str, shape.size.tolist()))}]"
    yield f"int[] faceVertexIndices = [{', '.join(map(str, shape.corner.tolist()))}]"
    yield f"point3f[] points = [{_tuples(positions)}]"
    yield f"normal3f[] normals = [{_tuples(shape.normals(atlas))}] {BY_VERTEX}"
    yield f"texCoord2f[] primvars:st = [{_tuples(atlas.uv[shape.used])}] {BY_VERTEX}"
    if asset.colors is not None:
        colors = source_colors(atlas, asset.colors)[shape.used] / 255.0
        yield f"color3f[] primvars:displayColor = [{_tuples(linear_from_srgb(colors[:, :3]))}] {BY_VERTEX}"
        if colors[:, 3].min() < 1.0:
            opacity = ", ".join(f"{value:.9g}" for value in colors[:, 3].tolist())
            yield f"float[] primvars:displayOpacity = [{opacity}] {BY_VERTEX}"
    yield 'uniform token subdivisionScheme = "none"'
    materials = np.unique(shape.material).tolist()
    if len(materials) == 1:
        yield f"rel material:binding = <{paths[materials[0]]}>"
        return
    yield 'uniform token subsetFamily:materialBind:familyType = "partition"'
    names = distinct(paths[number].rpartition("/")[2] for number in materials)
    for number, name in zip(materials, names, strict=True):
        rows = ", ".join(map(str, np.flatnonzero(shape.material == number).tolist()))
        yield f'def GeomSubset "{name}" ('
        yield '    prepend apiSchemas = ["MaterialBindingAPI"]'
        yield ")"
        yield "{"
        yield '    uniform token elementType = "face"'
        yield '    uniform token familyName = "materialBind"'
        yield f"    int[] indices = [{rows}]"
        yield f"    rel material:binding = <{paths[number]}>"
        yield "}"


def _tuples(rows: NDArray[np.floating]) -> str:
    """(m, c) numbers as "(a, b), (c, d)", with the digits that float32 has."""
    pattern = "(" + ", ".join(["%.9g"] * rows.shape[1]) + ")"
    return ", ".join([pattern] * len(rows)) % tuple(rows.astype(np.float32).reshape(-1).tolist())

"""A .usda file: the atlas as one UsdGeomMesh with primvar st and a UsdPreviewSurface that reads the baked textures.

n atlas vertices · f faces.  Written as text, so that no USD library is needed.  st is uv as it stands: USD's origin is
the lower left corner, v up.  Colours are read as sRGB, everything else raw; 8-bit normals are scaled by 2 and moved by
−1, as the specification of UsdPreviewSurface asks.  Positions are float32; the unit of the source is taken for a metre.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.io.loops import Loops, loops_of
from ...runtime.material import Material, used_materials
from ..maps.material import emissive_strength

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from ...runtime.mesh import Asset, Atlas

COLOR, DATA = "sRGB", "raw"
INPUTS: dict[str, tuple[tuple[str, str, str, str], ...]] = {
    "base-color": (("diffuseColor", "color3f", "rgb", COLOR),),
    "emissive": (("emissiveColor", "color3f", "rgb", COLOR),),
    "normal": (("normal", "normal3f", "rgb", DATA),),
    "occlusionRoughnessMetallic": (
        ("occlusion", "float", "r", DATA),
        ("roughness", "float", "g", DATA),
        ("metallic", "float", "b", DATA),
    ),
}
"""Product of the target usd → inputs of UsdPreviewSurface: name, type, channels, colour space."""


def write_usda(atlas: Atlas, asset: Asset, textures: Mapping[str, str], path: Path, *, alpha: bool = False) -> None:
    """Write the mesh and a material that names texture files beside it.

    Args:
        atlas: what is written.
        asset: source of the name and of the factors that no texture holds.
        textures: product of `targets.USD` → file name in the same folder; products without a slot are left out.
        path: ends in .usda.
        alpha: whether the base colour has four channels, which are read as opacity.
    """
    path.write_text(usda_text(atlas, asset, textures, alpha=alpha), encoding="utf-8")


def usda_text(atlas: Atlas, asset: Asset, textures: Mapping[str, str], *, alpha: bool = False) -> str:
    """The text of the file; same arguments, same text.  Arguments as `write_usda`."""
    root = prim_name(asset.stem)
    return f"""#usda 1.0
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
    def Mesh "mesh" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {{
{_mesh_lines(atlas, loops_of(atlas, asset))}
        rel material:binding = </{root}/material>
        uniform token subdivisionScheme = "none"
    }}

{_material_text(root, asset, textures, alpha=alpha)}
}}
"""


def prim_name(text: str) -> str:
    """An identifier that USD accepts: ASCII letters, digits and _, no digit first."""
    plain = re.sub(r"[^A-Za-z0-9_]", "_", text) or "mesh"
    return f"_{plain}" if plain[0].isdigit() else plain


def _mesh_lines(atlas: Atlas, loops: Loops) -> str:
    """Attributes of the mesh."""
    low, high = atlas.positions.min(axis=0), atlas.positions.max(axis=0)
    counts = ", ".join(map(str, loops.size.tolist()))
    lines = [
        f"float3[] extent = [{_tuples(np.stack([low, high]))}]",
        f"int[] faceVertexCounts = [{counts}]",
        f"int[] faceVertexIndices = [{', '.join(map(str, loops.vertex.tolist()))}]",
        f"point3f[] points = [{_tuples(atlas.positions)}]",
        f'normal3f[] normals = [{_tuples(atlas.normals)}] (\n            interpolation = "vertex"\n        )',
        f'texCoord2f[] primvars:st = [{_tuples(atlas.uv)}] (\n            interpolation = "vertex"\n        )',
    ]
    return "\n".join(f"        {line}" for line in lines)


def _tuples(rows: NDArray[np.floating]) -> str:
    """(m, c) numbers as "(a, b), (c, d)", with the digits that float32 has."""
    pattern = "(" + ", ".join(["%.9g"] * rows.shape[1]) + ")"
    return ", ".join([pattern] * len(rows)) % tuple(rows.astype(np.float32).reshape(-1).tolist())


def _material_text(root: str, asset: Asset, textures: Mapping[str, str], *, alpha: bool) -> str:
    """The material: a preview surface, a reader of st, and one texture reader a file."""
    base = f"/{root}/material"
    inputs, readers = _connected(base, asset, textures, alpha=alpha)
    surface = "\n".join(f"            {line}" for line in inputs.values())
    return f"""    def Material "material"
    {{
        token outputs:surface.connect = <{base}/surface.outputs:surface>

        def Shader "surface"
        {{
            uniform token info:id = "UsdPreviewSurface"
{surface}
            token outputs:surface
        }}

        def Shader "st"
        {{
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }}
{"".join(readers)}    }}"""


def _connected(
    base: str, asset: Asset, textures: Mapping[str, str], *, alpha: bool
) -> tuple[dict[str, str], list[str]]:
    """Input → line of the surface, by factors or connected to a texture; and the texture readers."""
    known = {product: name for product, name in textures.items() if product in INPUTS}
    inputs, readers = _factors(asset, set(known)), []
    for product, name in known.items():
        reader = prim_name(product)
        outputs = {channels: kind for _, kind, channels, _ in INPUTS[product]}
        for slot, kind, channels, _ in INPUTS[product]:
            inputs[slot] = f"{kind} inputs:{slot}.connect = <{base}/{reader}.outputs:{channels}>"
        if product == "base-color" and alpha:
            outputs["a"] = "float"
            inputs["opacity"] = f"float inputs:opacity.connect = <{base}/{reader}.outputs:a>"
            inputs.update(_cutoff(asset))
        scale = emissive_strength(asset) if product == "emissive" else 1.0
        readers.append(_reader_text(base, reader, name, product, outputs, scale))
    return inputs, readers


def _factors(asset: Asset, products: set[str]) -> dict[str, str]:
    """Input → line, for what no texture holds."""
    used = used_materials(asset)
    finishes = {entry.finish for entry in used}
    metallic, roughness = finishes.pop() if len(finishes) == 1 else Material().finish
    lines: dict[str, str] = {}
    if "occlusionRoughnessMetallic" not in products:
        lines["metallic"] = f"float inputs:metallic = {metallic:.9g}"
        lines["roughness"] = f"float inputs:roughness = {roughness:.9g}"
    glows = {entry.emissive for entry in used}
    if len(glows) == 1 and "emissive" not in products:
        lines["emissiveColor"] = "color3f inputs:emissiveColor = ({:.9g}, {:.9g}, {:.9g})".format(*glows.pop())
    if len(used) == 1 and "base-color" not in products:
        red, green, blue, opacity = used[0].base_color_factor
        lines["diffuseColor"] = f"color3f inputs:diffuseColor = ({red:.9g}, {green:.9g}, {blue:.9g})"
        if opacity < 1.0:
            lines["opacity"] = f"float inputs:opacity = {opacity:.9g}"
    return lines


def _cutoff(asset: Asset) -> dict[str, str]:
    """The threshold of opacity where every material is cut: the map is scaled so that it lies at ½."""
    modes = {entry.alpha_mode for entry in used_materials(asset)}
    masked = "MASK" in modes and "BLEND" not in modes
    return {"opacityThreshold": "float inputs:opacityThreshold = 0.5"} if masked else {}


def _reader_text(base: str, reader: str, name: str, product: str, outputs: Mapping[str, str], scale: float) -> str:
    """One UsdUVTexture; scale multiplies its colours."""
    quote = "@@@" if "@" in name else "@"
    lines = [
        'uniform token info:id = "UsdUVTexture"',
        f"asset inputs:file = {quote}{name}{quote}",
        f'token inputs:sourceColorSpace = "{INPUTS[product][0][3]}"',
        f"float2 inputs:st.connect = <{base}/st.outputs:result>",
        'token inputs:wrapS = "clamp"',
        'token inputs:wrapT = "clamp"',
    ]
    if product == "normal":
        lines += ["float4 inputs:scale = (2, 2, 2, 1)", "float4 inputs:bias = (-1, -1, -1, 0)"]
    elif scale != 1.0:
        lines.append(f"float4 inputs:scale = ({scale:.9g}, {scale:.9g}, {scale:.9g}, 1)")
    types = {"rgb": "float3", "r": "float", "g": "float", "b": "float", "a": "float"}
    lines += [f"{types[channels]} outputs:{channels}" for channels in outputs]
    body = "\n".join(f"            {line}" for line in lines)
    return f'\n        def Shader "{reader}"\n        {{\n{body}\n        }}\n'

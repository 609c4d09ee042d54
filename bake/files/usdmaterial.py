"""Materials of a .usda file: each a UsdPreviewSurface of its own factors, all over the same baked textures.

st is uv as it stands.  Colours are read as sRGB, everything else raw; 8-bit normals are scaled by 2 and moved by −1, as
the specification of UsdPreviewSurface asks.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...runtime.material import Material

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

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
TYPES = {"rgb": "float3", "r": "float", "g": "float", "b": "float", "a": "float"}


@dataclass(frozen=True)
class Shown:
    """What the materials show.

    files: product of `targets.USD` → file name in the same folder; those without a slot are left out.
    alpha: whether the base colour has four channels, which are read as opacity.
    strength: what the emissive map is to be multiplied by.
    """

    files: Mapping[str, str]
    alpha: bool = False
    strength: float = 1.0


def prim_name(text: str) -> str:
    """An identifier that USD accepts: ASCII letters, digits and _, no digit first."""
    plain = re.sub(r"[^A-Za-z0-9_]", "_", text) or "mesh"
    return f"_{plain}" if plain[0].isdigit() else plain


def distinct(names: Iterable[str]) -> list[str]:
    """Identifiers that USD accepts, no two alike: a number comes behind those that would be.

    >>> distinct(["a b", "a_b", "9"])
    ['a_b', 'a_b_1', '_9']
    """
    found = dict[str, None]()
    for plain in map(prim_name, names):
        numbered = (f"{plain}_{number}" for number in range(1, len(found) + 2))
        found[plain if plain not in found else next(name for name in numbered if name not in found)] = None
    return list(found)


def called(name: str, identifier: str) -> list[str]:
    """The metadatum that keeps a name which is no identifier."""
    return [] if name == identifier else [f"displayName = {json.dumps(name, ensure_ascii=False)}"]


def material_text(base: str, source: Material | None, shown: Shown) -> str:
    """The material at the path base: a preview surface, a reader of st, and one texture reader a file.

    source: whose factors stand where no texture does; None for a mesh without materials.
    """
    inputs, readers = _connected(base, source, shown)
    surface = "\n".join(f"            {line}" for line in inputs.values())
    name = base.rpartition("/")[2]
    named = "".join(f" (\n        {line}\n    )" for line in called(source.name, name)) if source is not None else ""
    return f"""    def Material "{name}"{named}
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


def _connected(base: str, source: Material | None, shown: Shown) -> tuple[dict[str, str], list[str]]:
    """Input → line of the surface, by factors or connected to a texture; and the texture readers."""
    known = {product: name for product, name in shown.files.items() if product in INPUTS}
    inputs, readers = _factors(source, set(known)), []
    for product, name in known.items():
        reader = prim_name(product)
        outputs = {channels: kind for _, kind, channels, _ in INPUTS[product]}
        for slot, kind, channels, _ in INPUTS[product]:
            inputs[slot] = f"{kind} inputs:{slot}.connect = <{base}/{reader}.outputs:{channels}>"
        if product == "base-color" and shown.alpha and (source is None or source.alpha_mode != "OPAQUE"):
            outputs["a"] = "float"
            inputs["opacity"] = f"float inputs:opacity.connect = <{base}/{reader}.outputs:a>"
            if source is not None and source.alpha_mode == "MASK":  # the map is scaled so that the cut lies at ½
                inputs["opacityThreshold"] = "float inputs:opacityThreshold = 0.5"
        scale = shown.strength if product == "emissive" else 1.0
        readers.append(_reader_text(base, reader, name, product, outputs, scale))
    return inputs, readers


def _factors(source: Material | None, products: set[str]) -> dict[str, str]:
    """Input → line, for what no texture holds."""
    lines: dict[str, str] = {}
    if "occlusionRoughnessMetallic" not in products:
        metallic, roughness = (Material() if source is None else source).finish
        lines["metallic"] = f"float inputs:metallic = {metallic:.9g}"
        lines["roughness"] = f"float inputs:roughness = {roughness:.9g}"
    if source is not None and "emissive" not in products:
        lines["emissiveColor"] = "color3f inputs:emissiveColor = ({:.9g}, {:.9g}, {:.9g})".format(*source.emissive)
    if source is not None and "base-color" not in products:
        red, green, blue, opacity = source.base_color_factor
        lines["diffuseColor"] = f"color3f inputs:diffuseColor = ({red:.9g}, {green:.9g}, {blue:.9g})"
        if opacity < 1.0:
            lines["opacity"] = f"float inputs:opacity = {opacity:.9g}"
    return lines


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
    lines += [f"{TYPES[channels]} outputs:{channels}" for channels in outputs]
    body = "\n".join(f"            {line}" for line in lines)
    return f'\n        def Shader "{reader}"\n        {{\n{body}\n        }}\n'

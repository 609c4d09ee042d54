"""Each map of one mesh on one atlas, and what options do to it; numbers are stretched over their range."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

import flexpara
from benchmarks.pictures.sheets import keep
from flexpara.bake.colors.color import srgb_bytes_from_linear
from flexpara.bake.maps.catalogue import all_maps
from flexpara.bake.maps.rays import RaySettings

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from flexpara.bake.texture import Texture

SIZE = 512
PANEL = 300
MAPS = (
    "normal",
    "normal-object",
    "position",
    "chart",
    "uv-checker",
    "ao",
    "bent-normal",
    "thickness",
    "curvature",
    "distortion",
)
SIGNED = ("normal", "normal-object", "bent-normal", "bent-normal-object")
STRIPES = 50.0
BACKGROUND = "#204060"
FEW = RaySettings(count=2)
"""So few that noise is seen."""


@dataclass(frozen=True)
class Shown:
    """A picture.  crop: the part of the texture's side that is shown, from the middle, texels as squares where < 1."""

    name: str
    wanted: Any
    settings: dict[str, Any] = field(default_factory=dict)
    crop: float = 1.0


def shown_maps() -> list[Shown]:
    """All of them."""
    few = all_maps("opengl", FEW)["ao"]
    found = [Shown(name, name) for name in MAPS]
    found += [Shown("normal-format", "normal", {"normal_format": "directx"}), Shown("rays", few)]
    found += [Shown("denoise", few, {"denoise": True})]
    found += [Shown(f"size-{size}", "uv-checker", {"size": size}, 0.999) for size in (64, 256)]
    return found + [Shown(f"samples-{count}", stripes, {"samples": count, "size": 128}, 0.4) for count in (1, 16)]


def stripes(positions: NDArray[np.float32], normals: NDArray[np.float32], faces: NDArray[np.int64]) -> NDArray[Any]:
    """A map with edges everywhere: slanted stripes through the surface."""
    del normals, faces
    return np.where(np.sin(STRIPES * positions @ np.array([0.3, 1.0, 0.2])) > 0.0, 0.1, 0.9).astype(np.float32)


def maps(models: Path) -> None:
    """Spot's."""
    result = flexpara.unwrap(models / "spot.obj", size=SIZE)
    for shown in shown_maps():
        settings = {"size": SIZE, **shown.settings}
        source: tuple[Any, ...] = (result.asset, [shown.wanted])
        if shown.wanted is stripes:
            source = ({"stripes": stripes},)
        texture, *_ = flexpara.bake.bake(result.atlas, *source, **settings).values()
        signed = shown.wanted in SIGNED
        image = Image.fromarray(seen(texture, signed=signed))
        side = image.width * shown.crop
        low, high = (image.width - side) / 2.0, (image.width + side) / 2.0
        way = Image.Resampling.NEAREST if shown.crop < 1.0 else Image.Resampling.LANCZOS
        keep(f"map-{shown.name}", image.resize((PANEL, PANEL), way, box=(low, low, high, high)))
    with tempfile.TemporaryDirectory() as folder:
        written = result.save(folder, maps=("chart",), background=BACKGROUND)
        image = Image.open(next(path for path in written if path.name.endswith("_chart.png"))).convert("RGB")
    keep("map-background", image.resize((PANEL, PANEL), Image.Resampling.LANCZOS))


def seen(texture: Texture, *, signed: bool) -> NDArray[np.uint8]:
    """(h, w, 3) as one sees it; signed: numbers from −1 to 1."""
    pixels = np.atleast_3d(texture.pixels)[..., :3].astype(np.float64)
    low, high = min(float(np.quantile(pixels, 0.002)), 0.0), float(np.quantile(pixels, 0.998))
    pixels = 0.5 * (pixels + 1.0) if signed else (pixels - low) / max(high - low, 1e-9)
    if texture.encoding == "srgb":
        pixels = srgb_bytes_from_linear(pixels.astype(np.float32)) / 255.0
    full = np.repeat(pixels, 3, axis=2) if pixels.shape[2] == 1 else pixels
    return (np.clip(full, 0.0, 1.0) * 255.0).round().astype(np.uint8)

"""What a user may ask of an unwrap, and what is written.  Checked when made; sizes and paddings are in texels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

from .errors import InputError

if TYPE_CHECKING:
    from .mesh import Asset

SIZES = (16, 16384)
PRESETS = ("fast", "paper")
MODES = ("multi-chart", "global")
PRECISIONS = ("float32", "bfloat16")
ABLATIONS = ("no-triangle", "no-differential", "no-upper", "no-lower", "bidirectional", "chart-differential")
"""The paper's ablations: parts left out of the global mode, then parts added to the multi-chart mode."""
FORMATS = ("glb", "obj", "ply", "usda")
LARGEST_SEED = 2**32 - 1
PAPER_RANGES = {"steps": (1, 99_999_999), "width": (1, 8192), "points": (16, 1_000_000)}
"""Least and most of preset paper's numbers."""
AUTO = "auto"


@dataclass(frozen=True)
class Options:
    """What decides an unwrap, together with the surface.

    charts: K ≥ 1, the most charts a connected surface may get.  size: atlas side, 16 to 16384 texels.
    padding: texels kept free around each chart, 0 to size / 8; None is size / 256, at least 2.
    seed: 0 to 2³² − 1.
    preset: "fast" is seconds on a CPU; "paper" trains as published, which wants a GPU.
    What follows is for preset "paper" alone.  mode: "global" (one chart) or "multi-chart".  steps: optimizer steps,
    None as published (10,000).  width: channels of hidden layers, None as published (512).  points: of the surface, in
    each step, 16 to 1,000,000; None is 4900.  precision: "float32" or "bfloat16".  ablation: names out of ABLATIONS.

    Raises: InputError for a value outside these.
    """

    charts: int = 8
    size: int = 2048
    padding: int | None = None
    seed: int = 0
    preset: str = "fast"
    mode: str = "multi-chart"
    steps: int | None = None
    width: int | None = None
    points: int | None = None
    precision: str = "float32"
    ablation: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        (low, high), most, presets = SIZES, self.size // 8, ", ".join(PRESETS)
        _demand(self.charts >= 1, f"charts is {self.charts}, expected 1 or more; pass for instance --charts 8")
        _demand(low <= self.size <= high, f"size is {self.size} texels, expected {low} to {high}; pass --size 2048")
        _demand(0 <= self.margin <= most, f"padding is {self.margin} texels, expected 0 to {most}; leave --padding out")
        _demand(0 <= self.seed <= LARGEST_SEED, f"seed is {self.seed}, expected 0 to {LARGEST_SEED}; pass --seed 0")
        _demand(self.preset in PRESETS, f"preset is {self.preset!r}, expected one of {presets}; leave --preset out")
        self._check_paper()

    def _check_paper(self) -> None:
        """What preset "paper" alone can be asked."""
        for name, known in (("mode", MODES), ("precision", PRECISIONS)):
            value = getattr(self, name)
            _demand(value in known, f"{name} is {value!r}, expected one of {', '.join(known)}; leave --{name} out")
        for name in self.ablation:
            _demand(name in ABLATIONS, f"ablation is {name!r}, expected some of {', '.join(ABLATIONS)}; correct it")
        for name, (least, most) in PAPER_RANGES.items():
            value = getattr(self, name)
            fits = value is None or least <= value <= most
            _demand(fits, f"{name} is {value}, expected {least} to {most}; leave --{name} out")
        for name in ("mode", "steps", "width", "points", "precision", "ablation"):
            value, default = getattr(self, name), type(self).__dataclass_fields__[name].default
            found = f"{name} is {value!r}, expected {default!r} with preset {self.preset}"
            _demand(self.preset == "paper" or value == default, f"{found}; add --preset paper, or leave it out")

    @property
    def margin(self) -> int:
        """The padding in force, in texels."""
        return max(2, self.size // 256) if self.padding is None else self.padding


@dataclass(frozen=True)
class Outputs:
    """What is written beside the ONNX file and the report.

    maps: names of maps, or "auto": normal, position, and what the source's materials have, else uv-checker.
    formats: of "glb", "obj", "ply", "usda", at least one.  preview: whether the preview picture is drawn.
    texture_format: for all maps that can be stored so; None is each map's own.
    normal_format: green channel of the normal map, "opengl" (+Y) or "directx" (−Y).
    inverse: whether the inverse map, `<stem>.wrap.onnx`, is made.
    target: engine preset of file names, packing, depth and green channel; None is flexpara's own.
    layers: all maps as layers of one EXR file, of 16 (half) or 32 bits (float) and OpenEXR's compression.
    samples: per texel: 1, 4 or 16.  rays: per sample of ray-traced maps, 1 to 4096.

    Raises: InputError for an unknown format.
    """

    maps: tuple[str, ...] = (AUTO,)
    formats: tuple[str, ...] = ("glb",)
    preview: bool = True
    texture_format: Literal["png", "exr"] | None = None
    normal_format: Literal["opengl", "directx"] = "opengl"
    inverse: bool = False
    target: str | None = None
    layers: bool = False
    exr_bits: Literal[16, 32] = 32
    exr_compression: str = "zip"
    samples: int = 1
    rays: int = 64

    def __post_init__(self) -> None:
        found, known = ", ".join(self.formats), ", ".join(FORMATS)
        usable = len(self.formats) > 0 and set(self.formats) <= set(FORMATS)
        _demand(usable, f"format is {found!r}, expected some of {known}; pass for instance --format glb")
        kind, green = self.texture_format, self.normal_format
        _demand(kind in (None, "png", "exr"), f"texture format is {kind!r}, expected png or exr; choose one of them")
        _demand(green in ("opengl", "directx"), f"normal format is {green!r}, expected opengl or directx; choose one")
        _demand(self.samples in (1, 4, 16), f"samples is {self.samples}, expected 1, 4 or 16; choose one of them")
        _demand(1 <= self.rays <= 4096, f"rays is {self.rays}, expected 1 to 4096; pass for instance --rays 64")

    def for_asset(self, asset: Asset) -> Outputs:
        """The same with "auto" replaced by the maps it stands for, each map once."""
        from .material import source_maps

        auto = ("normal", "position", *(source_maps(asset) or ("uv-checker",)))
        maps = [name for entry in self.maps for name in (auto if entry == AUTO else (entry,))]
        return replace(self, maps=tuple(dict.fromkeys(maps)))

    def for_points(self) -> Outputs:
        """The same without the triangles as ply, whose name the points have; glb where that leaves none."""
        left = tuple(name for name in self.formats if name != "ply")
        return replace(self, formats=left or ("glb",))


def _demand(holds: bool, message: str) -> None:
    if not holds:
        raise InputError(message)

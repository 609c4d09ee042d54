"""What a user may ask for: one frozen dataclass for each concern, taken by the command line and by the Python API.

A field is an option: its name, default and type stand here, and the text under it is its help.  Commands take these
classes as they are (cyclopts flattens them); the API makes them of keywords (keywords.py).  So a new option is
one field here and its use.  Values are checked when an object is made.  Sizes and paddings are in texels.

Annotations are evaluated here, unlike in other modules: cyclopts reads those of fields that other classes inherit.
"""

import re
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from .atlas import AtlasOptions, Seeded, SourceOptions
from .seams import AUTO as AUTO
from .seams import SeamOptions, fast_alone
from .sources import MapSources
from .words import Flag, Names, demand, demand_known

if TYPE_CHECKING:
    from collections.abc import Iterable

    from ..mesh import Asset

PRESETS = ("fast", "paper")
MODES = ("multi-chart", "global")
PRECISIONS = ("float32", "bfloat16")
ABLATIONS = ("no-triangle", "no-differential", "no-upper", "no-lower", "bidirectional", "chart-differential")
"""The paper's ablations: parts left out of the global mode, then parts added to the multi-chart mode."""
FORMATS = ("glb", "gltf", "obj", "ply", "usda", "npz")
SHARINGS = ("scene", "mesh", "material")
SCENES = ("glb", "gltf")
"""Formats that hold scenes."""
POLYGONS = ("obj", "ply", "usda")
"""Formats that hold polygons of more than three corners."""
PAPER_RANGES = {"steps": (1, 99_999_999), "width": (1, 8192), "points": (16, 1_000_000)}
"""Least and most of preset paper's numbers."""
MOST_PAGES = 1000
"""UDIM has no more tiles."""
ONE_ATLAS = "expected one atlas; leave high out, and flexpara bake onto the files that are written"
"""Where maps of a high-poly mesh go."""
LAST_SET = 7
"""Of uv sets that programs read."""


Output = Annotated[Path, Parameter(name=["--output", "-o"])]
PAPER = Parameter(group="Options of preset paper")
"""Heading in the help."""


@dataclass(frozen=True, kw_only=True)
class PaperOptions:
    """What preset "paper" alone can be asked."""

    mode: Annotated[Literal["multi-chart", "global"], PAPER] = "multi-chart"
    """Whether the paper's method makes several charts or one chart of the whole surface."""
    steps: Annotated[int | None, PAPER] = None
    """Steps of the optimizer; 10000 by default, as published."""
    width: Annotated[int | None, PAPER] = None
    """Channels of the networks' hidden layers; 512 by default, as published."""
    points: Annotated[int | None, PAPER] = None
    """Points of the surface that each step looks at; 4900 by default.  Fewer are faster."""
    precision: Annotated[Literal["float32", "bfloat16"], PAPER] = "float32"
    """Number format of the networks' matrix products; bfloat16 is faster and less exact."""
    ablation: Annotated[Names, PAPER] = ()
    """Parts of the paper's losses that are left out of mode global (no-triangle, no-differential, no-upper, no-lower)
    or added to mode multi-chart (bidirectional, chart-differential)."""

    def __post_init__(self) -> None:
        for name, known in (("mode", MODES), ("precision", PRECISIONS)):
            demand_known(name, getattr(self, name), known)
        for name in self.ablation:
            demand(name in ABLATIONS, f"ablation is {name!r}, expected some of {', '.join(ABLATIONS)}; correct it")
        for name, (least, most) in PAPER_RANGES.items():
            value = getattr(self, name)
            fits = value is None or least <= value <= most
            demand(fits, f"{name} is {value}, expected {least} to {most}; leave --{name} out")


@dataclass(frozen=True, kw_only=True)
class ChartOptions(SeamOptions, SourceOptions):
    """What is asked of the charts, and how they are found."""

    preset: Literal["fast", "paper"] = "fast"
    """The way of training: fast takes seconds on a CPU; paper trains as published, which wants a GPU."""
    time_budget: float | None = None
    """Seconds after which preset fast ends with the best valid charts so far, maps not counted; by default none."""

    def __post_init__(self) -> None:
        SourceOptions.__post_init__(self)
        SeamOptions.__post_init__(self)
        fits = self.time_budget is None or (self.time_budget > 0.0 and self.preset == "fast")
        demand(fits, f"time-budget is {self.time_budget}, expected seconds above 0 and preset fast; leave it out")
        demand_known("preset", self.preset, PRESETS)
        for name in fast_alone() if self.preset == "paper" else ():
            found = f"{name.replace('_', '-')} with preset paper, which learns its seams, expected preset fast"
            demand(getattr(self, name) == getattr(SeamOptions, name), f"{found}; leave one of the two out")
        counted = self.charts != AUTO or self.preset == "fast"
        demand(counted, "charts auto with preset paper, expected a number; pass for instance --charts 8")


@dataclass(frozen=True, kw_only=True)
class TrainOptions(Seeded, PaperOptions, ChartOptions):
    """How the charts and their networks are made."""

    def __post_init__(self) -> None:
        for concern in (ChartOptions, PaperOptions, Seeded):
            concern.__post_init__(self)
        for field in fields(PaperOptions):
            value = getattr(self, field.name)
            found = f"{field.name} is {value!r}, expected {field.default!r} with preset {self.preset}"
            fits = self.preset == "paper" or value == field.default
            demand(fits, f"{found}; add --preset paper, or leave it out")


@dataclass(frozen=True, kw_only=True)
class Options(AtlasOptions, TrainOptions):
    """What decides an unwrap, together with the surface.

    Raises: InputError for a value outside what its field allows.
    """

    atlas: Literal["scene", "mesh", "material"] = "scene"
    """What shares an atlas: all of a scene, or each mesh or material has one with textures and an ONNX file of its
    own."""
    pages: int = 1
    """Pages that the charts are shared out to, 1 to 1000, at one texel density: where one would be too coarse.  Each
    has a material, textures and an ONNX file of its own, in one glb or gltf file."""
    udim: Flag = False
    """Lay each page into a square of uv of its own, as UDIM tiles 1001, 1002, …, with textures STEM_MAP.1001.png and so
    on, for obj, ply, usda or npz."""

    @property
    def several(self) -> bool:
        """Whether there may be more than one atlas."""
        return self.atlas != SHARINGS[0] or self.paged

    @property
    def paged(self) -> bool:
        """Whether charts are shared out to pages."""
        return self.pages > 1 or self.udim

    def __post_init__(self) -> None:
        TrainOptions.__post_init__(self)
        AtlasOptions.__post_init__(self)
        found = f"pages is {self.pages}, expected 1 to {MOST_PAGES}"
        demand(1 <= self.pages <= MOST_PAGES, f"{found}; pass for instance --pages 4")
        plain = not self.paged or (self.preset == "fast" and self.atlas == SHARINGS[0] and self.stack == "off")
        demand(plain, "pages or udim with atlas, stack or preset paper, expected one of them; leave one out")
        demand_known("atlas", self.atlas, SHARINGS)
        single = self.atlas == SHARINGS[0] or self.preset == "fast"
        demand(single, f"atlas is {self.atlas} with preset paper, expected scene; leave --atlas out")


@dataclass(frozen=True, kw_only=True)
class MapOptions:
    """Which maps are baked, and how they are stored."""

    maps: Names = (AUTO,)
    """The maps to bake, by name (flexpara bake --help lists them).  auto stands for what the source has: colours and
    the textures of its materials, or of the high-poly mesh, and its normals; none bakes nothing."""
    background: str | None = None
    """Colour of what lies beyond the padding of charts, as #rrggbb; by default the whole image is filled from the
    nearest chart, so that mip levels take in no background."""
    target: str | None = None
    """The engine that the files are for: gltf, unreal, unity, godot, blender or usd.  It decides about file names,
    packed channels, bit depth, green channel and padding."""
    texture_format: Literal["png", "exr"] | None = None
    """File type of all maps that can be stored so; by default each map has its own."""
    normal_format: Literal["opengl", "directx"] = "opengl"
    """Direction of the normal map's green channel: opengl is +Y, directx is -Y."""
    samples: int = 1
    """Samples of each texel: 1, 4 or 16."""
    rays: int = 64
    """Rays of each sample, 1 to 4096, for the maps that are ray-traced."""
    denoise: Flag = False
    """Take the noise out of those maps by Open Image Denoise, which flexpara[denoise] brings."""
    layers: Flag = False
    """Write all maps as layers of one file, STEM.exr."""
    exr_bits: Literal[16, 32] = 32
    """Bits of each channel of that file: 16 (half) or 32 (float)."""
    exr_compression: str = "zip"
    """Compression of that file, by OpenEXR's name: zip, zips, piz, rle, none, …"""

    def __post_init__(self) -> None:
        kind, green, color = self.texture_format, self.normal_format, self.background
        demand(kind in (None, "png", "exr"), f"texture format is {kind!r}, expected png or exr; choose one of them")
        demand(green in ("opengl", "directx"), f"normal format is {green!r}, expected opengl or directx; choose one")
        demand(self.samples in (1, 4, 16), f"samples is {self.samples}, expected 1, 4 or 16; choose one of them")
        demand(1 <= self.rays <= 4096, f"rays is {self.rays}, expected 1 to 4096; pass for instance --rays 64")
        plain = (self.exr_bits, self.exr_compression) == (MapOptions.exr_bits, MapOptions.exr_compression)
        demand(self.layers or plain, "exr-bits or exr-compression without layers, expected both; add --layers")
        hexadecimal = color is None or re.fullmatch("#[0-9a-fA-F]{6}", color) is not None
        demand(hexadecimal, f"background is {color!r}, expected a colour as #rrggbb; pass --background #000000")
        both = self.layers and self.target is not None
        demand(not both, f"layers with target {self.target}, expected one of the two; leave the other out")


@dataclass(frozen=True, kw_only=True)
class FileOptions:
    """What is written beside the ONNX file, the maps and the report."""

    formats: Annotated[Names, Parameter(name="--format")] = ("glb",)
    """Mesh files to write: some of glb, gltf (with a .bin beside it), obj, ply, usda and npz (arrays, for programs).
    glb and gltf keep all that a glTF scene holds."""
    uv_set: int | None = None
    """The uv set that the new uv become, 0 to 7, while other sets, materials and textures stay: 1 is usual for light
    maps.  By default the new uv are set 0, textures are baked onto them, and old sets follow."""
    inverse: Flag = False
    """Also write STEM.wrap.onnx, the network from uv and chart to point and normal."""
    preview: bool | None = None
    """Draw STEM.preview.png; by default where maps are baked."""
    report: Flag = False
    """Also write STEM.report.html, which shows the result in a browser, without network; see flexpara report."""

    def __post_init__(self) -> None:
        found, known = ", ".join(self.formats), ", ".join(FORMATS)
        usable = len(self.formats) > 0 and set(self.formats) <= set(FORMATS)
        demand(usable, f"format is {found!r}, expected some of {known}; pass for instance --format glb")
        if self.uv_set is not None:
            fits, several = 0 <= self.uv_set <= LAST_SET, set(self.formats) <= set(SCENES)
            demand(fits, f"uv-set is {self.uv_set}, expected 0 to {LAST_SET}; pass for instance --uv-set 1")
            demand(several, f"uv-set with format {found}, which holds one set, expected glb or gltf; leave one out")


@dataclass(frozen=True, kw_only=True)
class Outputs(FileOptions, MapSources, MapOptions):
    """What an unwrap writes.

    Raises: InputError for a value outside what its field allows.
    """

    def __post_init__(self) -> None:
        for concern in (MapOptions, MapSources, FileOptions):
            concern.__post_init__(self)
        named = sorted({"obj", "usda"} & set(self.formats))
        found = f"layers with format {', '.join(named)}, whose materials name one file a map"
        demand(not (self.layers and named), f"{found}, expected glb or ply; leave one of the two out")

    def for_asset(self, asset: "Asset") -> "Outputs":
        """The same for one mesh: "auto" replaced by the maps it stands for, each map once, and preview decided.

        Raises: InputError for a map of textures that could not be read.
        """
        from ..material import refuse_unread, source_maps

        auto = source_maps(asset) if self.uv_set is None else ()
        found = self.with_auto(auto)
        refuse_unread(asset, found.maps)
        return found

    def with_auto(self, auto: "Iterable[str]") -> "Outputs":
        """The same with these maps in the place of "auto", each map once, and preview decided."""
        maps = [name for entry in self.maps for name in (auto if entry == AUTO else (entry,))]
        drawn = bool(self.maps or self.fields) if self.preview is None else self.preview
        return replace(self, maps=tuple(dict.fromkeys(maps)), preview=drawn)

    def for_pages(self) -> None:
        """Raises: InputError for what a mesh with several atlases can't be written as."""
        found, fits = ", ".join(self.formats), set(self.formats) <= set(SCENES)
        demand(fits, f"several atlases with format {found}, expected glb or gltf; pass --format glb")
        demand(not self.layers, "several atlases with layers, expected one of the two; leave the other out")
        demand(not self.report, "several atlases with report, expected one of the two; leave the other out")
        demand(not self.high, f"several atlases with high, {ONE_ATLAS}")

    def for_tiles(self) -> None:
        """Raises: InputError for what a mesh over UDIM tiles can't be written as."""
        found = ", ".join(sorted(set(self.formats) & set(SCENES)))
        demand(
            not found,
            f"format {found} with udim, which glTF does not know, expected obj, ply, usda or npz; pass for instance "
            "--format obj, or leave --udim out",
        )
        plain = not (self.layers or self.report) and self.target is None
        demand(plain, "udim with layers, a target or report, expected none of them; leave them out")
        demand(not self.high, f"udim with high, {ONE_ATLAS}")

    def for_points(self) -> "Outputs":
        """The same without the triangles as ply or npz, whose names the points have; glb where that leaves none."""
        left = tuple(name for name in self.formats if name not in ("ply", "npz"))
        return replace(self, formats=left or ("glb",))


@dataclass(frozen=True, kw_only=True)
class CheckpointOptions:
    """Long runs that may be cut short."""

    every: Annotated[int | None, Parameter(name="--checkpoint-every", group=PAPER.group)] = None
    """Steps between two checkpoints, from which --resume goes on; by default none are kept."""
    resume: Path | None = None
    """The output folder of a run with checkpoints that was cut short.  It goes on with its own mesh and options, so
    nothing else may be given."""

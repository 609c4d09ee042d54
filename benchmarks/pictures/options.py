"""What options do to charts and atlases: the same mesh at several settings, side by side."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh
import xatlas
from PIL import Image, ImageDraw
from trimesh.visual import TextureVisuals

import flexpara
from benchmarks.pictures.sheets import PANEL, Column, foot, keep, save, sheet
from flexpara.__main__ import main as command
from flexpara.bake.colors.color import chart_colors, srgb_bytes_from_linear
from flexpara.bake.pictures.canvas import draw
from flexpara.bake.pictures.preview import PAPER, layout
from flexpara.bake.raster.context import open_context
from flexpara.runtime.samples import make_sample
from flexpara.train.carry.proxy import simplified

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from flexpara.runtime.mesh import Atlas

SIZE = 512
"""Texels of the atlases that are shown: paddings are seen."""
ZOOM, COARSE = 30, 24
"""Pixels of a texel, and texels of an atlas, where texels are shown."""
RECTANGLES = ((1.0, 0.62), (0.5, 0.37), (0.83, 0.21), (0.31, 0.29))
"""Their sides."""
LOW = 2500
"""Faces of a coarse bunny."""
RUMP = 0.45
"""Spot's hind quarters lie behind this z."""
SHOWN: Mapping[str, tuple[str, tuple[dict[str, Any], ...]]] = {
    "charts": ("spot", ({"charts": 1}, {"charts": 16})),
    "seam-price": ("spot", ({"seam_price": 0.0005}, {"seam_price": 0.003}, {"seam_price": 0.02})),
    "page-price": ("rocker-arm", ({"page_price": 0.0}, {"page_price": 0.01}, {"page_price": 0.03})),
    "max-stretch": ("spot", ({"max_stretch": 1.005}, {"max_stretch": 1.02}, {"max_stretch": 1.1})),
    "seed": ("spot", ({"seed": 0}, {"seed": 1}, {"seed": 2})),
    "seams": ("rocker-arm", ({"seams": "short"}, {"seams": "hidden"}, {"seams": "crease"})),
    "protect": ("spot", ({}, {"protect": "rump.npy"})),
    "importance": ("spot", ({}, {"importance": "rump.npy"})),
    "symmetry": ("suzanne", ({}, {"symmetry": "x"})),
    "energy": ("spot", ({"energy": "isometric"}, {"energy": "conformal"}, {"energy": "arap"})),
    "start": ("xatlas.obj", ({"keep_islands": True}, {"start": "xatlas.obj"})),
    "hard-edges": ("fandisk", ({"hard_edges": "free"}, {"hard_edges": "split"})),
    "keep-seams": ("spot", ({}, {"keep_seams": ("uv",)}, {"keep_islands": True})),
    "cut": ("spot", ({"charts": 1}, {"charts": 1, "cut": "back.txt"})),
    "crease-angle": ("fandisk", ({"crease_angle": 5}, {"crease_angle": 30}, {"crease_angle": 120})),
    "padding": ("spot", ({"padding": 1}, {"padding": 8}, {"padding": 32})),
    "texel-density": ("spot", ({"texel_density": 40}, {"texel_density": 80})),
    "rotation": ("fandisk", ({"rotation": "off"}, {"rotation": "90"}, {"rotation": "any"})),
    "stack": ("brackets.ply", ({"stack": "off"}, {"stack": "identical"}, {"stack": "mirrored"})),
    "pages": ("suzanne", ({"pages": 3},)),
    "atlas": ("two.glb", ({"atlas": "mesh"},)),
}
"""Picture: mesh, and the settings that are set side by side; what ends in a suffix is made by `Inputs`."""
MADE = ("protect", "importance", "cut", "start")
"""Options whose value is a file that is made."""
GREY = ("crease-angle",)
"""Pictures in which the light on the shape is what is shown."""


@dataclass(frozen=True)
class Inputs:
    """Files that are shown: meshes of a folder of models, and what is made of them in another folder."""

    models: Path
    folder: Path

    def mesh(self, name: str) -> Path:
        """A model, or a mesh that is made."""
        if "." not in name:
            return self.models / f"{name}.obj"
        return self.made(name)

    def made(self, name: str) -> Path:
        """A file by its name."""
        path = self.folder / name
        {
            "rump.npy": self._rump,
            "back.txt": self._back,
            "brackets.ply": self._brackets,
            "two.glb": self._two,
            "islands.obj": self._islands,
            "xatlas.obj": self._xatlas,
        }[name](path)
        return path

    @cached_property
    def spot(self) -> NDArray[np.float64]:
        """Its vertices."""
        return flexpara.load(self.mesh("spot")).positions

    def _rump(self, path: Path) -> None:
        np.save(path, self.spot[self.spot[:, 2] > RUMP])

    def _back(self, path: Path) -> None:
        path.write_text("0 0.9 -0.2   0 0.3 1.0\n", encoding="ascii")

    def _brackets(self, path: Path) -> None:
        vertices, faces = make_sample("bracket", resolution=24)
        parts = []
        for number in range(4):
            placed = vertices + np.array([2.6 * (number % 2), 2.6 * (number // 2), 0.0])
            side = number % 2 == 1
            parts.append(
                trimesh.Trimesh(placed * [-1.0, 1.0, 1.0] if side else placed, faces[:, ::-1] if side else faces)
            )
        trimesh.util.concatenate(parts).export(path)

    def _two(self, path: Path) -> None:
        scene = trimesh.Scene()
        for name, shift in (("spot", 0.0), ("fandisk", 1.6)):
            asset = flexpara.load(self.mesh(name))
            size = np.ptp(asset.positions, axis=0).max()
            placed = (asset.positions - asset.positions.mean(axis=0)) / size + [shift, 0.0, 0.0]
            scene.add_geometry(trimesh.Trimesh(placed, asset.faces, process=False), node_name=name, geom_name=name)
        scene.export(path)

    def _islands(self, path: Path) -> None:
        """Spot's charts, every other one half as large as it should be."""
        atlas = flexpara.unwrap(self.mesh("spot"), size=SIZE).atlas
        chart = np.zeros(len(atlas.uv), np.int64)
        chart[atlas.faces] = atlas.face_chart[:, None]
        uv = atlas.uv * np.where(chart[:, None] % 2 == 1, 0.5, 1.0)
        trimesh.Trimesh(atlas.positions, atlas.faces, visual=TextureVisuals(uv), process=False).export(path)

    def _xatlas(self, path: Path) -> None:
        """Suzanne's atlas by xatlas."""
        surface = flexpara.load(self.mesh("suzanne")).surface
        vertex, faces, uv = xatlas.parametrize(surface.vertices, surface.faces)
        visual = TextureVisuals(np.asarray(uv, dtype=np.float64))
        trimesh.Trimesh(surface.vertices[vertex], faces, visual=visual, process=False).export(path)


def words_of(settings: Mapping[str, Any]) -> str:
    """The settings as one types them."""
    named = [(f"--{name.replace('_', '-')}", value) for name, value in settings.items()]
    words = [
        flag if value is True else f"{flag} {','.join(value) if isinstance(value, tuple) else value}"
        for flag, value in named
    ]
    return " ".join(words) or "by default"


def options(inputs: Inputs, name: str) -> None:
    """One of SHOWN."""
    mesh, several = SHOWN[name]
    columns = []
    for settings in several:
        given = {key: inputs.made(value) if key in MADE else value for key, value in settings.items()}
        columns += unwrapped(inputs.mesh(mesh), given, words_of(settings))
        print(name, *(column.measured for column in columns), sep=" · ", flush=True)
    save(name, sheet(columns, grey=name in GREY))


def unwrapped(mesh: Path, settings: dict[str, Any], words: str) -> list[Column]:
    """A column of a setting, or one for each page that comes of it."""
    wanted = {"size": SIZE, **settings}
    if "pages" in settings or "atlas" in settings:
        pages = flexpara.unwrap_pages(mesh, **wanted).pages
        return [
            Column.of(page.asset, page.atlas, f"{words}: {page.asset.stem}", page.report["metrics"]) for page in pages
        ]
    result = flexpara.unwrap(mesh, **wanted)
    return [Column.of(result.asset, result.atlas, words, result.report["metrics"])]


def density(inputs: Inputs) -> None:
    """Islands of unequal size, packed."""
    columns = []
    for kind in ("equal", "kept"):
        result = flexpara.pack(inputs.mesh("islands.obj"), size=SIZE, density=kind)
        columns.append(Column.of(result.asset, result.atlas, f"pack --density {kind}", result.report["metrics"]))
    save("density", sheet(columns))


def udim(inputs: Inputs) -> None:
    """Two tiles beside each other."""
    result = flexpara.pack(inputs.mesh("islands.obj"), size=SIZE, pages=2, udim=True)
    assert result.page is not None
    colors = chart_colors(int(result.atlas.face_chart.max()) + 1)
    with open_context() as context:
        tiles = [
            draw(context, *layout(tile(result.atlas, result.page == page, page), colors), pixels=PANEL, paper=PAPER)
            for page in (0, 1)
        ]
    feet = [foot(str(1001 + page), f"u from {page} to {page + 1}") for page in (0, 1)]
    save("udim", np.concatenate([np.concatenate(pair) for pair in zip(tiles, feet, strict=True)], axis=1))


def tile(atlas: Atlas, chosen: NDArray[np.bool_], page: int) -> Atlas:
    """The faces (f,) of a tile in the unit square."""
    uv = (atlas.uv - np.array([page, 0], np.float32)).astype(np.float32)
    return replace(atlas, faces=atlas.faces[chosen], face_chart=atlas.face_chart[chosen], uv=uv, stack=None)


def whole_texels(inputs: Inputs) -> None:
    """Rectangles on a coarse page: texels, and the edges of charts among them."""
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    vertices = np.concatenate([corners * [*side, 1.0] + [0.0, 0.0, k] for k, side in enumerate(RECTANGLES)])
    faces = np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * k for k in range(len(RECTANGLES))])
    path = inputs.folder / "rectangles.ply"
    trimesh.Trimesh(vertices, faces, process=False).export(path)
    images = []
    for whole in (False, True):
        atlas = flexpara.unwrap(path, size=COARSE, padding=1, whole_texels=whole).atlas
        side = COARSE * ZOOM
        image = Image.new("RGB", (side, side), (252, 252, 252))
        pen = ImageDraw.Draw(image)
        tones = srgb_bytes_from_linear(chart_colors(int(atlas.face_chart.max()) + 1))
        for corners, chart in zip(atlas.corner_uv * [side, -side] + [0, side], atlas.face_chart, strict=True):
            pen.polygon([tuple(corner) for corner in corners.tolist()], fill=tuple(tones[chart].tolist()))
        for place in range(0, side + 1, ZOOM):
            pen.line([(place, 0), (place, side)], fill=(150, 150, 150))
            pen.line([(0, place), (side, place)], fill=(150, 150, 150))
        images.append(np.asarray(image.resize((PANEL, PANEL), Image.Resampling.LANCZOS)))
    gap = np.full((PANEL, 20, 3), 255, np.uint8)
    keep("whole-texels", Image.fromarray(np.concatenate([images[0], gap, images[1]], axis=1)))


def high(inputs: Inputs) -> None:
    """Normals of a coarse bunny alone, from the fine one, and with a close cage."""
    fine = inputs.mesh("bunny")
    coarse = simplified(flexpara.load(fine).surface, LOW)
    low = inputs.folder / "low.ply"
    trimesh.Trimesh(coarse.vertices, coarse.faces, process=False).export(low)
    size = ["--size", str(SIZE), "--quiet"]
    assert command(["unwrap", str(low), "-o", str(inputs.folder), "--maps", "none", *size]) == 0
    panels = []
    for words in ("", f"--high {fine} --cage 0.02", f"--high {fine} --cage 0.0005"):
        out = inputs.folder / f"maps{len(panels)}"
        baked = ["bake", str(inputs.folder / "low.glb"), "-o", str(out), "--maps", "normal", *size]
        assert command([*baked, *words.split()]) == 0
        image = Image.open(out / "low_normal.png").convert("RGB").resize((PANEL, PANEL), Image.Resampling.LANCZOS)
        line = words.replace(str(fine), fine.name) or "the coarse mesh alone"
        below = Image.fromarray(srgb_bytes_from_linear(foot(line)))
        panels.append(np.concatenate([np.asarray(image), np.asarray(below)]))
    keep("high", Image.fromarray(np.concatenate(panels, axis=1)))


OTHERS: Mapping[str, Callable[[Inputs], None]] = {
    "density": density,
    "udim": udim,
    "whole-texels": whole_texels,
    "high": high,
}
"""Pictures that are no columns of unwraps."""

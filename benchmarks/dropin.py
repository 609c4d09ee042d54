"""`flexpara.xatlas` beside xatlas, the same calls: `python -m benchmarks.dropin [MESH…] [--level-sets FACES…]`.

With --kept TABLE.json a run that was ended goes on: lines that are in that file are not measured again.
Each mesh goes through `add_mesh`, `generate` and `get_mesh` with default options, in a process for each tool.  A level
set is what callers in 3D generation hand over: marching cubes over a labyrinth with noise, its vertices rounded as such
pipelines do, so that edges are not manifold and crumbs float about.  Seconds are those of the calls; CPU seconds are
those of the process.  Seam is its length over √area; symdir the mean symmetric Dirichlet energy, 1 is isometric.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from argparse import ArgumentParser
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from benchmarks.corpus.processes import run
from flexpara.runtime.files import replace_file
from flexpara.runtime.geometry.metrics import measure
from flexpara.runtime.io.clean.clean import clean
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.io.rawmesh import RawMesh

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

TOOLS = ("xatlas", "flexpara.xatlas")
LIMIT = 1200.0
"""Seconds after which a run is ended."""
WAVES = 1.5
"""Periods of the labyrinth along a side of its box."""
NOISE = 0.12
"""Standard deviation of the noise in a field that reaches from −1.5 to 1.5, before it is smoothed."""
ROUNDED = 4.0
"""Steps of a cell that vertices are rounded to."""
COARSE = 64
"""Cells along a side from which those of a level set with the faces asked for are foretold."""


class Mesh(NamedTuple):
    """What is handed over: a name, vertices (v, 3), faces (f, 3)."""

    name: str
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]


def level_set(faces: int) -> Mesh:
    """Marching cubes of about so many faces, which grow with the square of the cells along a side."""
    cells = round(COARSE * (faces / len(marched(COARSE).faces)) ** 0.5)
    return marched(round(cells * (faces / len(marched(cells).faces)) ** 0.5))


def marched(cells: int) -> Mesh:
    """A gyroid with noise in a box of `cells` each way."""
    measure_of, filters = import_module("skimage.measure"), import_module("scipy.ndimage")
    x, y, z = np.meshgrid(*[np.linspace(0.0, 2.0 * np.pi * WAVES, cells)] * 3, indexing="ij")
    noise = np.random.default_rng(0).normal(scale=NOISE, size=x.shape)
    field = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
    field = np.pad(field + filters.gaussian_filter(noise, 0.5), 1, constant_values=2.0)
    vertices, faces, _, _ = measure_of.marching_cubes(field, 0.0, method="lorensen")
    rounded, weld = np.unique(np.round(vertices * ROUNDED), axis=0, return_inverse=True)
    faces = weld.reshape(-1)[faces]
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return Mesh("level set", rounded / (ROUNDED * cells), faces[whole].astype(np.int64))


def unwrapped(tool: str, given: str, answer: str, budget: float) -> None:
    """One run, in this process: mapping, faces and uv in texels, and the seconds of the calls, into a file."""
    xatlas = import_module(tool)
    if tool != "xatlas":
        xatlas.settings.time_budget = budget
    with np.load(given) as mesh:
        vertices, faces = mesh["vertices"].astype(np.float32), mesh["faces"].astype(np.uint32)
    start = time.perf_counter()
    atlas = xatlas.Atlas()
    atlas.add_mesh(vertices, faces)
    atlas.generate()
    mapping, corner, uv = atlas.get_mesh(0)
    seconds = time.perf_counter() - start
    np.savez(answer, mapping=mapping, faces=corner, uv=uv * (atlas.width, atlas.height), seconds=seconds)


def row(tool: str, mesh: Mesh, budget: float, folder: Path) -> str:
    """A line of the table.  What has no area is not measured, whoever left it out."""
    given, answer = folder / "mesh.npz", folder / f"{tool}.npz"
    np.savez(given, vertices=mesh.vertices, faces=mesh.faces)
    words = ["--run", tool, "--given", str(given), "--answer", str(answer), "--budget", str(budget)]
    ended = run([sys.executable, "-m", "benchmarks.dropin", *words], LIMIT)
    start = f"| {mesh.name} | {len(mesh.faces):,} | {tool} |"
    if ended.code != 0:
        return f"{start} ended with {ended.code}: {ended.said} |"
    with np.load(answer) as found:
        uv = found["uv"].astype(np.float64)[found["faces"]]
        seconds = float(found["seconds"])
    found = measured(mesh, uv)
    measures = f"{found['charts']:,} | {found['seam_length']:.2f} | {found['symmetric_dirichlet_mean']:.4f}"
    return f"{start} {seconds:.1f} ({ended.cpu_seconds:.0f}) | {measures} | {found['flipped_faces']} |"


def measured(mesh: Mesh, uv: NDArray[np.float64]) -> dict[str, Any]:
    """Metrics of uv (f, 3, 2) at the corners of a mesh's faces, those that have an area."""
    number = np.arange(len(mesh.faces))
    asset = clean(RawMesh(mesh.vertices, mesh.faces, face_material=number, origin=np.arange(len(mesh.vertices))))
    assert asset.face_material is not None
    assert asset.origin is not None
    own = uv[asset.face_material]
    turned = asset.origin[asset.faces[:, 1]] != mesh.faces[asset.face_material, 1]
    return measure(asset.surface, np.where(turned[:, None, None], own[:, [0, 2, 1]], own)).to_dict()


@dataclass(frozen=True)
class Kept:
    """Lines of the table that are known, in a file where there is one: {"what was run": "line"}."""

    path: Path | None

    def line(self, name: str, made: Callable[[], str]) -> str:
        """The line of that name; measured, and kept at once, where it is not known."""
        known: dict[str, str] = {}
        if self.path is not None and self.path.is_file():
            known = json.loads(self.path.read_text(encoding="utf-8"))
        if name not in known:
            known[name] = made()
            if self.path is not None:
                replace_file(self.path, json.dumps(known, indent=1, ensure_ascii=False).encode())
        return known[name]


def given_meshes(paths: Sequence[Path], level_sets: Sequence[int]) -> Iterator[Mesh]:
    """Files, then level sets of so many faces."""
    for path in paths:
        surface = load_asset(path).surface
        yield Mesh(path.stem, surface.vertices, surface.faces)
    yield from map(level_set, level_sets)


def main() -> None:
    """Print the table, a line as soon as it is known; or, in a process of its own, make one run."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("meshes", nargs="*", type=Path)
    parser.add_argument("--level-sets", nargs="*", type=int, default=[])
    parser.add_argument("--budget", type=float, default=60.0, help="seconds for flexpara.xatlas.settings.time_budget")
    parser.add_argument("--tools", nargs="*", choices=TOOLS, default=TOOLS, help="those that are run, by default both")
    parser.add_argument("--kept", type=Path, help="a file that keeps each line as soon as it is known")
    for name in ("--run", "--given", "--answer"):
        parser.add_argument(name)
    asked = parser.parse_args()
    if asked.run:
        unwrapped(asked.run, asked.given, asked.answer, asked.budget)
        return
    print("| mesh | faces | tool | seconds (CPU) | charts | seam | symdir | flips |\n|---|---|---|---|---|---|---|---|")
    kept = Kept(asked.kept)
    with tempfile.TemporaryDirectory() as folder:
        for mesh in given_meshes(asked.meshes, asked.level_sets):
            for tool in asked.tools:
                name = f"{mesh.name} {len(mesh.faces)} {tool}" + f" {asked.budget:g} s" * (tool != "xatlas")
                print(kept.line(name, partial(row, tool, mesh, asked.budget, Path(folder))), flush=True)


if __name__ == "__main__":
    main()

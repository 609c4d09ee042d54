"""Results for a report: from output folders of flexpara, from mesh files of any tool, and from an unwrap just done.

A folder may come from anyone: what its report says is looked at piece by piece, and names lead nowhere outside.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...runtime.errors import FlexparaError, InputError, MissingFileError
from ...runtime.files import LARGEST_REPORT
from ...runtime.geometry.triangles import signed_areas
from ...runtime.io.gltf.uvsets import uv_of_set
from ...runtime.io.meshfile import load_asset
from .page import write_page
from .result import BEFORE, Result, measured, part, reported
from .shape import Shape
from .words import number_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from ...runtime.files import OutputFolder
    from ...runtime.mesh import Asset, Atlas

ENDINGS = ("glb", "gltf", "obj", "ply", "usda")
"""Mesh files beside a report, the first that is there; a usda file can't be read back."""
REPORT = ".report.json"


@dataclass(frozen=True)
class ReportSettings:
    """picture: side of pictures in texels, at most.  most: results of one report.  faces: of all of them together."""

    picture: int = 1024
    most: int = 12
    faces: int = 4_000_000


def results_in(paths: Sequence[Path], settings: ReportSettings | None = None) -> list[Result]:
    """The results that lie in folders, or that mesh files with uv are.

    Raises: MissingFileError, InputError where there is none, or too much for one page; MeshError for a damaged mesh.
    """
    settings = settings or ReportSettings()
    several = len(paths) > 1
    found: list[Result] = []
    places: list[Path] = []
    for path in paths:
        stems = _stems(path) if path.is_dir() else [path.stem]
        if len(found) + len(stems) > settings.most:
            count = f"{len(found) + len(stems)} results, expected at most {settings.most} in one report"
            raise InputError(f"{count}; name a report file of the folder: {path}/STEM{REPORT}")
        for stem in stems:
            found += _results(path, stem, settings, several=several or len(stems) > 1)
            places.append(
                path.resolve() / stem if path.is_dir() else path.resolve().with_name(path.name.removesuffix(REPORT))
            )
            _demand_room(found, settings)
    if len(places) == 1:
        return found
    return [replace(result, title=title) for result, title in zip(found, told_apart(places), strict=True)]


def told_apart(places: Sequence[Path]) -> list[str]:
    """The end of each path, as short as tells it from the others; a folder with the name of its result is said once."""
    ways = [(place.parent if place.name == place.parent.name else place).parts for place in places]

    def title(way: tuple[str, ...]) -> str:
        alone = (n for n in range(1, len(way)) if sum(other[-n:] == way[-n:] for other in ways) == 1)
        return "/".join(way[-next(alone, len(way) - 1) :])

    return [title(way) for way in ways]


def write_result(output: OutputFolder, atlas: Atlas, asset: Asset, report: Mapping[str, Any]) -> None:
    """Write STEM.report.html of an unwrap whose pictures are in the folder, beside the uv that the mesh came with.

    Raises: InputError where it is too much for one page; as OutputFolder.write.
    """
    settings, title = ReportSettings(), output.stem

    def write(path: Path) -> None:
        after = reported(title, Shape.of_atlas(atlas, asset), report, path.parent, settings.picture)
        results = [*before_of(asset, asset.uv, after), after]
        _demand_room(results, settings)
        write_page(results, title, path)

    output.write(f"{title}.report.html", write)


def write_compared(named: Sequence[tuple[str, Atlas, Asset, Mapping[str, Any]]], title: str, path: Path) -> None:
    """Write the page of unwraps that are in no folder: a name, an atlas, its mesh and a report each.

    Raises: InputError where they are too much for one page.
    """
    settings = ReportSettings()
    found = [
        reported(name, Shape.of_atlas(atlas, asset), report, path.parent, settings.picture)
        for name, atlas, asset, report in named
    ]
    _demand_room(found, settings)
    write_page(found, title, path)


def before_of(asset: Asset, uv: NDArray[np.float64] | None, after: Result) -> list[Result]:
    """The uv that the mesh came with as a result of its own, where they are a layout."""
    if uv is None or not np.isfinite(uv).all() or not np.abs(signed_areas(uv[asset.faces])).sum() > 0.0:
        return []
    return [measured(BEFORE, Shape.of_asset(asset, uv), after.mesh, after.page)]


def _demand_room(results: Sequence[Result], settings: ReportSettings) -> None:
    faces = sum(len(result.shape.faces) for result in results)
    if faces > settings.faces:
        found = f"{faces} faces, expected at most {settings.faces} in one report"
        raise InputError(f"{found}; leave results out, or decimate the mesh")


def _stems(folder: Path) -> list[str]:
    """Base names of the results in a folder.  Raises: InputError where there is none."""
    stems = sorted(path.name.removesuffix(REPORT) for path in folder.iterdir() if path.name.endswith(REPORT))
    if not stems:
        raise InputError(f"{folder} holds no STEM{REPORT}, expected the output of flexpara unwrap; unwrap into it")
    return stems


def _results(path: Path, stem: str, settings: ReportSettings, *, several: bool) -> list[Result]:
    """What a folder's stem, a report file or a mesh file shows.  several: whether other results stand beside it."""
    if not path.exists():
        raise MissingFileError(f"{path} does not exist, expected an output folder or a mesh with uv; check the path")
    if path.name.endswith(REPORT):
        path, stem = path.parent, path.name.removesuffix(REPORT)
    if not path.is_dir():
        asset = load_asset(path)
        if asset.uv is None:
            raise InputError(f"{path} has no uv, expected a mesh that carries them; unwrap it: flexpara unwrap {path}")
        return [measured(path.name, Shape.of_asset(asset, asset.uv), asset.sha256)]
    report = read_report(path / f"{stem}{REPORT}")
    asset = load_asset(_mesh_beside(path, stem))
    after = reported(stem, Shape.of_asset(asset, _written_uv(asset, report)), report, path, settings.picture)
    return [after] if several else [*before_of(asset, _old_uv(asset, report), after), after]


def _mesh_beside(folder: Path, stem: str) -> Path:
    """The mesh file of a result.  Raises: InputError where there is none that can be read."""
    there = (folder / f"{stem}.{ending}" for ending in ENDINGS)
    found = next((path for path in there if path.is_file()), None)
    if found is None or found.suffix == ".usda":
        names = ", ".join(f"{stem}.{ending}" for ending in ENDINGS[:-1])
        raise InputError(f"{folder} holds none of {names}, expected the unwrapped mesh; unwrap it with --format glb")
    return found


def _uv_set(report: Mapping[str, Any]) -> int:
    """The uv set that the new uv are."""
    return int(number_of(part(report, "outputs").get("uv_set")) or 0)


def _written_uv(asset: Asset, report: Mapping[str, Any]) -> NDArray[np.float64]:
    """(n, 2) the uv that the run made.  Raises: InputError where the mesh has none."""
    number = _uv_set(report)
    if number == 0 and asset.uv is not None:
        return asset.uv
    return uv_of_set(asset, number)


def _old_uv(asset: Asset, report: Mapping[str, Any]) -> NDArray[np.float64] | None:
    """(n, 2) the uv that the mesh came with, where its file has kept them."""
    try:
        return uv_of_set(asset, 0 if _uv_set(report) else 1)
    except FlexparaError:
        return None


def read_report(path: Path) -> dict[str, Any]:
    """A report as JSON, whatever it holds.  Raises: InputError where it is no JSON object, or beyond any size."""
    try:
        if path.stat().st_size > LARGEST_REPORT:
            raise InputError(f"{path} has over {LARGEST_REPORT} bytes, expected a report; unwrap the mesh again")
        report = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path} is no report that can be read ({error}); unwrap the mesh again") from error
    if not isinstance(report, dict):
        raise InputError(f"{path} holds {type(report).__name__}, expected a JSON object; unwrap the mesh again")
    return report

"""The meshes of a batch: found in folders, listed, or named; each with its options and a name of its own."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ..cli.inputs import ENDINGS
from ..errors import InputError, MissingFileError
from ..files import written_in
from ..io.formats.converted import CONVERTED
from ..options.keywords import from_keywords
from ..options.unwrap import Options, Outputs
from .beside import rebased

if TYPE_CHECKING:
    from collections.abc import Iterable

LISTS = (".jsonl",)
LARGEST_LINE = 1 << 16
"""Bytes of a line of a list."""
Noted = Callable[[str], object]


class Found(NamedTuple):
    """A mesh.   name: its path below the batch."""

    mesh: Path
    name: str
    options: Options
    outputs: Outputs


def assets_of(places: Iterable[Path], output: Path, options: Options, outputs: Outputs, note: Noted) -> list[Found]:
    """The meshes of folders (and those in them), lists and single files, each once.  As `jobs.find_jobs`."""
    found: dict[Path, Found] = {}
    for place in places:
        if place.suffix.lower() in LISTS:
            found |= {asset.mesh: asset for asset in _listed(place, options, outputs)}
        else:
            names = _in_folder(place, output, note) if place.is_dir() else _single(place)
            found |= {mesh: Found(mesh, name, options, outputs) for mesh, name in names.items()}
    return told_apart(list(found.values()))


def told_apart(assets: list[Found]) -> list[Found]:
    """Assets of one name, as from two folders, get the folders above into it that tell them apart."""
    while len({asset.name for asset in assets}) < len(assets):
        times = Counter(asset.name for asset in assets)
        assets = [asset if times[asset.name] == 1 else _longer(asset) for asset in assets]
    return assets


def _longer(asset: Found) -> Found:
    """The asset with another of the folders above in its name."""
    parts = Path(os.path.normpath(asset.mesh)).parts[1:]
    return asset._replace(name="/".join(parts[-len(Path(asset.name).parts) - 1 :]))


def _single(place: Path) -> dict[Path, str]:
    if not place.exists():
        raise MissingFileError(f"{place} is not there, expected a folder, a mesh or a .jsonl list; correct the path")
    return {place.absolute(): place.name}


def _in_folder(place: Path, output: Path, note: Noted) -> dict[Path, str]:
    """The meshes of a folder, each with its name below it; what is hidden, or a result, is none."""
    own = _below(place, output)
    every = [file for file in sorted(place.rglob("*")) if own is None or own not in file.parents]
    every = [file for file in every if not any(part.startswith(".") for part in file.relative_to(place).parts)]
    files = [file for file in every if file.suffix.lower() in ENDINGS and file.is_file()]
    others = Counter(file.suffix.lower() for file in every if file.suffix.lower().lstrip(".") in CONVERTED)
    for ending, count in others.items():
        note(f"{place}: {count} {ending} passed over; {CONVERTED[ending.lstrip('.')]}")
    results = {folder: written_in(folder) for folder in {file.parent for file in files}}
    sources = [file for file in files if file.name not in results[file.parent]]
    if len(sources) < len(files):
        count = len(files) - len(sources)
        note(f"{place}: {count} meshes are results of flexpara by the reports beside them, and passed over")
    if not sources:
        found = "no mesh but results of flexpara" if files else "no mesh"
        raise MissingFileError(f"{place} holds {found}, expected files such as {', '.join(ENDINGS)}; name a folder")
    return {file.absolute(): file.relative_to(place).as_posix() for file in sources}


def _below(place: Path, output: Path) -> Path | None:
    """The output folder as it is named below another, however both were named; None where it lies elsewhere."""
    whole, inner = place.resolve(), output.resolve()
    return place / inner.relative_to(whole) if whole in inner.parents else None


def _listed(path: Path, options: Options, outputs: Outputs) -> list[Found]:
    if not path.is_file():
        raise MissingFileError(f"{path} is not there, expected a list of assets; correct the path")
    found = []
    with path.open("rb") as file:
        for number, line in enumerate(iter(lambda: file.readline(LARGEST_LINE), b""), 1):
            if line.strip():
                name, own = _entry(line, f"{path}, line {number}")
                mesh = (path.parent / name).absolute()
                below = Path(name).is_absolute() or ".." in Path(name).parts
                chosen = _with(own, options, outputs, path.parent)
                found.append(Found(mesh, mesh.name if below else Path(name).as_posix(), *chosen))
    return found


def _entry(line: bytes, place: str) -> tuple[str, dict[str, Any]]:
    expected = 'expected {"file": NAME, "options": {…}}; correct the line'
    try:
        entry = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{place} is no JSON ({error}), {expected}") from error
    if not isinstance(entry, dict) or not isinstance(entry.get("file"), str) or not entry["file"]:
        raise InputError(f"{place} names no file, {expected}")
    own = entry.get("options", {})
    if not isinstance(own, dict):
        raise InputError(f"{place} has options that are no object, {expected}")
    return entry["file"], own


def _with(own: dict[str, Any], options: Options, outputs: Outputs, folder: Path) -> tuple[Options, Outputs]:
    """The options of a line; files in them count from the folder of the list."""
    of_outputs = {field.name for field in fields(Outputs)}
    files = {name: value for name, value in own.items() if name in of_outputs}
    rest = {name: value for name, value in own.items() if name not in of_outputs}
    options, outputs = from_keywords(Options, options, rest), from_keywords(Outputs, outputs, files)
    return rebased(options, rest, folder), rebased(outputs, files, folder)

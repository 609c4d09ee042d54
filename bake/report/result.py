"""One result as the report shows it: a mesh with uv, what was measured, its pictures, how long it took."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from ...runtime.errors import InputError
from ...runtime.geometry.metrics import measure
from ...runtime.io.asset.changes import told
from ...runtime.pagesize import PageSize
from .pictures import picture_file
from .shape import FaceFacts, Shape, face_facts
from .words import number_of

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

BEFORE = "before"
"""How the uv that a mesh came with are called."""
MOST_PICTURES = 40


@dataclass(frozen=True, eq=False)
class Result:
    """One result.

    title: what it is called.  mesh: results of the same word have the same faces in the same order.
    metrics, seconds: name → number.  pictures: map → data address.  notes: sentences.  page: its size, where it is
    known.
    """

    title: str
    shape: Shape
    facts: FaceFacts
    mesh: str
    metrics: Mapping[str, Any]
    seconds: Mapping[str, float] = field(default_factory=dict)
    pictures: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    page: PageSize | None = None


def measured(title: str, shape: Shape, mesh: str, page: PageSize | None = None) -> Result:
    """A layout of which nothing is known but itself, measured.  Raises: InputError as `metrics.measure`."""
    shape = shape if page is None else replace(shape, extent=page.extent)
    metrics = measure(shape.surface, shape.corner_uv, size=None if page is None else page.stored).to_dict()
    return Result(title, shape, face_facts(shape), mesh, metrics, page=page)


def page_in(value: object) -> PageSize | None:
    """The size that a report names, which may be anything; None for what is none."""
    try:
        page = PageSize.of(value if isinstance(value, str) else int(number_of(value) or 0))
    except InputError:
        return None
    return page if page.is_possible else None


def reported(title: str, shape: Shape, report: Mapping[str, Any], folder: Path, picture_size: int) -> Result:
    """A layout with the report that was written of it, which may hold anything.

    folder: where the pictures lie that it names.
    Raises: InputError as `metrics.measure`.
    """
    settings, source = part(report, "settings"), part(report, "source")
    page = page_in(settings.get("size"))
    fresh = measured(title, shape, f"{source.get('sha256')} {len(shape.faces)}", page)
    pictures, notes = _pictures(part(part(report, "textures"), "files"), folder, picture_size)
    return Result(
        title,
        fresh.shape,
        fresh.facts,
        fresh.mesh,
        {**numbers(part(report, "network")), **fresh.metrics},
        {name: value for name, value in numbers(part(report, "seconds")).items() if value >= 0.0},
        pictures,
        (*_said(report), *notes),
        page,
    )


def part(report: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """A section of a report, empty where it is absent or something else."""
    found = report.get(name)
    return found if isinstance(found, dict) else {}


def numbers(section: Mapping[str, Any]) -> dict[str, float]:
    """The finite numbers of a section."""
    found = {str(name): number_of(value) for name, value in section.items()}
    return {name: value for name, value in found.items() if value is not None}


def _said(report: Mapping[str, Any]) -> list[str]:
    """What the run told its user, and what cleaning changed."""
    changes = {str(name): value for name, value in part(report, "changes").items() if isinstance(value, int)}
    notes = part(report, "train").get("notes")
    said = [note for note in notes if isinstance(note, str)] if isinstance(notes, list) else []
    return [*said, *told(changes)]


def _pictures(files: Mapping[str, Any], folder: Path, size: int) -> tuple[dict[str, str], list[str]]:
    """Map → data address, and a sentence for each that can't be shown."""
    pictures, notes = dict[str, str](), list[str]()
    for name, file in list(files.items())[:MOST_PICTURES]:
        try:
            pictures[str(name)] = picture_file(folder, str(file), size)
        except InputError as error:
            notes.append(f"The map {name} is not shown: {error}.")
    return pictures, notes

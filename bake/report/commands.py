"""The command that makes a report.  Options in, one call, a file out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from ...runtime.cli.console import Console, Manners
from ...runtime.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

MARK = b'<meta name="generator" content="flexpara'
"""Stands near the top of every report: such a file may be replaced."""
SEVERAL = "results"
"""Base name of the report of a folder's results."""


def report(
    *result: Path,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    console: Manners = Console(),
) -> int:
    """Make one HTML file of results: the model to turn around beside its uv, with all that was measured.

    It opens in a browser without network. Several results are compared side by side.

    Args:
        result: Output folders of unwrap, STEM.report.json files in them, or meshes with uv of any tool.
        output: The file to write; by default STEM.report.html in the folder, or
            results.report.html where it holds several.
        console: See Console.
    """
    from ...runtime.files import write_whole
    from .gather import results_in
    from .page import write_page
    from .result import BEFORE

    if not result:
        raise InputError("RESULT is missing, expected an output folder of unwrap; see flexpara report --help")
    results = results_in(result)
    shown = [entry.title for entry in results if entry.title != BEFORE] or [entry.title for entry in results]
    title = " · ".join(shown)
    if output is None:
        output = folder_of(result) / f"{title if len(shown) == 1 else SEVERAL}.report.html"
    own = output.is_file() and MARK in output.read_bytes()[:1000]
    written = write_whole(output, lambda path: write_page(results, title, path), force=console.force or own)
    console.show({}, [written])
    return 0


def folder_of(named: Sequence[Path]) -> Path:
    """The one output folder that was named, or that of the report that was.

    Raises: InputError where there are several, or a mesh that lies in no such folder.
    """
    from .gather import REPORT

    first = named[0]
    if len(named) > 1 or not (first.is_dir() or first.name.endswith(REPORT)):
        found = f"no output for {', '.join(map(str, named))}"
        raise InputError(f"{found}, expected a file for the comparison; pass for instance -o compare.html")
    return first if first.is_dir() else first.parent

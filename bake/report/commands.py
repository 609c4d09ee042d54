"""The command that makes a report.  Options in, one call, a file out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ...runtime.console import Console, Manners
from ...runtime.errors import InputError

MARK = b'<meta name="generator" content="flexpara'
"""Stands near the top of every report: such a file may be replaced."""


def report(
    *result: Path,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    console: Manners = Console(),
) -> int:
    """Make one HTML file of results: the model to turn around beside its uv, with all that was measured.

    It opens in a browser without network. Several results are compared side by side.

    Args:
        result: Output folders of unwrap, STEM.report.json files in them, or meshes with uv of any tool.
        output: The file to write; by default STEM.report.html in the folder, where there is one result.
        console: See Console.
    """
    from ...runtime.files import write_whole
    from .gather import REPORT, results_in
    from .page import write_page

    if not result:
        raise InputError("RESULT is missing, expected an output folder of unwrap; see flexpara report --help")
    results = results_in(result)
    main = results[-1].title
    if output is None:
        if len(result) > 1 or len(results) > 2 or not (result[0].is_dir() or result[0].name.endswith(REPORT)):
            found = f"no output for {', '.join(map(str, result))}"
            raise InputError(f"{found}, expected a file for the comparison; pass for instance -o compare.html")
        output = (result[0] if result[0].is_dir() else result[0].parent) / f"{main}.report.html"
    title = main if len(result) == 1 else " · ".join(entry.title for entry in results)
    own = output.is_file() and MARK in output.read_bytes()[:1000]
    written = write_whole(output, lambda path: write_page(results, title, path), force=console.force or own)
    console.show({}, [written])
    return 0

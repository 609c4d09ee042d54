"""What the command line says on stderr beside errors: notes, one a line, and none when quiet."""

from __future__ import annotations

import warnings
from contextlib import nullcontext

import pytest

from flexpara.runtime.cli.console import Console


def test_notes_of_a_report_are_said_one_a_line_unless_quiet(capsys: pytest.CaptureFixture[str]) -> None:
    report = {"notes": ["12 charts were needed", "a slit was made"], "objective": 1.0}
    Console().notes(report)
    assert capsys.readouterr().err == "flexpara: note: 12 charts were needed\nflexpara: note: a slit was made\n"
    Console(quiet=True).notes(report)
    Console().notes({})
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("quiet", [False, True])
def test_a_warning_of_ours_is_a_note_and_nothing_when_quiet(quiet: bool, capsys: pytest.CaptureFixture[str]) -> None:
    class OurWarning(UserWarning):
        __module__ = "flexpara.bake"

    with pytest.warns(match="of a library") if not quiet else nullcontext(), Console(quiet=quiet).progress():
        if not quiet:
            warnings.simplefilter("always")
        warnings.warn("drawn by numpy", OurWarning, stacklevel=1)
        warnings.warn("of a library", RuntimeWarning, stacklevel=1)
    assert capsys.readouterr().err == ("" if quiet else "flexpara: note: drawn by numpy\n")

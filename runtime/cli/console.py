"""What the command line says.  Results go to stdout; progress, notes and complaints go to stderr."""

from __future__ import annotations

import sys
import warnings
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from ..errors import InputError
from ..extras import PACKAGE
from ..options.unwrap import Flag
from ..process.progress import progress_bars, progress_lines

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from ..io.points.cloud import PointCloud
    from ..mesh import Asset
    from ..process.progress import Progress

SUMMARY = {
    "page": "{}",
    "connected_parts": "{}",
    "charts": "{}",
    "symmetric_dirichlet_mean": "{:.4f}",
    "isometric_mean": "{:.5f}",
    "conformal_mean": "{:.4f}",
    "seam_length": "{:.2f}",
    "flipped_faces": "{}",
    "overlap_fraction": "{:.2g}",
    "packing_efficiency": "{:.1%}",
    "rms_texels": "{:.2f}",
    "chart_agreement": "{:.2%}",
    "missed_share": "{:.2%}",
}


@dataclass(frozen=True, kw_only=True)
class Console:
    """How a command behaves towards the user and the files that lie there."""

    progress_lines: Flag = False
    """Print progress as lines "flexpara: progress: STAGE STEP/STEPS" on stderr, for programs, in place of bars."""
    quiet: Flag = False
    """Print neither progress nor notes nor a summary; errors are still printed."""
    force: Flag = False
    """Overwrite files that flexpara did not write."""
    strict: Flag = False
    """End with an error, before the work, where something in the file would be lost or changed."""

    def show(self, numbers: dict[str, Any], files: Sequence[Path]) -> None:
        """The summary on stdout, one figure a line, then the files; nothing when quiet."""
        if not self.quiet:
            show(numbers, files)

    def note_changes(self, source: Asset | PointCloud, lost: Mapping[str, int] | None = None) -> None:
        """A note for each thing that could not be read as it was, or that is not in what will be written (lost).

        Raises: InputError that names them all, when strict.
        """
        from ..io.asset.changes import told

        self.demand_none(source.stem, told({**source.changes, **(lost or {})}))

    def demand_none(self, stem: str, facts: Sequence[str]) -> None:
        """A note for each fact about a file that the user might not expect.

        Raises: InputError that names them all, when strict.
        """
        if self.strict and facts:
            raise InputError(f"{stem}: {'; '.join(facts)}; expected nothing of the kind, as asked: leave --strict out")
        for fact in facts:
            self.note(f"{stem}: {fact}")

    def note(self, fact: str) -> None:
        """One line on stderr about something that the user should know and need not act on; nothing when quiet."""
        if not self.quiet:
            sys.stderr.write(f"flexpara: note: {' '.join(fact.split())}\n")

    def notes(self, report: Mapping[str, Any]) -> None:
        """The sentences under "notes" of a stage's report: what it did that the user may not expect."""
        for fact in report.get("notes", ()):
            self.note(str(fact))

    def figures(self, reports: Sequence[Mapping[str, Any]], *, shown: bool) -> None:
        """The notes of the report of each atlas; shown: its figures too."""
        for report in reports:
            self.notes(report["train"])
            if shown:
                page = {"page": report["source"]["stem"]} if len(reports) > 1 else {}
                page |= {"connected_parts": parts} if (parts := report["changes"].get("components")) else {}
                self.show({**page, **report["metrics"], **report["network"]}, ())

    @contextmanager
    def progress(self) -> Iterator[Progress | None]:
        """Around work: its progress bars, and warnings of ours as notes; when quiet no bars and no warnings at all."""
        with progress_bars(quiet=self.quiet) as progress, warnings.catch_warnings():
            if self.quiet:
                warnings.simplefilter("ignore")
            shown = warnings.showwarning

            def show_warning(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
                if category.__module__.partition(".")[0] == PACKAGE:
                    self.note(str(message))
                else:
                    shown(message, category, *place, **more)

            warnings.showwarning = show_warning
            yield progress_lines if self.progress_lines else progress


Manners = Annotated[Console, Parameter(name="*")]
"""The same as options of a command."""


def complain(message: str, code: int) -> int:
    """One line on stderr; returns the code."""
    sys.stderr.write(f"flexpara: error: {' '.join(message.split())}\n")
    return code


def show(numbers: dict[str, Any], files: Sequence[Path]) -> None:
    """The summary on stdout: one figure a line, then the files."""
    lines = [
        f"{name.replace('_', ' '):<26} {form.format(numbers[name])}"
        for name, form in SUMMARY.items()
        if name in numbers
    ]
    sys.stdout.write("".join(f"{line}\n" for line in (*lines, *map(str, files))))

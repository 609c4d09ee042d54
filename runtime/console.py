"""What the command line says, and types its commands share.  Results go to stdout, complaints to stderr."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

SUMMARY = {
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

Output = Annotated[Path, Parameter(name=["--output", "-o"])]
Flag = Annotated[bool, Parameter(negative="")]


def complain(message: str, code: int) -> int:
    """One line on stderr."""
    sys.stderr.write(f"flexpara: error: {' '.join(message.split())}\n")
    return code


def names(text: str) -> tuple[str, ...]:
    """Comma-separated words; "none" is no word."""
    return () if text == "none" else tuple(word.strip() for word in text.split(",") if word.strip())


def show(numbers: dict[str, Any], files: Sequence[Path]) -> None:
    """The summary on stdout: one figure a line, then the files."""
    lines = [
        f"{name.replace('_', ' '):<26} {form.format(numbers[name])}"
        for name, form in SUMMARY.items()
        if name in numbers
    ]
    sys.stdout.write("".join(f"{line}\n" for line in (*lines, *map(str, files))))

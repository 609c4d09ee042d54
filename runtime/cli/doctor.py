"""What is installed on this machine, and how to install what is missing."""

from __future__ import annotations

import os
import platform
import re
import sys
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

from ... import __version__
from ..extras import PACKAGE

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

USER_EXTRAS = ("", "train", "bake", "samples", "formats", "denoise")
INSTRUCTION_SETS = ("avx2", "fma", "avx512f", "avx512_bf16", "amx_bf16", "asimd", "bf16")


@dataclass(frozen=True)
class Finding:
    """name: what was looked for.  found: what there is, or why not.  remedy: empty when nothing is missing."""

    name: str
    found: str
    remedy: str = ""

    def __str__(self) -> str:
        """One line: mark, name, what was found, remedy."""
        mark, arrow = ("✗", " → ") if self.remedy else ("✓", "")
        return f"{mark} {self.name:<15} {' '.join(self.found.split())}{arrow}{self.remedy}"


def packages() -> Iterator[Finding]:
    """This package and everything that its extras for users ask for, as its metadata lists them."""
    yield Finding(PACKAGE, f"{__version__} on Python {sys.version.split()[0]}")
    listed = {PACKAGE}
    for requirement in metadata.requires(PACKAGE) or []:
        name = re.split(r"[^\w.-]", requirement)[0]
        extra = "".join(re.findall(r"extra == \"(\w+)\"", requirement))
        if extra not in USER_EXTRAS or name in listed:
            continue
        listed.add(name)
        try:
            yield Finding(name, metadata.version(name))
        except metadata.PackageNotFoundError:
            yield Finding(name, "absent", f'pip install "{PACKAGE}[{extra}]"' if extra else f"pip install {PACKAGE}")


def cpu() -> str:
    """Architecture, cores, and the instruction sets that training and onnxruntime gain from."""
    info = Path("/proc/cpuinfo")
    words = set(info.read_text(encoding="utf-8").split()) if info.exists() else set[str]()
    return " ".join(
        [platform.machine(), f"{os.cpu_count()} cores", *(name for name in INSTRUCTION_SETS if name in words)]
    )


def onnx_providers() -> str:
    """Execution providers of the installed onnxruntime."""
    import onnxruntime

    return ", ".join(onnxruntime.get_available_providers())


def probe(name: str, look: Callable[[], str], remedy: str) -> Finding:
    """What ``look`` finds; an ImportError or OSError that it raises is the finding, with the remedy."""
    try:
        return Finding(name, look())
    except (ImportError, OSError) as error:
        return Finding(name, str(error), remedy)

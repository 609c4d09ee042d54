"""Modules that are found by a second name: `flexpara.xatlas` is `flexpara.export.dropin.xatlas`.

A file xatlas.py beside `__init__.py` would take the place of the real xatlas wherever Python runs in this folder.
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import ModuleType

PACKAGE = __name__.removesuffix(".runtime.aliases")
HOMES = {f"{PACKAGE}.xatlas": f"{PACKAGE}.export.dropin.xatlas"}


class SameModule(Loader):
    """Gives the module of another name as it is."""

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """The module, loaded under its own name."""
        module = import_module(HOMES[spec.name])
        self.own = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Nothing is left to run; the import system took the module's own specification, which comes back."""
        module.__spec__ = self.own


class SecondNames(MetaPathFinder):
    """Finds the names of HOMES, and no others."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The specification of a second name; None for any other."""
        del path, target
        return ModuleSpec(fullname, SameModule()) if fullname in HOMES else None


sys.meta_path.append(SecondNames())

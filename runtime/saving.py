"""Results that are written as files: the ways into an output folder that all of them share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

    from .files import OutputFolder
    from .mesh import Asset
    from .options.unwrap import Outputs
    from .process.progress import Progress


Wanted = TypeVar("Wanted", bound="Outputs")


class Saving(ABC, Generic[Wanted]):
    """What an unwrap or packing gives back.   asset: whose stem the files have."""

    asset: Asset

    def save(
        self,
        folder: str | Path,
        outputs: Wanted | None = None,
        *,
        force: bool = False,
        progress: Progress | None = None,
        **keywords: Any,
    ) -> tuple[Path, ...]:
        """Write mesh, ONNX file, textures, preview and report, all or none; returns their paths.

        Args:
            folder: made where it is absent.
            outputs: what is written, see `flexpara.Outputs` and `PackOutputs`; None: its defaults.
            force: whether files are overwritten that flexpara did not write.
            progress: as for `unwrap`.
            **keywords: fields of it, in place of those of outputs: maps=("normal",), preview=False, …

        Raises:
            InputError: an unknown map, format, target or keyword.
            ForeignFileError: a file is in the way that flexpara did not write, and force is off.
            MissingDependencyError: the packages of flexpara[bake] are absent.
        """
        from .files import OutputFolder
        from .options.keywords import from_keywords

        outputs = from_keywords(self.outputs_kind(), outputs, keywords)
        with OutputFolder(Path(folder), self.asset.stem, force=force) as output:
            return self.write(output, outputs, progress)

    @abstractmethod
    def outputs_kind(self) -> type[Wanted]:
        """The class of options that say what is written."""

    @abstractmethod
    def write(
        self,
        output: OutputFolder,
        outputs: Wanted,
        progress: Progress | None = None,
        note: Callable[[str], None] | None = None,
    ) -> tuple[Path, ...]:
        """As `save`, into an open OutputFolder.  note: called with each fact of the result that a user should know."""


class Unwrapping(Saving["Outputs"]):
    """What an unwrap gives back."""

    def __repr__(self) -> str:
        pages = [facts["metrics"] for facts in self.reports]
        told = ", ".join(
            f"{page['charts']} charts of mean stretch {page['symmetric_dirichlet_mean']:.4f}" for page in pages
        )
        return f"{type(self).__name__}({self.asset.stem!r}, {len(self.asset.faces)} faces: {told})"

    @property
    @abstractmethod
    def reports(self) -> list[dict[str, Any]]:
        """The report of each atlas."""

    def outputs_kind(self) -> type[Outputs]:
        """Those of unwrapping."""
        from .options.unwrap import Outputs

        return Outputs

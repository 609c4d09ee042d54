"""What is written of a mesh with several atlases: pages of one scene, or UDIM tiles of one layout."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from .pages import check_pages, page_jobs, page_notes, write_pages
from .tiles import tile_notes, tiled_job, write_tiles

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from ...runtime.files import OutputFolder
    from ...runtime.mesh import Asset, Atlas
    from ...runtime.options.unwrap import Outputs
    from ...runtime.process.progress import Clock
    from .output import BakeJob


@dataclass(frozen=True, eq=False)
class Several:
    """A mesh, the page (f,) of each face where pages are tiles, and each page with its atlas.   seed: of rays."""

    asset: Asset
    tile: NDArray[np.int64] | None
    pages: Sequence[tuple[Asset, Atlas]]
    outputs: Outputs
    seed: int

    def jobs(self, output: OutputFolder) -> list[BakeJob]:
        """What is baked and written: of each page, or of all of them as tiles.  Raises: as `pages.check_pages`."""
        if self.tile is not None:
            return [tiled_job(self.asset, self.tile, [atlas for _, atlas in self.pages], self.outputs, self.seed)]
        check_pages(output, self.outputs, [asset for asset, _ in self.pages])
        return page_jobs(self.outputs, self.pages, self.seed)

    def write(
        self,
        output: OutputFolder,
        jobs: Sequence[BakeJob],
        clock: Clock,
        note: Callable[[str], None],
        *,
        apart: bool = False,
    ) -> dict[str, Any]:
        """What the report says of the files.  note: told what a user should know.  apart: as for `write_pages`."""
        if self.tile is None:
            facts = write_pages(output, jobs, clock, apart=apart)
            notes = page_notes(facts)
        else:
            facts = write_tiles(output, jobs[0], jobs, clock)
            notes = tile_notes(facts, self.asset.stem)
        for fact in notes:
            note(fact)
        return facts

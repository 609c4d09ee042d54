"""Meshes whose islands got a page of their own, and the files that are written of them.   f faces."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import __version__
from ...runtime.errors import InputError
from ...runtime.geometry.metrics import measure
from ...runtime.geometry.triangles import signed_areas
from ...runtime.options.keywords import from_keywords
from ...runtime.options.pack import PackOptions, PackOutputs
from ...runtime.pack.repack import repack, repack_pages
from ...runtime.pack.square import square_of
from ...runtime.process.progress import Clock
from ...runtime.saving import Saving
from ..checks import check_outputs, chosen_maps
from ..highpoly.highmesh import merge_assets
from ..results.output import BakeJob, packing_notes, texture_notes, with_cut, write_outputs

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from ...runtime.files import OutputFolder
    from ...runtime.io.meshfile import MeshLike
    from ...runtime.mesh import Asset, Atlas
    from ...runtime.process.progress import Progress

TOGETHER = "packed"
"""Name of the textures and the report of several meshes on one page."""


@dataclass(frozen=True, eq=False)
class PackResult(Saving[PackOutputs]):
    """Meshes whose islands share a page.

    assets: the meshes as read and cleaned.  suffixes: endings of their files.  asset: all of them as one mesh.
    atlas: its islands in their new places; of several pages, each in its UDIM tile.  page: (f,) that of each face,
    None where one page is all.  report: changes, settings, metrics; ready for JSON.
    """

    assets: tuple[Asset, ...]
    suffixes: tuple[str, ...]
    asset: Asset = field(repr=False)
    atlas: Atlas = field(repr=False)
    report: dict[str, Any] = field(repr=False)
    page: NDArray[np.int64] | None = field(default=None, repr=False)

    @property
    def atlases(self) -> list[Atlas]:
        """The atlas of each mesh."""
        return parted(self.atlas, self.assets)

    def outputs_kind(self) -> type[PackOutputs]:
        """Those of packing."""
        return PackOutputs

    def jobs(self, outputs: PackOutputs) -> tuple[BakeJob, list[BakeJob]]:
        """What is baked, all meshes as one, and what is written: each mesh for itself, with the same maps.

        Raises: as `Outputs.for_asset`, `chosen_maps`.
        """
        shared = outputs.for_mesh(self.asset, self.suffixes[0])
        maps = chosen_maps(shared, seed=self.report["settings"]["seed"])
        whole = BakeJob.of(self.atlas, self.asset, shared, maps)
        each = zip(parted(whole.atlas, self.assets), self.assets, self.suffixes, strict=True)
        return whole, [
            BakeJob(atlas, asset, replace(outputs.for_mesh(asset, ending), maps=shared.maps), maps)
            for atlas, asset, ending in each
        ]

    def with_losses(self, outputs: PackOutputs) -> PackResult:
        """With what the meshes hold and their outputs do not among the report's changes."""
        from ...runtime.io.asset.changes import lost

        each = zip(self.assets, self.suffixes, strict=True)
        changes = [self.report["changes"], *(lost(asset, outputs.for_mesh(asset, ending)) for asset, ending in each)]
        return replace(self, report={**self.report, "changes": summed(changes)})

    def write(
        self,
        output: OutputFolder,
        outputs: PackOutputs,
        progress: Progress | None = None,
        note: Callable[[str], None] | None = None,
    ) -> tuple[Path, ...]:
        """As `save`, into an open OutputFolder.  note: called with each fact that a user should know."""
        from ...runtime.io.asset.changes import told
        from .pages import write_on_pages, write_on_tiles

        clock, say, told_of = Clock.of(progress), note or (lambda _: None), self.with_losses(outputs)
        if self.page is not None:
            write = write_on_tiles if self.report["settings"]["udim"] else write_on_pages
            output.write_report({**write(told_of, output, outputs, clock, say), "seconds": clock.rounded})
            return output.commit()
        whole, pieces = self.jobs(outputs)
        named = [f"{piece.asset.stem}.{kind}" for piece in pieces for kind in piece.outputs.formats]
        check_outputs(output, whole.outputs, whole.maps, meshes=False, more=named)
        apart = self.report["metrics"]["overlap_fraction"] == 0.0
        report = {**told_of.report, "outputs": whole.outputs.facts()}
        report |= write_outputs(output, whole, clock, apart=apart, pieces=pieces)
        cut = told({"polygons_cut": report["polygons_cut"]})
        for fact in (*cut, *packing_notes(self.report["pack"]), *texture_notes(report["textures"])):
            say(f"{self.asset.stem}: {fact}")
        output.write_report({**with_cut(report), "seconds": clock.rounded})
        return output.commit()


def pack(
    *mesh: MeshLike, options: PackOptions | None = None, progress: Progress | None = None, **keywords: Any
) -> PackResult:
    """Pack the islands of uv that meshes have into one page; their shapes stay.

    Args:
        *mesh: paths, or trimesh.Trimesh with uv.
        options: what decides the result, see `flexpara.PackOptions`; None: its defaults.
        progress: called as progress(stage, step, steps, loss).
        **keywords: fields of `flexpara.PackOptions`, in place of those of options: size=2048, padding=4, …

    Raises:
        InputError: a mesh or an option is wrong, or a mesh has no uv.
    """
    from ...runtime.io.asset.shading import shaded
    from ...runtime.io.meshfile import load

    options = from_keywords(PackOptions, options, keywords)
    assets = [shaded(load(entry, options.select), options.crease_angle) for entry in mesh]
    endings = [options.ending(Path(entry).suffix) if isinstance(entry, str | Path) else ".glb" for entry in mesh]
    return pack_assets(assets, endings, options, None, Clock.of(progress))


def pack_assets(
    assets: Sequence[Asset], suffixes: Sequence[str], options: PackOptions, uv_set: int | None, clock: Clock
) -> PackResult:
    """Pack the islands of some meshes into one page.

    Args:
        assets: the meshes.
        suffixes: endings of their files.
        options: see `PackOptions`.
        uv_set: the uv set whose islands are packed; None is the one that materials are read with.
        clock: for progress.

    Raises: as `repack`; InputError for two meshes of one name.
    """
    stems = [asset.stem for asset in assets]
    if len(set(stems)) < len(stems) or (len(stems) > 1 and TOGETHER in stems):
        raise InputError(f"meshes named {', '.join(stems)}, expected names of their own; rename one")
    assets = [asset if uv_set is None else _with_set(asset, uv_set) for asset in assets]
    whole = merge_assets(assets)
    whole = whole if len(assets) == 1 else replace(whole, stem=TOGETHER)
    with clock.stage("pack"):
        equal, page = options.density == "equal", None
        if options.udim or options.pages > 1:
            square = square_of(options)
            packed, page = repack_pages(whole, square, options.pages, equal=equal, seed=options.seed)
        else:
            packed = repack(whole, square_of(options), equal=equal, seed=options.seed)
    with clock.stage("measure"):
        atlas = packed.atlas
        metrics = measure(whole.surface, atlas.corner_uv, atlas.face_chart, size=options.size, stack=atlas.face_stack)
    changes = [asset.changes for asset in assets] + [packed.report["changes"]]
    report = {
        "version": __version__,
        "sources": [{"stem": one.stem, "sha256": one.sha256, "faces": len(one.faces)} for one in assets],
        "changes": summed(changes),
        "settings": {**asdict(options), "padding": packed.atlas.padding},
        "pack": packed.report,
        "metrics": {**metrics.to_dict(), **({} if page is None else _of_pages(packed.atlas, int(page.max()) + 1))},
    }
    return PackResult(tuple(assets), tuple(suffixes), whole, packed.atlas, report, page)


def summed(changes: Sequence[Mapping[str, int]]) -> dict[str, int]:
    """Counts of several meshes as those of all together."""
    return {name: sum(one.get(name, 0) for one in changes) for one in changes for name in one if one[name]}


def _of_pages(atlas: Atlas, count: int) -> dict[str, Any]:
    """What the metrics of one page are of several: the share of all of them that is used."""
    used = float(np.abs(signed_areas(atlas.corner_uv)).sum())
    return {"packing_efficiency": used / count, "packing_square": "unit", "pages": count}


def _with_set(asset: Asset, number: int) -> Asset:
    """The mesh with one of its uv sets as its uv.  Raises: InputError where it has none."""
    from ...runtime.io.gltf.uvsets import uv_of_set

    return replace(asset, uv=uv_of_set(asset, number))


def parted(atlas: Atlas, assets: Sequence[Asset]) -> list[Atlas]:
    """The atlas of each of the meshes that were joined to the mesh of an atlas."""
    if len(assets) == 1:
        return [atlas]
    face = np.cumsum([0, *(len(asset.faces) for asset in assets)])
    first = np.cumsum([0, *(len(asset.positions) for asset in assets)])
    found = []
    for number in range(len(assets)):
        own = slice(face[number], face[number + 1])
        used, corners = np.unique(atlas.faces[own], return_inverse=True)
        part = replace(
            atlas,
            positions=atlas.positions[used],
            faces=corners.reshape(-1, 3).astype(np.int64),
            uv=atlas.uv[used],
            normals=atlas.normals[used],
            face_chart=atlas.face_chart[own],
            source_vertex=atlas.source_vertex[used] - first[number],
        )
        found.append(part)
    return found

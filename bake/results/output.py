"""What a run writes: textures, meshes and the preview, into an OutputFolder.   sizes in texels.

OpenGL and image libraries are imported when something needs them: an obj file alone does without.
"""

from __future__ import annotations

import tempfile
import warnings
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...runtime.errors import MissingDependencyError
from ...runtime.io.asset.changes import told
from ...runtime.io.loops import loops_of
from ...runtime.options.unwrap import POLYGONS
from ..checks import exr_settings
from .meshes import MeshJob, write_meshes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from ...runtime.files import OutputFolder
    from ...runtime.mesh import Asset, Atlas
    from ...runtime.options.unwrap import Outputs
    from ...runtime.process.progress import Clock
    from ..bakemap import BakeMap
    from ..settings import BakeSettings
    from ..texture import Texture

LARGE = 8192
"""Side from which images are kept on disk while they are baked."""


@dataclass(frozen=True, eq=False)
class Baked:
    """Textures by map, and their files: product (a map, or a packed file of a target) → file name."""

    textures: dict[str, Texture]
    files: dict[str, str]


@dataclass(frozen=True, eq=False)
class BakeJob:
    """What is baked and written: maps of an asset over an atlas.  outputs: without "auto".  atlas: as it is written."""

    atlas: Atlas
    asset: Asset
    outputs: Outputs
    maps: Sequence[BakeMap]

    @classmethod
    def of(cls, atlas: Atlas, asset: Asset, outputs: Outputs, maps: Sequence[BakeMap]) -> BakeJob:
        """With each vertex of the atlas in one tangent group, where a map is in tangent space."""
        return cls(with_tangents(atlas, maps), asset, outputs, maps)


def write_outputs(
    output: OutputFolder, job: BakeJob, clock: Clock, *, apart: bool = False, pieces: Sequence[BakeJob] = ()
) -> dict[str, Any]:
    """Textures, meshes in each format, preview; for the report what is known of "textures", and "written" of meshes.

    apart: whether no two triangles of the atlas are known to overlap in uv.  pieces: the meshes that the job's is made
    of, where they are files of their own with one set of textures.
    Raises: as `baker.bake`; ForeignFileError, InputError as OutputFolder.write.
    """
    baked = bake_textures(output, job, clock)
    with clock.stage("write"):
        written: dict[str, Any] = {}
        for piece in pieces or [job]:
            files = MeshJob(piece.atlas, piece.asset, piece.outputs, baked.textures, baked.files)
            named = f"{piece.asset.stem}." if len(pieces) > 1 else ""
            written |= {f"{named}{kind}": facts for kind, facts in write_meshes(output, files, apart=apart).items()}
    if job.outputs.preview:
        with clock.stage("preview"):
            write_preview(output, job.atlas, job.asset)
    facts = {"textures": texture_facts(job.atlas, baked), "written": written}
    return {**facts, "polygons_cut": polygons_cut(pieces or [job])}


def polygons_cut(pieces: Sequence[BakeJob]) -> int:
    """Polygons that are triangles in files of formats that know polygons."""
    with_polygons = [piece for piece in pieces if set(POLYGONS) & set(piece.outputs.formats)]
    return sum(loops_of(piece.atlas, piece.asset).cut for piece in with_polygons)


def write_reports(output: OutputFolder, job: BakeJob, report: Mapping[str, Any]) -> None:
    """STEM.report.json, and STEM.report.html where it is asked for, once all else is written.

    Raises: InputError where the mesh is too large for one page.
    """
    if job.outputs.report:
        from ..report.gather import write_result

        write_result(output, job.atlas, job.asset, report)
    output.write_report(dict(report))


def with_tangents(atlas: Atlas, maps: Sequence[BakeMap]) -> Atlas:
    """The atlas as it is written: each vertex in one tangent group where a map is in tangent space."""
    if not any(entry.space.startswith("tangent") for entry in maps):
        return atlas
    from ..maps.tangents import split_by_tangents

    return split_by_tangents(atlas)


def bake_textures(output: OutputFolder, job: BakeJob, clock: Clock) -> Baked:
    """Bake the maps, in the atlas' size and padding, and write them."""
    if not job.maps:
        return Baked({}, {})
    from .. import baker

    with baking(clock, len(job.maps)) as begun:
        textures = baker.bake(job.atlas, job.asset, list(job.maps), bake_settings(job), progress=begun)
    return write_baked(output, job, textures, clock)


@contextmanager
def baking(clock: Clock, steps: int) -> Iterator[Callable[[str], None]]:
    """Around the baking of so many images: what is called as each begins."""
    number = count()
    yield lambda _name: clock("bake", next(number), steps)
    clock("bake", steps, steps)


def bake_settings(job: BakeJob) -> BakeSettings:
    """How its maps become images."""
    from ..settings import BakeSettings

    return BakeSettings(
        padding=gutter_of(job.atlas, job.outputs),
        samples=job.outputs.samples,
        denoise=job.outputs.denoise,
        scratch=Path(tempfile.gettempdir()) if job.atlas.page.side >= LARGE else None,
    )


def write_baked(output: OutputFolder, job: BakeJob, textures: dict[str, Texture], clock: Clock) -> Baked:
    """The files of what was baked."""
    if not textures:
        return Baked({}, {})
    with clock.stage("write textures"):
        return Baked(textures, _write_files(output, textures, job.asset, job.outputs))


def gutter_of(atlas: Atlas, outputs: Outputs) -> int | None:
    """Texels filled around charts: None, which is the whole image, unless a background colour was asked for."""
    return None if outputs.background is None else atlas.padding


def _write_files(output: OutputFolder, textures: dict[str, Texture], asset: Asset, outputs: Outputs) -> dict[str, str]:
    """Texture files by product: those of the target, one EXR with layers, or one a map."""
    stem, found = asset.stem, {}
    if outputs.layers:
        from ..files.exr import file_metadata, write_layers

        settings, metadata = exr_settings(outputs), file_metadata(asset, normal_format=outputs.normal_format)
        output.write(f"{stem}.exr", lambda path: write_layers(textures, path, settings, metadata=metadata))
        return dict.fromkeys(textures, f"{stem}.exr")
    if outputs.target is not None:
        from ..files.targets import find_target, write_target

        target = find_target(outputs.target)

        def write(folder: Path) -> None:
            found.update({name: path.name for name, path in write_target(textures, folder, stem, target).items()})

        output.write_several(write)
        return found
    from ..files.textures import texture_names, write_textures

    kind = outputs.texture_format
    output.write_several(lambda folder: write_textures(textures, folder, stem, file_type=kind))
    return texture_names(textures, stem, file_type=kind)


def texture_facts(atlas: Atlas, baked: Baked) -> dict[str, Any]:
    """What the report says of the textures: files, settings, seams, and which maps are the same all over.

    "seam_error" tells how far the two sides of seams differ in each map; "constant" has the value of each map that is
    one, to half a step of 8 bits of its range.
    """
    if not baked.textures:
        return {}
    from ..config import BakeConfig
    from ..seams.seamcheck import seam_report

    constant = {name: constant_value(texture) for name, texture in baked.textures.items()}
    return {
        "files": baked.files,
        "settings": asdict(BakeConfig()),
        "seam_error": seam_report(atlas, baked.textures),
        "constant": {name: value for name, value in constant.items() if value is not None},
    }


def constant_value(texture: Texture) -> list[float] | None:
    """The value of a texture that is the same all over, a number a channel; None for any other."""
    whole = {"[0, 1]": 1.0, "[-1, 1]": 2.0}.get(texture.metadata.get("range", ""), 0.0)
    low, high = texture.pixels.min(axis=(0, 1)), texture.pixels.max(axis=(0, 1))
    return low.tolist() if float((high - low).max()) <= whole * 0.5 / 255.0 else None


def written_notes(written: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """A line for each mesh format whose file holds invalid uv."""
    return [
        f"the {kind} holds {found['flipped']} flipped triangles and {found['overlapping']} pairs that overlap in uv"
        for kind, found in written.items()
        if found["flipped"] or found["overlapping"]
    ]


def with_cut(report: Mapping[str, Any]) -> dict[str, Any]:
    """The report, in which "polygons_cut" is one of the "changes", where any was."""
    plain = {name: value for name, value in report.items() if name != "polygons_cut"}
    cut = {"polygons_cut": report["polygons_cut"]} if report.get("polygons_cut") else {}
    return {**plain, "changes": {**report["changes"], **cut}}


def result_notes(report: Mapping[str, Any]) -> list[str]:
    """What a user should know of what was written: a line each."""
    cut = told({"polygons_cut": report["polygons_cut"]})
    return [*cut, *written_notes(report["written"]), *texture_notes(report["textures"])]


def packing_notes(packing: Mapping[str, Any]) -> list[str]:
    """A line where charts were laid on others, and one where their padding is less than usual."""
    count, padding, usual = (packing.get(name, 0) for name in ("stacked", "padding", "usual_padding"))
    stacked = [f"{count} charts lie on others and share their texels"] if count else []
    less = f"charts are so many or so thin that their padding is {padding} texels, not {usual}"
    return [*stacked, f"{less}; pass --padding, or a larger --size"] if usual else stacked


def texture_notes(facts: Mapping[str, Any]) -> list[str]:
    """What a user should know of the textures: a line for each map that is the same all over."""
    return [
        f"the map {name} is the same all over ({', '.join(f'{number:.3g}' for number in value)}); leave it out"
        for name, value in facts.get("constant", {}).items()
    ]


def bleeding(atlas: Atlas, padding: int | None) -> int:
    """The highest mip level of its textures at which no chart takes in another's texels."""
    from ..baker import chart_labels
    from ..seams.seamcheck import clean_mip

    return clean_mip(chart_labels(atlas, atlas.size, padding), atlas)


def write_preview(output: OutputFolder, atlas: Atlas, asset: Asset) -> None:
    """The preview; without OpenGL a warning in its place."""
    from ..pictures.preview import render_preview
    from ..raster.plan import SoftwareWarning

    try:
        output.write(f"{asset.stem}.preview.png", lambda path: render_preview(atlas, asset, path))
    except MissingDependencyError as error:
        warnings.warn(f"no preview is drawn, since {error}", SoftwareWarning, stacklevel=2)

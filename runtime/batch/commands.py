"""The command that works a folder off.  Options in, jobs out to workers, a manifest and a page."""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from ..cli.console import Console, Manners, complain
from ..errors import InputError
from ..options.batch import BatchOptions
from ..options.unwrap import Options, Outputs
from ..process.named import named
from ..process.progress import progress_lines

if TYPE_CHECKING:
    from .driver import Crew
    from .jobs import Job
    from .manifest import Entry
    from .pool import Limits

WORK = "flexpara.__main__:unwrap_one"
"""What a worker does with a job; named, not imported, as all that unwraps lies above this folder."""
CHECK = "flexpara.bake.checks:ready_for"
"""What refuses options that no asset could be unwrapped with."""
INTERRUPTED = 130


def batch(
    *assets: Path,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    status: Path | None = None,
    batch: Annotated[BatchOptions, Parameter(name="*", group="Batch")] = BatchOptions(),
    options: Annotated[Options, Parameter(name="*", group="Charts and atlas")] = Options(),
    outputs: Annotated[Outputs, Parameter(name="*", group="Maps and files")] = Outputs(),
    console: Manners = Console(),
) -> int:
    """Unwrap all meshes of a folder, and of those in it, each in an output folder of its own.

    The same command again does what is missing: what ended is known by manifest.jsonl in the output folder. An option
    that names a file, as --high, also takes a folder, for the file of each asset's name in it, or a pattern with {stem}
    for that name and {folder} for the asset's folder.

    Args:
        assets: Folders, meshes, or .jsonl lists of {"file": NAME, "options": {…}} with the options of single files.
        output: The folder for the results, manifest.jsonl and index.html, a page of thumbnails.
        status: Print how far the batch of this output folder is, and write its page anew; nothing else.
        batch: See BatchOptions.
        options: See Options.
        outputs: See Outputs.
        console: See Console.
    """
    from .status import status_of, write_page

    if status is not None:
        found = status_of(status)
        write_page(status, found)
        sys.stdout.write("".join(f"{line}\n" for line in found.lines()))
        return 0
    if not assets or output is None:
        missing = "--output" if assets else "ASSETS"
        raise InputError(f"{missing} is missing, expected a folder of meshes and -o; see flexpara batch --help")
    return work_off(assets, output, batch, options, outputs, console)


def work_off(
    assets: tuple[Path, ...], output: Path, batch: BatchOptions, options: Options, outputs: Outputs, console: Console
) -> int:
    """Do what is left to do; the exit code: 0 where all is done, 2 where something failed, 130 where interrupted."""
    from ... import __version__
    from .jobs import find_jobs, shard
    from .lock import locked
    from .manifest import all_entries, left_to_do
    from .status import PAGE, status_of, write_page, write_plan

    named(CHECK)(options, outputs)
    jobs = shard(find_jobs(assets, output, options, outputs, console.note), batch.share)
    jobs = [replace(job, run=replace(job.run, force=console.force, strict=console.strict)) for job in jobs]
    mark = batch.mark
    manifest = output / f"manifest{mark}.jsonl"

    def left() -> list[Job]:
        entries = all_entries(output, manifest)
        found = left_to_do(jobs, entries, __version__, retry=batch.retry_failed)
        share = f" of shard {batch.shard}" if batch.mark else ""
        console.note(f"{len(found)} of {len(jobs)} assets{share} are left to do")
        again = {job.name for job in found}
        given_up = sum(entries[job.name].status == "failed" for job in jobs if job.name not in again)
        if given_up:
            console.note(f"{given_up} failed before and have not changed; add --retry-failed to try them again")
        return found

    if batch.dry_run:
        sys.stdout.write("".join(f"{job.name}{job.problem and f': {job.problem}'}\n" for job in left()))
        return 0
    with locked(output / f".batch{mark}.lock"):
        write_plan(output, mark, jobs)
        whole = done_by_crew(left(), manifest, batch, console)
        write_page(output, status_of(output))
    if not whole:
        console.note("interrupted: what was running is given back; the same command goes on")
        return INTERRUPTED
    last = all_entries(output, manifest)
    failed = sum(last[job.name].status == "failed" for job in jobs if job.name in last)
    console.show({}, [output / PAGE])
    console.note(f"{len(jobs) - failed} of {len(jobs)} assets are done, {failed} failed")
    return 2 if failed else 0


def done_by_crew(jobs: list[Job], manifest: Path, batch: BatchOptions, console: Console) -> bool:
    """Whether all was worked off; each asset is said as it ends, what failed even when quiet."""
    from ... import __version__
    from .driver import Driver
    from .pool import Limits

    limits, number = Limits(batch.per_asset_seconds, batch.bytes or None), count(1)

    def told(entry: Entry) -> None:
        place = next(number)
        if console.progress_lines:
            progress_lines("batch", place, len(jobs))
        if entry.status == "failed":
            complain(f"{entry.asset}: {entry.error}", 2)
        else:
            charts = entry.metrics.get("charts")
            made = f"{charts} chart{'' if charts == 1 else 's'}, {entry.seconds:.1f} s"
            console.note(f"{place}/{len(jobs)} {entry.asset}: {made}")

    able = sum(not job.problem for job in jobs)
    return not jobs or Driver(manifest, __version__, limits, told).run(jobs, crew_of(batch, limits, able))


def crew_of(batch: BatchOptions, limits: Limits, jobs: int) -> Crew:
    """Those who do the work: processes here, no more than there are jobs, or a cluster."""
    if batch.ray is None:
        from .crew import LocalCrew, shares_of_cores

        return LocalCrew(WORK, shares_of_cores(batch.workers)[:jobs], limits)
    from .fleet import Fleet

    return Fleet(WORK, limits, batch.ray, None if batch.workers == "auto" else int(batch.workers))

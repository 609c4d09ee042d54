"""The command that works a folder off.  Options in, jobs out to workers, a manifest and a page."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from ..cli.console import Console, Manners
from ..errors import InputError
from ..options.batch import BatchOptions
from ..options.unwrap import Options, Outputs

if TYPE_CHECKING:
    from .driver import Crew
    from .manifest import Entry
    from .pool import Limits

WORK = "flexpara.__main__:unwrap_one"
"""What a worker does with a job; named, not imported, as all that unwraps lies above this folder."""
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
    from ..files import replace_file
    from .driver import Driver
    from .jobs import find_jobs, shard
    from .lock import locked
    from .manifest import left_to_do, read_entries
    from .pool import Limits
    from .status import PLAN, status_of, write_page

    first, count = batch.share
    mark = f"-{first}-of-{count}" if count > 1 else ""
    jobs = shard(find_jobs(assets, output, options, outputs, console.note), batch.share)
    jobs = [replace(job, run=replace(job.run, force=console.force, strict=console.strict)) for job in jobs]
    manifest = output / f"manifest{mark}.jsonl"
    if batch.dry_run:
        left = left_to_do(jobs, read_entries(manifest), __version__, retry=batch.retry_failed)
        sys.stdout.write("".join(f"{job.name}{job.problem and f': {job.problem}'}\n" for job in left))
        console.note(f"{len(left)} of {len(jobs)} assets are left to do")
        return 0
    with locked(output / f".batch{mark}.lock"):
        left = left_to_do(jobs, read_entries(manifest), __version__, retry=batch.retry_failed)
        console.note(f"{len(left)} of {len(jobs)} assets are left to do")
        replace_file(output / f"{mark.lstrip('-')}{PLAN}", json.dumps({"assets": len(jobs)}).encode())
        limits = Limits(batch.per_asset_seconds, batch.bytes or None)

        def told(entry: Entry) -> None:
            said = f"{entry.metrics.get('charts')} charts" if entry.status == "done" else f"failed: {entry.error}"
            console.note(f"{entry.asset}: {said}, {entry.seconds:.1f} s")

        able = sum(not job.problem for job in left)
        whole = not left or Driver(manifest, __version__, limits, told).run(left, crew_of(batch, limits, able))
        write_page(output, status_of(output))
    if not whole:
        console.note("interrupted: what was running is given back; the same command goes on")
        return INTERRUPTED
    last = read_entries(manifest)
    return 2 if any(last[job.name].status == "failed" for job in jobs if job.name in last) else 0


def crew_of(batch: BatchOptions, limits: Limits, jobs: int) -> Crew:
    """Those who do the work: processes here, no more than there are jobs, or a cluster."""
    if batch.ray is None:
        from .crew import LocalCrew, shares_of_cores

        return LocalCrew(WORK, shares_of_cores(batch.workers)[:jobs], limits)
    from .fleet import Fleet

    return Fleet(WORK, limits, batch.ray, None if batch.workers == "auto" else int(batch.workers))

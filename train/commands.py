"""The command that trains alone.  Options in, one call, files and summary out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from .. import __version__, load
from ..runtime.cli.console import Console, Manners
from ..runtime.extras import requires
from ..runtime.options.unwrap import Output, TrainOptions
from ..runtime.process.deadline import Deadline
from ..runtime.process.progress import Clock

TRAINED = "trained.safetensors"
CHARTS = Parameter(name="*", group="Charts and atlas")


def train(
    mesh: Path,
    *,
    output: Output,
    options: Annotated[TrainOptions, CHARTS] = TrainOptions(),
    console: Manners = Console(),
) -> int:
    """Do the first half of unwrap: find charts and networks, and write STEM.trained.safetensors for flexpara export.

    Args:
        mesh: Any mesh that unwrap takes.
        output: The folder for STEM.trained.safetensors and STEM.train.json.
        options: See TrainOptions.
        console: See Console.
    """
    from ..runtime.files import OutputFolder

    asset = load(mesh, options.select)
    console.note_changes(asset)
    name, report = f"{asset.stem}.{TRAINED}", f"{asset.stem}.train.json"
    with OutputFolder(output, asset.stem, force=console.force, source=mesh, report=report) as folder:
        folder.check([name, folder.report_name])
        with requires("unwrap"):
            from .presets import train_asset
            from .saved import to_bytes
        with console.progress() as progress:
            clock = Clock(progress, Deadline(options.time_budget))
            trained = train_asset(asset, options, clock)
            with clock.stage("fit"):
                experts = len(trained.networks.label)
        folder.write(name, lambda path: path.write_bytes(to_bytes(trained, asset.sha256)))
        source = {"stem": asset.stem, "sha256": asset.sha256, "faces": len(asset.faces)}
        report = {**trained.report, "experts": experts}
        facts = {"version": __version__, "source": source, "settings": trained.settings, "train": report}
        folder.write_report(facts)
        written = folder.commit()
    console.notes(trained.report)
    console.show({}, written)
    return 0

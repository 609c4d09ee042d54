"""A run that may be killed and resumed: what was asked for, kept as JSON beside its checkpoints.

The folder `<output>/<stem>.checkpoint/` holds `run.json` and what training writes there; it goes when the run is done.
A file may come from anywhere: its values pass the same checks as those of the command line.
"""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

from ..errors import InputError, MissingFileError
from ..files import replace_file
from ..options.keywords import as_files
from ..options.unwrap import Options, Outputs
from ..options.words import file_fields

FOLDER = ".checkpoint"
NAME = "run.json"
FORMAT = "flexpara-run-1"
LARGEST = 1 << 20


@dataclass(frozen=True)
class Run:
    """One `flexpara unwrap`.  mesh, output: absolute paths.  every: steps between checkpoints, None keeps none.

    force, strict: as `Console` has them, for a run that nobody watches.
    """

    mesh: Path
    output: Path
    options: Options
    outputs: Outputs
    every: int | None = None
    force: bool = False
    strict: bool = False

    def __post_init__(self) -> None:
        """Refuse checkpoints where none are made (InputError)."""
        if self.every is not None and (self.every < 1 or self.options.preset != "paper"):
            raise InputError(
                f"checkpoint-every is {self.every} with preset {self.options.preset}, expected 1 or more with preset "
                "paper; leave it out"
            )

    @property
    def keep(self) -> tuple[Path, int] | None:
        """Folder and interval of the checkpoints."""
        return None if self.every is None else (self.folder, self.every)

    @property
    def folder(self) -> Path:
        """Where checkpoints are kept."""
        return self.output / f"{self.mesh.stem}{FOLDER}"

    def save(self) -> None:
        """Write `run.json`, whole, if checkpoints are kept.  Raises: InputError for a folder not to be written to."""
        if self.every is None:
            return
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            replace_file(self.folder / NAME, (json.dumps(facts_of(self), indent=2) + "\n").encode())
        except OSError as error:
            raise InputError(f"can't write to {self.folder} ({error.strerror}); choose another -o") from error

    def forget(self) -> None:
        """Remove the folder of checkpoints."""
        if self.every is not None and (self.folder / NAME).is_file():
            shutil.rmtree(self.folder)


def facts_of(run: Run) -> dict[str, Any]:
    """A run as JSON holds it."""
    return {
        "format": FORMAT,
        "mesh": str(run.mesh),
        "output": str(run.output),
        "options": plain_options(run.options),
        "outputs": plain_options(run.outputs),
        "every": run.every,
        "force": run.force,
        "strict": run.strict,
    }


def plain_options(options: Options | Outputs) -> dict[str, Any]:
    """Options as JSON holds them."""
    plain = asdict(options)
    for name in file_fields(type(options)):
        found = plain[name]
        plain[name] = [str(path) for path in found] if isinstance(found, tuple) else found and str(found)
    return plain


def run_of(facts: dict[str, Any]) -> Run:
    """The run of `facts_of`.  Raises: InputError, ValueError, TypeError, KeyError, AttributeError for what is none."""
    if facts["format"] != FORMAT:
        raise InputError(f"format is {str(facts['format'])[:60]!r}, expected {FORMAT!r}; start the run anew")
    options, outputs = Options(**_fields(Options, facts["options"])), Outputs(**_fields(Outputs, facts["outputs"]))
    every = None if facts["every"] is None else int(facts["every"])
    manners = {name: bool(facts.get(name)) for name in ("force", "strict")}
    return Run(Path(facts["mesh"]), Path(facts["output"]), options, outputs, every, **manners)


def _fields(kind: Any, facts: dict[str, Any]) -> dict[str, Any]:
    """The fields of `plain_options`."""
    files = {field.name: field.default for field in fields(kind) if field.name in file_fields(kind)}
    found = {name: as_files(name, files[name], value) if name in files else value for name, value in facts.items()}
    return {name: tuple(value) if isinstance(value, list) else value for name, value in found.items()}


def find_run(output: Path) -> Run:
    """The one run that was cut short in an output folder.

    Raises:
        MissingFileError: none.
        InputError: more than one, or a damaged `run.json`.
    """
    found = sorted(output.glob(f"*{FOLDER}/{NAME}")) if output.is_dir() else []
    if not found:
        raise MissingFileError(f"{output} holds no run to resume, expected the -o of one that kept checkpoints")
    if len(found) > 1:
        names = ", ".join(path.parent.name for path in found)
        raise InputError(f"{output} holds {len(found)} runs ({names}), expected one; move the others away")
    return read_run(found[0], output)


def read_run(path: Path, output: Path) -> Run:
    """What `Run.save` wrote; the output folder may have been moved since."""
    if path.stat().st_size > LARGEST:
        raise InputError(f"{path} has {path.stat().st_size} bytes, expected at most {LARGEST}; start the run anew")
    try:
        run = replace(run_of(json.loads(path.read_bytes())), output=output.absolute())
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise InputError(f"{path} is damaged ({error}), expected what flexpara wrote; start the run anew") from error
    if f"{run.mesh.stem}{FOLDER}" != path.parent.name:
        raise InputError(f"{path} names {run.mesh.name}, expected the mesh of {path.parent.name}; start the run anew")
    return run

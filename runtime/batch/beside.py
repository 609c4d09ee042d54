"""Files that options name, for each asset of a batch: the file of its name in a folder, or by a pattern.

`--high high/` takes for `chairs/oak.obj` the mesh `high/chairs/oak.*`, else one of that name anywhere in the folder.
Names match as bakers know them: `oak_low` takes `oak_high`, and `oak_high_bolts` with it (see `part_name`).  In a
pattern, {stem} stands for `oak` and {folder} for the folder of the asset: `--high {folder}/{stem}_high.*`.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from fnmatch import fnmatch
from glob import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from ..cli.inputs import ENDINGS
from ..cli.partnames import is_low, part_name
from ..errors import InputError, MissingFileError
from ..options.sources import MapSources
from ..options.unwrap import Options, Outputs
from ..options.words import file_fields

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

Chosen = TypeVar("Chosen", Options, Outputs)

STEM, FOLDER, WILD = "{stem}", "{folder}", "*?["
PICTURES = (".npy", ".png", ".jpg", ".jpeg", ".webp")
ENDINGS_OF = {"high": ENDINGS, "cage": ENDINGS, "start": ENDINGS, "cut": (".txt",), "fields": (".onnx",)}
ENDINGS_OF |= {"protect": PICTURES, "importance": PICTURES}
"""Files that are taken from a folder for an option."""
WORDS = ("protect", "importance")
"""Options that may name a vertex attribute in the place of a file."""


def options_of_files(options: Options | Outputs) -> dict[str, tuple[Path, ...]]:
    """What each option that names files has; none where it is not given."""
    found = {name: getattr(options, name) or () for name in sorted(file_fields(type(options)))}
    if isinstance(options, MapSources) and options.reach is None:
        found["cage"] = Path(options.cage)
    return {name: (value,) if isinstance(value, Path) else tuple(value) for name, value in found.items()}


def with_files(options: Chosen, files: dict[str, tuple[Path, ...]]) -> Chosen:
    """The options with these files.  Raises: InputError for several where an option takes one."""
    fields: dict[str, Any] = {}
    for name, found in files.items():
        several = isinstance(getattr(options, name), tuple)
        if len(found) > 1 and not several:
            names = ", ".join(str(path) for path in found)
            raise InputError(f"{len(found)} files for {word(name)} ({names}), expected one; name it by a pattern")
        one = next(iter(found))
        fields[name] = found if several else str(one) if name == "cage" else one
    return replace(options, **fields)


def rebased(options: Chosen, names: Collection[str], folder: Path) -> Chosen:
    """The options with the files of these options counted from a folder; words that are no files stay."""
    asked = {name: paths for name, paths in options_of_files(options).items() if name in names and paths}

    def based(name: str, path: Path) -> Path:
        word = str(path).startswith(FOLDER) or (name in WORDS and not (is_pattern(path) or there(folder / path)))
        return path if word else folder / path

    return with_files(options, {name: tuple(based(name, path) for path in paths) for name, paths in asked.items()})


class Beside:
    """Finds files for assets; what lies in a folder is looked up once."""

    def __init__(self) -> None:
        self.folders: dict[tuple[Path, tuple[str, ...]], dict[str, list[Path]]] = {}
        self.listings: dict[Path, list[Path]] = {}

    def chosen(self, options: Chosen, asset: Path, name: str) -> tuple[Chosen, tuple[Path, ...]]:
        """The options with the files of one asset, as absolute paths, and those files.

        asset: its file, absolute.  name: its path below the batch.
        Raises: MissingFileError where there is none; InputError where there are several for an option that takes one.
        """
        asked = {option: paths for option, paths in options_of_files(options).items() if paths}
        if not asked:
            return options, ()
        files = {
            option: tuple(file for path in paths for file in self._found(option, path, asset, name))
            for option, paths in asked.items()
        }
        return with_files(options, files), tuple(file for paths in files.values() for file in paths if there(file))

    def _found(self, option: str, path: Path, asset: Path, name: str) -> list[Path]:
        place = path.absolute()
        if is_pattern(path):
            return self._of_pattern(option, path, asset)
        if there(place):
            return self._of_name(option, place, asset, name) if place.is_dir() else [place]
        if option in WORDS:
            return [path]
        raise missing(option, f"{place} is not there", "correct the path")

    def _of_name(self, option: str, folder: Path, asset: Path, name: str) -> list[Path]:
        parts = self._by_part(folder, option).get(part_name(asset.stem), [])
        files = [file for file in parts if file != asset]
        near = [file for file in files if file.parent == (folder / name).parent]
        for among in (near, files):
            same = [file for file in among if file.stem == asset.stem]
            found = same or [file for file in among if not is_low(file.stem)]
            if found:
                return one_each(option, found)
        raise missing(option, f"{folder} holds nothing named like {name}", "add it, or name it by a pattern")

    def _of_pattern(self, option: str, path: Path, asset: Path) -> list[Path]:
        folder = Path(str(path.parent).replace(STEM, asset.stem).replace(FOLDER, str(asset.parent))).absolute()
        exact = folder / path.name.replace(STEM, asset.stem)
        if any(sign in path.name for sign in WILD):
            name, kinds = path.name.replace(STEM, escape(asset.stem)), ENDINGS_OF[option]
            alike = [file for file in self._listed(folder) if fnmatch(file.name, name)]
            found = [file for file in alike if file.suffix.lower() in kinds and file != asset]
        else:
            found = [exact] if there(exact) and exact.is_file() and exact != asset else []
        if not found:
            raise missing(option, f"{exact} is not there", "add it, or correct the pattern")
        return one_each(option, found)

    def _listed(self, folder: Path) -> list[Path]:
        if folder not in self.listings:
            self.listings[folder] = sorted(folder.iterdir()) if there(folder) and folder.is_dir() else []
        return self.listings[folder]

    def _by_part(self, folder: Path, option: str) -> dict[str, list[Path]]:
        """The files below a folder that an option takes, by what low and high ones have in common."""
        kinds = ENDINGS_OF[option]
        if (folder, kinds) not in self.folders:
            found = self.folders[folder, kinds] = defaultdict(list)
            for file in sorted(folder.rglob("*")):
                if file.suffix.lower() in kinds and file.is_file():
                    found[part_name(file.stem)].append(file)
        return self.folders[folder, kinds]


def is_pattern(path: Path) -> bool:
    """Whether a path stands for another file of each asset."""
    return STEM in str(path) or FOLDER in str(path)


def there(path: Path) -> bool:
    """Whether a file or folder is there; a name that none can have is not."""
    try:
        return path.exists()
    except OSError:
        return False


def folders_of(options: Iterable[Options | Outputs]) -> list[Path]:
    """Folders that options name for all assets, absolute.

    Raises: MissingFileError for a file or folder that is not there.
    """
    found: list[Path] = []
    for option, paths in (each for one in options for each in options_of_files(one).items()):
        for path in paths:
            if not (there(path) or is_pattern(path) or option in WORDS):
                raise missing(option, f"{path} is not there", "correct the path")
            found += [path.absolute()] if there(path) and path.is_dir() else []
    return found


def one_each(option: str, found: list[Path]) -> list[Path]:
    """Files of which no two have one name.  Raises: InputError."""
    if len({file.stem for file in found}) < len(found):
        names = " and ".join(str(file) for file in found)
        raise InputError(f"{names} have one name, expected one for {word(option)}; name it by a pattern, {STEM}.glb")
    return found


def missing(option: str, found: str, remedy: str) -> MissingFileError:
    """What an asset without its file ends with."""
    kinds = ", ".join(ENDINGS_OF[option])
    return MissingFileError(f"{found}, expected a file for {word(option)} ({kinds}); {remedy}")


def word(option: str) -> str:
    """An option as it is typed."""
    return "--field" if option == "fields" else f"--{option}"

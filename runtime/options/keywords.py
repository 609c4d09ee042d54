"""Options as the Python API takes them: an object made before, keywords, or both."""

from __future__ import annotations

from dataclasses import fields, replace
from difflib import get_close_matches
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from ..errors import InputError
from .seams import AUTO
from .words import demand, file_fields, names

if TYPE_CHECKING:
    from collections.abc import Mapping

Chosen = TypeVar("Chosen")


def from_keywords(kind: type[Chosen], made: Chosen | None, keywords: Mapping[str, Any]) -> Chosen:
    """Options of that kind; keywords replace fields of those made before.

    A field of several names takes any sequence of them, or one comma-separated word; a field of files, their names.

    Raises: InputError for an unknown keyword, or a value that its field refuses.
    """
    start: Any = kind() if made is None else made
    known, files = {field.name: field.default for field in fields(start)}, file_fields(type(start))
    for name in keywords:
        close = get_close_matches(name, known, 1)
        remedy = f"pass {close[0]}" if close else "leave it out"
        demand(name in known, f"{name} is no option, expected some of {', '.join(sorted(known))}; {remedy}")
    try:
        as_kept = {name: as_files if name in files else _as_field for name in keywords}
        return replace(start, **{name: as_kept[name](name, known[name], value) for name, value in keywords.items()})
    except TypeError as error:
        raise InputError(f"an option has the wrong type ({error}), expected those of {kind.__name__}") from error


def as_files(name: str, default: object, value: Any) -> Any:
    """Names of files as the field holds them: one path or none, or a tuple of them where its default is one.

    Raises: InputError for what is no name of a file.
    """
    if default is None and value is None:
        return None
    given = value if isinstance(default, tuple) and isinstance(value, list | tuple) else [value]
    for each in given:
        found = f"{name} is {str(each)[:60]!r}, expected the name of a file"
        demand(isinstance(each, str | Path), f"{found}; correct it")
    paths = tuple(Path(each) for each in given)
    return paths if isinstance(default, tuple) else paths[0]


def _as_field(name: str, default: object, value: Any) -> Any:
    """The value as the field holds it: integers of numpy as int or float, several names as a tuple."""
    if isinstance(default, tuple):
        return names(value) if isinstance(value, str) else tuple(value)
    plain = int(value) if isinstance(value, Integral) and not isinstance(value, bool) else value
    plain = float(plain) if type(plain) is int and isinstance(default, float) else plain
    plain = str(plain) if type(plain) in (int, float) and isinstance(default, str) else plain
    fits = default is None or type(plain) is type(default) or (name, plain) == ("charts", AUTO)
    demand(fits, f"{name} is {value!r}, expected a value like {default!r}; pass one of type {type(default).__name__}")
    return plain

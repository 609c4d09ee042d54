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
        plain = {name: as_files(value) if name in files else value for name, value in keywords.items()}
        return replace(start, **{name: _as_field(name, known[name], value) for name, value in plain.items()})
    except TypeError as error:
        raise InputError(f"an option has the wrong type ({error}), expected those of {kind.__name__}") from error


def as_files(value: Any) -> Any:
    """Names of files as paths, one or several; what is none stays for a check to refuse."""
    if isinstance(value, list | tuple):
        return tuple(as_files(each) for each in value)
    return Path(value) if isinstance(value, str) else value


def _as_field(name: str, default: object, value: Any) -> Any:
    """The value as the field holds it: integers of numpy as int or float, several names as a tuple."""
    if isinstance(default, tuple):
        several = (value,) if isinstance(value, Path) else value
        return names(several) if isinstance(several, str) else tuple(several)
    plain = int(value) if isinstance(value, Integral) and not isinstance(value, bool) else value
    plain = float(plain) if type(plain) is int and isinstance(default, float) else plain
    plain = str(plain) if type(plain) in (int, float) and isinstance(default, str) else plain
    fits = default is None or type(plain) is type(default) or (name, plain) == ("charts", AUTO)
    demand(fits, f"{name} is {value!r}, expected a value like {default!r}; pass one of type {type(default).__name__}")
    return plain

"""Kinds of options on the command line: several names in one word, an option given several times, a flag.

Annotations are evaluated here, as in unwrap.py.
"""

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args

from cyclopts import Parameter

from ..errors import InputError

if TYPE_CHECKING:
    from cyclopts import Token


def names(text: str) -> tuple[str, ...]:
    """Comma-separated words; "none" is no word."""
    return () if text == "none" else tuple(word.strip() for word in text.split(",") if word.strip())


def _from_words(_kind: object, tokens: "Sequence[Token]") -> tuple[str, ...]:
    return tuple(name for token in tokens for name in names(token.value))


def _shown(value: tuple[str, ...]) -> str:
    return ",".join(value) or "none"


COMMA_SEPARATED = Parameter(converter=_from_words, n_tokens=1, negative="", metavar="NAME,…", show_default=_shown)
Names = Annotated[tuple[str, ...], COMMA_SEPARATED]
"""Several names in one word of the command line."""
Paths = Annotated[tuple[Path, ...], Parameter(negative="", show_default=False)]
"""An option that may be given several times."""
Flag = Annotated[bool, Parameter(negative="", show_default=False)]
"""An option without a value, off unless it is given."""


def file_fields(kind: Any) -> frozenset[str]:
    """Options of a class that name files: one each, or several; by annotations that were evaluated, as here."""

    def holds(hint: object) -> bool:
        return hint is Path or any(holds(each) for each in get_args(hint))

    return frozenset(field.name for field in fields(kind) if holds(field.type))


def demand_known(name: str, value: str, known: Sequence[str]) -> None:
    """Raises InputError for a value of an option that is none of those known."""
    demand(value in known, f"{name} is {value!r}, expected one of {', '.join(known)}; leave --{name} out")


def demand(holds: bool, message: str) -> None:
    """Raises InputError with a message of value, expectation and remedy."""
    if not holds:
        raise InputError(message)

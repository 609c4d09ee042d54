"""Kinds of options on the command line: several names in one word, an option given several times, a flag.

Annotations are evaluated here, as in unwrap.py.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

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

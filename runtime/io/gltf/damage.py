"""What reading stumbles over in a damaged glTF file, as one error in words of the format."""

from __future__ import annotations

import json
import struct
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ...errors import FlexparaError, MeshError

if TYPE_CHECKING:
    from collections.abc import Iterator

STUMBLES = (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError, struct.error, RecursionError)
"""What Python raises where a document is not what the specification says."""


@contextmanager
def damage_is_named() -> Iterator[None]:
    """Around whatever looks into a document.  Raises: MeshError for what Python says of a damaged one."""
    try:
        yield
    except FlexparaError:
        raise
    except STUMBLES as error:
        raise MeshError(f"the glTF file is damaged ({_what(error)}), expected glTF 2.0; export it again") from error


def _what(error: Exception) -> str:
    if isinstance(error, KeyError):
        return f"{str(error.args[0])[:40]!r} is missing or not allowed"
    if isinstance(error, IndexError):
        return "a number refers to what is not there"
    if isinstance(error, json.JSONDecodeError):
        return f"line {error.lineno} of its JSON is not readable"
    return "a value has the wrong type or size"

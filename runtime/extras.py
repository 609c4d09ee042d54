"""Optional packages: what is absent is said with its remedy."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from .errors import FlexparaError, MissingDependencyError
from .process.forks import refuse_fork_of_torch

if TYPE_CHECKING:
    from collections.abc import Iterator

PACKAGE = "flexpara"


@contextmanager
def requires(extra: str) -> Iterator[None]:
    """Around imports: a package of that extra which is absent becomes a MissingDependencyError that says what to do.

    Raises: MissingDependencyError; FlexparaError where torch is asked for and would hang, see `forks`.
    """
    if extra in ("train", "unwrap"):
        refuse_fork_of_torch()
    try:
        yield
    except FlexparaError:
        raise
    except ImportError as error:
        if (error.name or "").partition(".")[0] == PACKAGE:
            raise
        found = f"{error.name or 'a package'} can't be imported ({error}), expected what flexpara[{extra}] brings"
        raise MissingDependencyError(f'{found}; pip install "flexpara[{extra}]"') from error

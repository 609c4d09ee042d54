"""The error family: exit codes, builtin twins, and messages of one line."""

from __future__ import annotations

import inspect

import pytest

from flexpara.runtime import errors
from flexpara.runtime.errors import FlexparaError, InputError, MissingDependencyError, MissingFileError

MEMBERS = [member for _, member in inspect.getmembers(errors, inspect.isclass) if issubclass(member, Exception)]
FAMILY = [member for member in MEMBERS if issubclass(member, FlexparaError)]


def test_every_error_belongs_to_the_one_family() -> None:
    assert len(FAMILY) > 5
    assert FAMILY == MEMBERS


@pytest.mark.parametrize("member", FAMILY)
def test_a_message_is_shown_as_it_was_given(member: type[FlexparaError]) -> None:
    assert str(member("3 charts; expected 8; pass --charts 3")) == "3 charts; expected 8; pass --charts 3"


def test_bad_input_ends_with_2_and_a_missing_dependency_with_3() -> None:
    assert {member.exit_code for member in FAMILY if issubclass(member, InputError)} == {2}
    assert MissingDependencyError.exit_code == 3
    assert {member.exit_code for member in FAMILY if not issubclass(member, (InputError, MissingDependencyError))} == {
        1
    }


def test_errors_are_caught_by_those_who_know_only_builtins() -> None:
    for error, builtin in (
        (InputError, ValueError),
        (MissingFileError, FileNotFoundError),
        (MissingDependencyError, ImportError),
    ):
        with pytest.raises(builtin):
            raise error("found; expected; remedy")

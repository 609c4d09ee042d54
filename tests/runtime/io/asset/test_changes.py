"""What reading changed is said in one line."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import flexpara
from flexpara.runtime.io.asset.changes import UNSAID, WORDS, told


def test_nothing_changed_is_nothing_said() -> None:
    assert told({}) == []
    assert told({"degenerate_faces": 0, "components": 7, "welded_vertices": 3}) == []


@pytest.mark.parametrize("name", WORDS)
def test_each_change_reads_as_one_and_as_many(name: str) -> None:
    (one,), (many,) = told({name: 1}), told({name: 2})
    assert one != many.replace("2", "1")
    assert "{" not in one + many
    assert "1 " in one


def test_each_change_has_its_line_and_unknown_ones_are_not_hidden() -> None:
    lines = told({"degenerate_faces": 1, "components": 3, "split_hairs": 5})
    assert lines == ["1 face without area left out", "split hairs: 5"]


def test_every_count_that_readers_make_has_words() -> None:
    """Keys of dictionaries named changes or counts, in the sources of reading."""
    found: set[str] = set()
    for path in (Path(str(flexpara.__file__)).parent / "runtime" / "io").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            found |= counted(node)
    assert len(found) > 15
    assert found <= set(WORDS) | UNSAID


def counted(node: ast.AST) -> set[str]:
    """The keys that a node gives to a dictionary named changes or counts."""
    if isinstance(node, ast.Subscript):
        names, keys = {getattr(node.value, "id", "")}, [node.slice]
    elif isinstance(node, ast.Assign):
        names, keys = {getattr(target, "id", "") for target in node.targets}, getattr(node.value, "keys", [])
    elif isinstance(node, ast.keyword):
        names, keys = {node.arg}, getattr(node.value, "keys", [])
    else:
        return set()
    return {str(key.value) for key in keys if isinstance(key, ast.Constant)} if names & {"changes", "counts"} else set()

"""Messages that the troubleshooting page quotes are messages of the code: a word changed there has to change here."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "reference" / "troubleshooting.md"
ROOMS = ("runtime", "train", "export", "bake")
LEAST = 12
"""Letters of a string that says something by itself."""
QUOTED = re.findall(r"^\| `(.+?)` \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)


def template(node: ast.AST) -> str:
    """A string of the code as a pattern: what is filled in may be anything; of words for a count, the sentence."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return ".+?".join(map(re.escape, node.value.partition("|")[0].split("{}")))
    if isinstance(node, ast.JoinedStr):
        return "".join(template(part) for part in node.values)
    return ".+?"


@cache
def templates() -> list[re.Pattern[str]]:
    """All strings of the sources that say something."""
    files = [ROOT / "__main__.py", *(path for room in ROOMS for path in sorted((ROOT / room).rglob("*.py")))]
    nodes = [node for path in files for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))]
    found = {template(node) for node in nodes if isinstance(node, ast.Constant | ast.JoinedStr)}
    return [re.compile(pattern) for pattern in sorted(found) if len(pattern.replace(".+?", "")) >= LEAST]


def is_said(words: str) -> bool:
    """Whether the code says so: the words are part of one of its strings, or all of one is part of them."""
    return any(words in re.sub(r"\\(.)", r"\1", found.pattern) or found.search(words) for found in templates())


@pytest.mark.parametrize("message", QUOTED)
def test_a_quoted_message_is_one_of_the_code(message: str) -> None:
    parts = [part.strip(" ;…") for part in re.split("…|; ", message)]
    assert [part for part in parts if part and not is_said(part)] == []


def test_a_message_that_nobody_says_is_noticed() -> None:
    assert len(QUOTED) >= 10
    assert not is_said("your mesh smells of elderberries")
    assert not is_said("padding was 8 texels")

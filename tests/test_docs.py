"""The documents: links lead somewhere, commands that are shown exist, words are defined once."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from flexpara.__main__ import main

ROOT = Path(__file__).resolve().parent.parent
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "examples/README.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
COMMAND = re.compile(r"^(?:.*&& )?flexpara (\w+) ([^#\n]*)", re.MULTILINE)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_to_files_that_exist(page: Path) -> None:
    targets = re.findall(r"\]\(([^)#\s]+)\)", page.read_text(encoding="utf-8"))
    broken = [target for target in targets if "://" not in target and not (page.parent / target).exists()]
    assert broken == []


def test_the_readme_can_be_read_in_one_go() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 130


def test_every_option_that_the_readme_shows_exists(capsys: pytest.CaptureFixture[str]) -> None:
    shown = COMMAND.findall((ROOT / "README.md").read_text(encoding="utf-8"))
    assert len(shown) >= 5
    for command, words in shown:
        assert main([command, "--help"]) == 0
        known = set(re.findall(r"--?[\w-]+", capsys.readouterr().out))
        assert set(re.findall(r"(?<=\s)--?[a-z][\w-]*", f" {words}")) - known == set(), command


def test_every_word_of_the_glossary_is_defined_once() -> None:
    text = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    words = re.findall(r"^- \*\*([^*]+)\*\*", text, re.MULTILINE)
    assert len(words) > 40
    assert sorted(set(words)) == sorted(words)

"""Hooks of MkDocs: the tables of options are made from the classes that the command line is made from.

`<!-- options: NAME -->` on a line of its own becomes the table of `NAME` of runtime/options/unwrap.py and the like.
"""

from __future__ import annotations

import ast
import html
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
SOURCES = (
    "runtime/options/unwrap.py",
    "runtime/options/atlas.py",
    "runtime/options/seams.py",
    "runtime/options/sources.py",
    "runtime/options/pack.py",
    "runtime/options/batch.py",
    "runtime/cli/console.py",
    "bake/commands.py",
)
PLACE = re.compile(r"^<!-- options: (\w+) -->$", re.MULTILINE)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Called by MkDocs for each page."""
    return PLACE.sub(lambda found: table_of(found[1]), markdown)


def table_of(name: str) -> str:
    """A Markdown table of the fields of a class: option, default, what it does."""
    rows = [f"| `--{option}` | {default} | {text} |" for option, default, text in fields_of(name)]
    return "\n".join(["| option | default | |", "|---|---|---|", *rows])


def fields_of(name: str) -> list[tuple[str, str, str]]:
    """Option, default and help of each field of a class of options."""
    for source in SOURCES:
        for node in ast.parse((ROOT / source).read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and node.name == name:
                return list(_fields(node))
    raise KeyError(f"no class {name} in {', '.join(SOURCES)}")


def _fields(node: ast.ClassDef) -> Any:
    for field, text in zip(node.body, node.body[1:], strict=False):
        told = isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant)
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name) and told:
            named = re.search(r"name=\[?['\"](--[\w-]+)", ast.unparse(field.annotation))
            option = named[1][2:] if named else field.target.id.replace("_", "-")
            default = "" if field.value is None else ast.unparse(field.value)
            shown = "" if default in ("None", "False", "()") else f"`{html.escape(default)}`"
            help_text = str(text.value.value)  # pyright: ignore[reportAttributeAccessIssue]
            yield option, shown, " ".join(help_text.split()).replace("|", "\\|")

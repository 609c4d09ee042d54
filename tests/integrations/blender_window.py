"""What Blender draws into and speaks to where it has a window, written down: for in_blender.py, which has none."""

from __future__ import annotations

import importlib
from typing import Any

bpy: Any = importlib.import_module("bpy")  # the checkers of types have none


class Layout:
    """A layout that writes down what is drawn.  asked: what commands would be run with."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.asked: list[Any] = []

    def prop(self, owner: Any, name: str) -> None:
        """A field."""
        value = getattr(owner, name)
        shown = value if isinstance(value, str) else f"{value:g}"
        self.lines.append(f"{owner.bl_rna.properties[name].name}: {shown}")

    def prop_search(self, owner: Any, name: str, source: Any, names: str) -> None:
        """A field for one of the names that something has."""
        assert hasattr(source, names)
        self.prop(owner, name)

    def operator(self, name: str, text: str = "") -> Any:
        """A button."""
        room, _, own = name.partition(".")
        kind = getattr(getattr(bpy.ops, room), own).get_rna_type()
        self.lines.append(f"[{text or kind.name}]")
        self.asked.append(type("Asked", (), dict.fromkeys(kind.properties.keys())))
        return self.asked[-1]

    def label(self, text: str) -> None:
        """A line."""
        self.lines.append(text)

    def column(self) -> Any:
        """One below the other."""
        return self

    def row(self, align: bool) -> Any:  # Blender's own
        """Side by side."""
        assert align
        return self


class Window:
    """Blender's window, as far as a command in the background speaks to it: what it was told."""

    def __init__(self) -> None:
        self.said: list[object] = []
        self.shares: list[float] = []
        self.window_manager = self.workspace = self
        self.window = None

    def __getattr__(self, name: str) -> Any:
        """All else is Blender's own."""
        return getattr(bpy.context, name)

    def event_timer_add(self, _seconds: float, window: object) -> str:
        """A timer."""
        return f"timer of {window}"

    def event_timer_remove(self, timer: object) -> None:
        """No longer wanted."""
        self.said.append(timer)

    def progress_begin(self, low: float, high: float) -> None:
        """The bar appears."""
        self.shares += [low - high]

    def progress_update(self, share: float) -> None:
        """The bar grows."""
        self.shares.append(share)

    def progress_end(self) -> None:
        """The bar is gone."""
        self.said.append("bar gone")

    def modal_handler_add(self, command: object) -> None:
        """Events go to the command."""
        self.said.append(type(command).__name__)

    def status_text_set(self, text: str | None) -> None:
        """The line at the bottom."""
        self.said.append(text)


class Event:
    """A timer's tick, or a key."""

    def __init__(self, kind: str, value: str = "NOTHING") -> None:
        self.type, self.value = kind, value

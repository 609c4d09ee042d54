"""Readers that do what none may: they show that the harness would see it."""

from __future__ import annotations

import os
from pathlib import Path

from .mutate import by_bytes
from .readers import Reader


def _raises(path: Path) -> object:
    return 1 / (path.stat().st_size * 0)


def _dies(_: Path) -> object:
    os.abort()


def _hangs(_: Path) -> object:
    while True:
        pass


def _fills(_: Path) -> object:
    return bytearray(2 << 30)


def _leaves(path: Path) -> object:
    return (path.parents[2] / "here" / "left").write_bytes(b"a")


def _follows(path: Path) -> object:
    return (path.parent / "up" / "secret.bin").read_bytes()


CONTROLS = {
    found.__name__.lstrip("_"): Reader("a.txt", by_bytes, found)
    for found in (_raises, _dies, _hangs, _fills, _leaves, _follows)
}

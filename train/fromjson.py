"""Configs read back from the JSON that was saved with a result."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

from ..runtime.errors import InputError
from .deploy.config import FitConfig, WrapConfig

T = TypeVar("T")


def fit_in_force(settings: dict[str, Any]) -> FitConfig:
    """The numbers that the deployed networks of a result were fitted by; ``settings``: of `pipeline.Trained`."""
    return from_json(FitConfig, settings.get("deploy", settings).get("fit"), "settings.fit")


def wrap_in_force(settings: dict[str, Any]) -> WrapConfig:
    """The same for their inverse."""
    return from_json(WrapConfig, settings.get("deploy", settings).get("wrap"), "settings.wrap")


def from_json(kind: type[T], facts: Any, where: str) -> T:
    """The frozen dataclass that ``dataclasses.asdict`` made these facts of; every field must be there, and no other.

    ``where`` names the facts in messages.  Every field of the dataclass needs a default, which tells its type.

    Raises:
        InputError: a field is missing, unknown, of another type, or out of range.
    """
    example = kind()
    names = {field.name for field in fields(example)}  # pyright: ignore[reportArgumentType]  # a dataclass
    if not isinstance(facts, dict) or set(facts) != names:
        found = sorted(map(str, set(facts) ^ names))[:3] if isinstance(facts, dict) else type(facts).__name__
        raise InputError(f"{where} has missing or unknown fields ({found}); use a file of this version of flexpara")
    values: dict[str, Any] = {}
    for name in names:
        default, value = getattr(example, name), facts[name]
        if is_dataclass(default):
            values[name] = from_json(type(default), value, f"{where}.{name}")
            continue
        expected = (int, float) if isinstance(default, float) else (type(default),)
        if not isinstance(value, expected) or isinstance(value, bool) is not isinstance(default, bool):
            raise InputError(f"{where}.{name} is {str(value)[:80]!r}, expected {type(default).__name__}; correct it")
        values[name] = type(default)(value)
    return kind(**values)

"""Names by which bakers pair meshes: `wheel_low` takes its details from `wheel_high` and `wheel_high_bolts`."""

from __future__ import annotations

import re

SUFFIX = re.compile(
    r"^(?P<name>.+?)[_ .-](?P<kind>low|high|lo|hi|lp|hp)(?:poly)?(?:[_ .-].*)?$",
    re.IGNORECASE,
)


def part_name(name: str) -> str:
    """What a low and a high part have in common, in small letters.

    >>> part_name("Wheel_low"), part_name("wheel_high.001"), part_name("Wheel")
    ('wheel', 'wheel', 'wheel')
    """
    match = SUFFIX.match(name)
    return (match["name"] if match else name).lower()


def is_low(name: str) -> bool:
    """Whether a name says that its mesh is the low-poly one."""
    match = SUFFIX.match(name)
    return match is not None and match["kind"].lower().startswith("l")

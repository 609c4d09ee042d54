"""Without an optional package the user is told which one, and how to install it."""

from __future__ import annotations

import subprocess
import sys

import pytest

SCRIPT = """
import sys
sys.modules[{package!r}] = None
import flexpara.runtime.errors as errors
try:
    import flexpara.bake.{module} as module
    if {package!r} == "OpenImageIO":  # wanted where the first texture is written or read
        module.oiio.ImageSpec
except errors.MissingDependencyError as error:
    assert error.exit_code == 3
    print(error)
else:
    print("imported")
"""


def imported_without(package: str, module: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT.format(package=package, module=module)],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    return done.stdout


@pytest.mark.parametrize(
    ("package", "module"),
    [
        ("moderngl", "baker"),
        ("OpenImageIO", "files.images"),
        ("pygltflib", "files.gltf"),
        ("moderngl", "pictures.preview"),
    ],
)
def test_a_missing_package_is_named_with_its_remedy(package: str, module: str) -> None:
    message = imported_without(package, module)
    assert message.startswith(package)
    assert "pip install 'flexpara[bake]'" in message
    assert message.count("\n") == 1


def test_the_check_can_fail() -> None:
    assert imported_without("moderngl", "colors.color") == "imported\n"

"""What all tests share: the import rule of this layout, and the folder of real meshes where there is one."""

from __future__ import annotations

from pathlib import Path

import pytest

MODELS = Path(__file__).resolve().parent.parent.parent / "shared" / "models"


class _RootIsNoTestPackage:
    """The root's __init__.py is the package `flexpara`: pytest must not import it under another name."""

    @pytest.hookimpl(tryfirst=True)
    def pytest_collect_directory(self, path: Path, parent: pytest.Collector) -> pytest.Collector | None:
        if path == parent.config.rootpath:
            return pytest.Dir.from_parent(parent, path=path)
        return None


def pytest_configure(config: pytest.Config) -> None:
    """Register the import rule."""
    config.pluginmanager.register(_RootIsNoTestPackage())


@pytest.fixture
def models() -> Path:
    """The folder of real meshes; tests that use it skip where it is absent."""
    if not MODELS.is_dir():
        pytest.skip(f"no real meshes at {MODELS}")
    return MODELS

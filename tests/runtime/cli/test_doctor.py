"""The doctor: what it lists, and how it marks what is missing."""

from __future__ import annotations

from importlib import metadata

import pytest

from flexpara.runtime.cli.doctor import Finding, cpu, packages, probe


def test_a_finding_without_a_remedy_is_ticked() -> None:
    assert str(Finding("numpy", "2.0")).split() == ["✓", "numpy", "2.0"]
    assert str(Finding("torch", "absent", "pip install torch")).endswith("absent → pip install torch")
    assert str(Finding("torch", "absent", "pip install torch")).startswith("✗")


def test_a_finding_is_one_line() -> None:
    assert "\n" not in str(Finding("OpenGL", "two\nlines", "mend"))


def test_every_package_of_the_extras_for_users_is_listed_once() -> None:
    names = [finding.name for finding in packages()]
    assert len(names) == len(set(names))
    assert {"flexpara", "numpy", "torch", "moderngl", "manifold3d"} <= set(names)
    assert "ruff" not in names


def test_an_absent_package_names_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    real = metadata.version

    def version(name: str) -> str:
        if name == "torch":
            raise metadata.PackageNotFoundError(name)
        return real(name)

    monkeypatch.setattr(metadata, "version", version)
    found = {finding.name: finding for finding in packages()}
    assert found["torch"].remedy == 'pip install "flexpara[train]"'
    assert found["numpy"].remedy == ""


def test_a_probe_that_fails_gives_its_reason_and_remedy() -> None:
    def broken() -> str:
        raise ImportError("no libEGL")

    assert probe("OpenGL", lambda: "llvmpipe", "apt-get install mesa") == Finding("OpenGL", "llvmpipe")
    assert probe("OpenGL", broken, "apt-get install mesa") == Finding("OpenGL", "no libEGL", "apt-get install mesa")


def test_the_cpu_has_cores() -> None:
    assert "cores" in cpu()

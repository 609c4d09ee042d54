"""How the kernel in C++ is compiled: by pip, or in place by `python scripts/build_kernel.py`.

The second needs `pip install pybind11 cmeel-eigen`, which pip does by itself for the first.  Without a
compiler pip installs all the same, and Python does the kernel's work.
"""

from __future__ import annotations

import sys
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext
from setuptools.errors import CompileError

FLAGS = {"msvc": ["/std:c++17", "/O2", "/fp:precise", "/EHsc"]}
"""Of each compiler that does not take GCC's."""
GCC_FLAGS = ["-std=c++17", "-O3", "-g0", "-fvisibility=hidden", "-ffp-contract=off", "-pthread"]
"""Sums and products are rounded one by one: the exact tests rely on it, and machines agree."""


def eigen() -> str:
    """The folder of Eigen's headers.

    Raises: CompileError where the package that brings them is absent.
    """
    places = [Path(place) / "cmeel.prefix" / "include" / "eigen3" for place in sys.path]
    found = next((place for place in places if (place / "Eigen" / "Core").exists()), None)
    if found is None:
        raise CompileError("Eigen's headers are absent, expected the package cmeel-eigen; pip install cmeel-eigen")
    return str(found)


def pybind() -> str:
    """The folder of pybind11's headers.

    Raises: CompileError where it is absent.
    """
    try:
        import pybind11
    except ImportError as error:
        raise CompileError("pybind11 is absent; pip install pybind11") from error
    return pybind11.get_include()


class BuildKernel(build_ext):
    """The usual way, with headers from two packages, and this compiler's flags."""

    def build_extension(self, ext: Extension) -> None:
        """Compile one extension."""
        ext.include_dirs += [eigen(), pybind()]
        kind = self.compiler.compiler_type
        ext.extra_compile_args += FLAGS.get(kind, GCC_FLAGS)
        ext.extra_link_args += [] if kind in FLAGS else ["-pthread"]
        super().build_extension(ext)


if __name__ == "__main__":
    setup(script_args=["build_ext", "--inplace"])

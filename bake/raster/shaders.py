"""GLSL programs out of the package's own files.

A shader is written over several files: a common part and its own.  Here they are put under one `#version` line.
"""

from __future__ import annotations

from importlib import resources
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import moderngl

VERSION_LINE = "#version 330 core\n"


def shader_source(*names: str) -> str:
    """GLSL 330 text of the named files of `shaders/` (without `.glsl`), in the order given."""
    folder = resources.files(__name__.rpartition(".")[0]) / "shaders"
    parts = [(folder / f"{name}.glsl").read_text(encoding="utf-8") for name in names]
    return VERSION_LINE + "\n".join(parts)


def build_program(context: moderngl.Context, vertex: tuple[str, ...], fragment: tuple[str, ...]) -> moderngl.Program:
    """A linked program, made once for a context, which keeps it.  vertex, fragment: file names as in `shader_source`.

    Its uniforms have the values that its last user gave them.
    """
    context.extra = context.extra or {}
    programs: dict[object, moderngl.Program] = context.extra
    if (vertex, fragment) not in programs:
        made = context.program(vertex_shader=shader_source(*vertex), fragment_shader=shader_source(*fragment))
        programs[vertex, fragment] = made
    return programs[vertex, fragment]

"""Rows of the baker's table on drawing: the G-buffer beside a bare draw, and the whole command with its files."""

from __future__ import annotations

import statistics
import sys
import time
from contextlib import ExitStack
from typing import TYPE_CHECKING, NamedTuple

import moderngl
import numpy as np

from benchmarks.unwrap import timed
from flexpara.bake.raster.context import open_context
from flexpara.bake.raster.gbuffer import WINDOW, DeviceRasterizer
from flexpara.bake.raster.layout import Layout, Planes, windows

if TYPE_CHECKING:
    from pathlib import Path

    from flexpara.runtime.mesh import Atlas

RATE_BAR, COMMAND_BAR = 60.0, 6.0
ROUNDS = 5
VERTEX = """#version 330 core
in vec2 in_uv; in vec3 in_position; in vec3 in_normal;
out vec3 position; out vec3 normal;
void main() { position = in_position; normal = in_normal; gl_Position = vec4(2.0 * in_uv - 1.0, 0.0, 1.0); }
"""
FRAGMENT = """#version 330 core
in vec3 position; in vec3 normal;
layout(location = 0) out vec4 out_position; layout(location = 1) out vec4 out_normal;
void main() { out_position = vec4(position, 1.0); out_normal = vec4(normalize(normal), 1.0); }
"""


class Rates(NamedTuple):
    """Millions of texels a second, drawn and read back into arrays that are used again."""

    own: float
    bare: float


def drawing_rates(atlas: Atlas, size: int) -> Rates:
    """Median rates of flexpara's G-buffer (position, normal, face, conservative) and of a bare draw of two targets."""
    own, bare = list[float](), list[float]()
    with open_context() as context, ExitStack() as stack:
        pieces = windows(size, size, WINDOW)
        capacity = max(window.height for window in pieces), size
        rasterizer = DeviceRasterizer(context, stack, atlas, Layout.of(atlas, size), capacity)
        program = context.program(vertex_shader=VERTEX, fragment_shader=FRAGMENT)
        data = np.hstack([atlas.uv, atlas.positions, atlas.normals]).astype(np.float32)
        names = ("in_uv", "in_position", "in_normal")
        array = context.vertex_array(
            program, [(context.buffer(data), "2f 3f 3f", *names)], context.buffer(atlas.faces.astype(np.int32))
        )
        frame = context.framebuffer([context.texture((size, size), 4, dtype="f4") for _ in range(2)])
        planes = Planes.of(size, size)
        for _ in range(ROUNDS + 1):
            start = time.perf_counter()
            for window in pieces:
                rows = slice(window.row, window.row + window.height)
                rasterizer.draw(window, planes.part(rows, slice(0, size)), clear=False)
            middle = time.perf_counter()
            frame.use()
            frame.clear()
            array.render(moderngl.TRIANGLES)
            for attachment, plane in enumerate((planes.position, planes.normal)):
                frame.read_into(plane, components=4, attachment=attachment, dtype="f4")
            own.append(middle - start)
            bare.append(time.perf_counter() - middle)
    texels = size * size / 1e6  # the first round warms up
    return Rates(texels / statistics.median(own[1:]), texels / statistics.median(bare[1:]))


def command_seconds(mesh: Path, folder: Path, size: int) -> float:
    """Median seconds of `flexpara bake` with position (EXR) and normal (PNG), files written."""
    command = [sys.executable, "-m", "flexpara", "bake", str(mesh), "-o", str(folder), "--size", str(size)]
    command += ["--maps", "position,normal", "--quiet", "--force"]
    return statistics.median(timed(command)[0] for _ in range(3))

"""A small off-screen canvas: shaded triangles and lines → an antialiased picture.

Colours are linear light.  World space is right-handed; the camera is orthographic.  Pictures have row 0 = top.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..raster.context import drawing_into, moderngl
from ..raster.shaders import build_program

if TYPE_CHECKING:
    from numpy.typing import NDArray

SUPERSAMPLING = 2
SAMPLES = 4
"""Per pixel of the supersampled picture: smooth outlines for little; supersampling smooths what lies inside faces."""
MARGIN = 0.88
"""Part of the picture's side that the drawing may fill."""
LIFT = 2e-3
"""How far lines are drawn before the surface, in depth units (the whole scene is 2 deep)."""


@dataclass(frozen=True, eq=False)
class Camera:
    """Orthographic view.  axes: (3, 3) float64 rows right, up, towards the viewer, in world space, unit.

    centre: (3,) float64, world point in the middle of the picture.  scale: world length of half the picture's side.
    """

    axes: NDArray[np.float64]
    centre: NDArray[np.float64]
    scale: float
    depth: float

    @classmethod
    def fit(cls, points: NDArray[np.float64], axes: NDArray[np.float64]) -> Camera:
        """The camera of these axes that shows all points (m, 3) as large as `MARGIN` allows."""
        local = points @ axes.T
        low, high = local.min(axis=0), local.max(axis=0)
        half = (high - low) / 2.0
        scale = float(max(half[0], half[1])) / MARGIN
        return cls(axes=axes, centre=(low + high) / 2.0 @ axes, scale=scale or 1.0, depth=1.1 * float(half[2]) or 1.0)

    def matrix(self) -> NDArray[np.float32]:
        """(4, 4) world → clip, row 0 of the target at the top, as OpenGL's column-major bytes (so: transposed)."""
        result = np.zeros((4, 4))
        result[:3, :3] = self.axes / np.array([self.scale, -self.scale, -self.depth])[:, None]
        result[:3, 3] = -result[:3, :3] @ self.centre
        result[3, 3] = 1.0
        return result.T.astype(np.float32)


@dataclass(frozen=True, eq=False)
class Shape:
    """Triangles to draw, corner by corner.

    positions, normals: (f, 3, 3).  uv: (f, 3, 2).  colors: (f, 3) linear light per face.
    cells: checker squares per uv unit, 0 for none.  lit: whether light falls on it.
    """

    positions: NDArray[np.float64]
    normals: NDArray[np.float64]
    uv: NDArray[np.float64]
    colors: NDArray[np.float32]
    cells: float = 0.0
    lit: bool = True


@dataclass(frozen=True, eq=False)
class Lines:
    """Segments to draw.  segments: (s, 2, 3) world space.  color: linear light.  width: pixels."""

    segments: NDArray[np.float64]
    color: tuple[float, float, float]
    width: float


def draw(
    context: moderngl.Context,
    camera: Camera,
    shape: Shape,
    lines: Lines,
    *,
    pixels: int,
    paper: tuple[float, float, float],
) -> NDArray[np.float32]:
    """(pixels, pixels, 3) float32 linear light: the shape, the lines on it, the paper behind."""
    side = pixels * SUPERSAMPLING
    with ExitStack() as stack:
        target = _smooth_target(context, stack, side)
        with drawing_into(context, target):
            target.clear(*paper, 1.0, depth=1.0)
            context.enable_only(moderngl.DEPTH_TEST)
            _draw_shape(context, stack, camera, shape)
            _draw_lines(context, stack, camera, lines, pixels)
            context.enable_only(moderngl.NOTHING)
            picture = _resolve(context, stack, target, side)
    blocks = picture[..., :3].reshape(pixels, SUPERSAMPLING, pixels, SUPERSAMPLING, 3)
    corners = [blocks[:, row, :, column] for row, column in np.ndindex(SUPERSAMPLING, SUPERSAMPLING)]
    return np.sum(corners, axis=0) / np.float32(len(corners))


def _smooth_target(context: moderngl.Context, stack: ExitStack, side: int) -> moderngl.Framebuffer:
    """Multisampled float framebuffer with depth.  The caller releases it, its attachments go with the stack."""
    samples = min(SAMPLES, context.max_samples)
    color = context.renderbuffer((side, side), 4, samples=samples, dtype="f2")
    stack.callback(color.release)
    depth = context.depth_renderbuffer((side, side), samples=samples)
    stack.callback(depth.release)
    return context.framebuffer(color_attachments=[color], depth_attachment=depth)


def _resolve(
    context: moderngl.Context, stack: ExitStack, source: moderngl.Framebuffer, side: int
) -> NDArray[np.float32]:
    """(side, side, 4) float32: the mean of the samples of each pixel."""
    flat = context.renderbuffer((side, side), 4, dtype="f2")
    stack.callback(flat.release)
    target = context.framebuffer(color_attachments=[flat])
    picture = np.zeros((side, side, 4), np.float32)
    with drawing_into(context, target):
        context.copy_framebuffer(target, source)
        target.read_into(picture, components=4, dtype="f4")
    return picture


def three_quarter_axes() -> NDArray[np.float64]:
    """Rows right, up, towards the viewer: from the front (+z), 35° to the right and 20° above, y up."""
    turn, rise = np.radians(35.0), np.radians(20.0)
    toward = np.array([np.sin(turn) * np.cos(rise), np.sin(rise), np.cos(turn) * np.cos(rise)])
    right = np.array([np.cos(turn), 0.0, -np.sin(turn)])
    return np.stack([right, np.cross(toward, right), toward])


def _draw_shape(context: moderngl.Context, stack: ExitStack, camera: Camera, shape: Shape) -> None:
    """All triangles in one call, positions about the camera's centre so that float32 keeps its digits."""
    program = build_program(context, ("shape.vert",), ("shape.frag",))
    right, up, toward = camera.axes
    lamp = -0.45 * right + 0.65 * up + 0.75 * toward
    _set_view(program, camera)
    program["cells"], program["lit"] = float(shape.cells), float(shape.lit)
    program["eye"], program["up"] = tuple(toward.tolist()), tuple(up.tolist())
    program["lamp"] = tuple((lamp / np.linalg.norm(lamp)).tolist())
    colors = np.repeat(shape.colors[:, None], 3, axis=1)
    data = np.concatenate([shape.positions - camera.centre, shape.normals, shape.uv, colors], axis=2, dtype=np.float32)
    buffer = context.buffer(data)
    stack.callback(buffer.release)
    content = [(buffer, "3f 3f 2f 3f", "in_position", "in_normal", "in_uv", "in_color")]
    array = context.vertex_array(program, content)
    stack.callback(array.release)
    array.render(moderngl.TRIANGLES)


def _draw_lines(context: moderngl.Context, stack: ExitStack, camera: Camera, lines: Lines, pixels: int) -> None:
    """All segments in one call, one instance each."""
    if len(lines.segments) == 0:
        return
    program = build_program(context, ("line.vert",), ("line.frag",))
    _set_view(program, camera)
    program["half_width"], program["lift"] = lines.width / pixels, LIFT
    program["color"] = lines.color
    data = np.ascontiguousarray(lines.segments - camera.centre, np.float32)
    buffer = context.buffer(data)
    stack.callback(buffer.release)
    array = context.vertex_array(program, [(buffer, "3f 3f/i", "in_start", "in_end")])
    stack.callback(array.release)
    array.render(moderngl.TRIANGLES, vertices=6, instances=len(data))


def _set_view(program: moderngl.Program, camera: Camera) -> None:
    """Uniform `view` for positions given about the camera's centre."""
    centred = Camera(axes=camera.axes, centre=np.zeros(3), scale=camera.scale, depth=camera.depth)
    program["view"] = tuple(centred.matrix().reshape(-1).tolist())

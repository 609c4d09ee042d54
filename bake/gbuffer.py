"""The surface per texel: an atlas rasterized in uv space once; every map is a function of the result.

h w texels · f faces · n atlas vertices · e border edges.  Image row 0 is the top, uv is v up: the centre of texel
(row, column) lies at u = (column + ½) / w, v = 1 − (row + ½) / h.  Positions are in source units.

Two draws.  Faces first, each texel whose centre they hold.  Then the borders of charts: each texel whose centre lies
within `REACH` of a border, evaluated at the nearest point of it.  √½ is half a texel's diagonal, so that is every
texel a chart touches.
A texel inside a face is never overwritten; among borders the nearest wins, among equals the first face.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..runtime.errors import InputError
from .context import check_size, drawing_into, max_texture_size, moderngl
from .shaders import build_program

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..runtime.mesh import Atlas

REACH = 0.71
"""Texels; a little over √½."""
UV_SLACK = 1e-4
"""How far uv may leave [0, 1] (rounding of other tools) before it is an error."""
CHUNK = 1 << 18
"""Texels interpolated at once: bounds the memory of temporaries."""


@dataclass(frozen=True, eq=False)
class GBuffer:
    """What lies under each texel.

    position: (h, w, 3) float32, source units.  normal: (h, w, 3) float32, unit, interpolated from the atlas' vertex
    normals. second, third: (h, w) float32, barycentric weights of corners 1 and 2 of the face, in [0, 1], sum at most
    1. face: (h, w) int32, −1 where nothing is; there the other arrays are 0.
    """

    position: NDArray[np.float32]
    normal: NDArray[np.float32]
    second: NDArray[np.float32]
    third: NDArray[np.float32]
    face: NDArray[np.int32]

    @property
    def shape(self) -> tuple[int, int]:
        """(h, w)."""
        return self.face.shape[0], self.face.shape[1]

    @property
    def barycentric(self) -> NDArray[np.float32]:
        """(h, w, 3) float32 weights of the three corners; (1, 0, 0) where nothing is."""
        return np.stack([1.0 - self.second - self.third, self.second, self.third], axis=-1)

    @cached_property
    def texels(self) -> NDArray[np.int64]:
        """(t,) int64 flat indices of the texels that hold a surface, ascending."""
        return np.flatnonzero(self.face.reshape(-1) >= 0)

    def weights(self, texels: NDArray[np.int64]) -> NDArray[np.float32]:
        """(t, 3) float32 barycentric weights of the three corners at flat texel indices."""
        weights = np.zeros((len(texels), 3), np.float32)
        weights[:, 1] = self.second.reshape(-1)[texels]
        weights[:, 2] = self.third.reshape(-1)[texels]
        weights[:, 0] = 1.0 - weights[:, 1] - weights[:, 2]
        return weights

    def chunks(self) -> list[NDArray[np.int64]]:
        """The covered texels in pieces of at most `CHUNK`, so that temporaries stay small."""
        return [self.texels[start : start + CHUNK] for start in range(0, len(self.texels), CHUNK)]

    def interpolate(
        self, values: NDArray[np.floating], corners: NDArray[np.int64], texels: NDArray[np.int64]
    ) -> NDArray[np.float32]:
        """(t, c) float32: vertex values (n, c), looked up by corners (f, 3), at flat covered texel indices (t,)."""
        flat = np.ascontiguousarray(values, np.float32)
        corner = corners[self.face.reshape(-1)[texels]]
        weights = self.weights(texels)
        result = flat[corner[:, 0]] * weights[:, :1]
        result += flat[corner[:, 1]] * weights[:, 1:2]
        result += flat[corner[:, 2]] * weights[:, 2:]
        return result


def rasterize(context: moderngl.Context, atlas: Atlas, size: int) -> GBuffer:
    """Draw the atlas into size × size texels.

    Raises: InputError for a size beyond the device's limit, for uv outside [0, 1], for more faces than the device can
    hold.
    """
    check_size(context, size)
    check_uv(atlas.uv)
    check_faces(context, len(atlas.faces))
    with ExitStack() as stack:
        corners = _corner_texture(context, stack, atlas)
        targets = _targets(context, stack, size)
        with drawing_into(context, _cleared_frame(context, stack, targets, size)):
            context.enable_only(moderngl.DEPTH_TEST)
            corners.use(0)
            _draw_interior(context, stack, len(atlas.faces), size)
            _draw_borders(context, stack, border_edges(atlas.faces, atlas.uv), size)
            context.enable_only(moderngl.NOTHING)
        return _read(targets, size)


def check_uv(uv: NDArray[np.floating]) -> None:
    """Raise InputError unless all uv (n, 2) are finite and in [0, 1]."""
    if not np.isfinite(uv).all():
        raise InputError("uv holds NaN or infinite values; expected values in [0, 1]; unwrap the mesh anew")
    low, high = float(uv.min(initial=0.0)), float(uv.max(initial=1.0))
    if low < -UV_SLACK or high > 1.0 + UV_SLACK:
        raise InputError(
            f"uv span {low:.4g} to {high:.4g}; expected 0 to 1 (no UDIM tiles, no repeats); unwrap or repack the mesh"
        )


def check_faces(context: moderngl.Context, count: int) -> None:
    """Raise InputError for no face, or for more than one texture of the device can hold."""
    limit = max_texture_size(context)
    most = (limit // 6) * limit
    if not 1 <= count <= most:
        raise InputError(f"{count} faces: this OpenGL device rasterizes 1 to {most}; decimate or split the mesh")


def border_edges(faces: NDArray[np.int64], uv: NDArray[np.floating]) -> NDArray[np.int32]:
    """(e, 2) int32 rows (face, corner): the edge from that corner to the next one has no neighbour beyond it in uv.

    A neighbour is the one other face at the edge, running along it the other way, of the same non-zero orientation in
    uv.
    So the edges of faces of zero uv area, of folds and of non-manifold fans are borders too.  Rows ascend.
    """
    corner = uv[faces].astype(np.float64)
    first, second = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    sign = np.sign(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]).astype(np.int64)
    start, end = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    key = np.minimum(start, end) * (int(faces.max()) + 1) + np.maximum(start, end)
    _, edge, count = np.unique(key, return_inverse=True, return_counts=True)
    edge = edge.reshape(-1)
    direction = np.bincount(edge, weights=np.sign(end - start))
    orientation = np.bincount(edge, weights=np.repeat(sign, 3))
    joined = (count == 2) & (direction == 0.0) & (np.abs(orientation) == 2.0)
    half_edges = np.flatnonzero(~joined[edge])
    return np.stack([half_edges // 3, half_edges % 3], axis=1).astype(np.int32)


def _corner_texture(context: moderngl.Context, stack: ExitStack, atlas: Atlas) -> moderngl.Texture:
    """RGBA32F texture of all corners in the order that triangle.glsl reads."""
    faces = atlas.faces
    per_row = max_texture_size(context) // 6
    rows = -(-len(faces) // per_row)
    data = np.zeros((rows * per_row if rows > 1 else len(faces), 3, 2, 4), np.float32)
    data[: len(faces), :, 0, :3] = atlas.positions[faces]
    data[: len(faces), :, 0, 3] = atlas.uv[faces][..., 0]
    data[: len(faces), :, 1, :3] = atlas.normals[faces]
    data[: len(faces), :, 1, 3] = atlas.uv[faces][..., 1]
    width = 6 * (len(data) // rows)
    texture = context.texture((width, rows), 4, data, dtype="f4")
    stack.callback(texture.release)
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return texture


def _targets(context: moderngl.Context, stack: ExitStack, size: int) -> list[moderngl.Texture]:
    """Textures for position, normal and face.  Face starts as −1 by upload: moderngl clears to floats only."""
    nothing = np.full((size, size), -1, np.int32)
    targets = [
        context.texture((size, size), 4, dtype="f4"),
        context.texture((size, size), 4, dtype="f4"),
        context.texture((size, size), 1, nothing, dtype="i4"),
    ]
    for target in targets:
        stack.callback(target.release)
    return targets


def _cleared_frame(
    context: moderngl.Context, stack: ExitStack, targets: list[moderngl.Texture], size: int
) -> moderngl.Framebuffer:
    """Framebuffer over all targets: floats 0, depth at its far end.  The caller releases it."""
    depth = context.depth_renderbuffer((size, size))
    stack.callback(depth.release)
    floats = context.framebuffer(color_attachments=targets[:2], depth_attachment=depth)
    with drawing_into(context, floats):
        floats.clear(depth=1.0)
    return context.framebuffer(color_attachments=targets, depth_attachment=depth)


def _draw_interior(context: moderngl.Context, stack: ExitStack, faces: int, size: int) -> None:
    """First draw: all faces, no attributes."""
    program = build_program(context, ("triangle", "interior.vert"), ("surface", "interior.frag"))
    stack.callback(program.release)
    program["size"] = float(size)
    program["corners"] = 0
    array = context.vertex_array(program, [])
    stack.callback(array.release)
    array.render(moderngl.TRIANGLES, vertices=3 * faces)


def _draw_borders(context: moderngl.Context, stack: ExitStack, edges: NDArray[np.int32], size: int) -> None:
    """Second draw: a rectangle around every border edge."""
    if len(edges) == 0:
        return
    program = build_program(context, ("triangle", "border.vert"), ("surface", "border.frag"))
    stack.callback(program.release)
    program["size"] = float(size)
    program["corners"] = 0
    program["reach"] = REACH
    buffer = context.buffer(np.repeat(edges, 6, axis=0))
    stack.callback(buffer.release)
    array = context.vertex_array(program, [(buffer, "2i4", "in_edge")])
    stack.callback(array.release)
    array.render(moderngl.TRIANGLES, vertices=6 * len(edges))


def _read(targets: list[moderngl.Texture], size: int) -> GBuffer:
    """Targets → arrays, as views: barycentric weights travel in the fourth channels."""
    position, normal = np.zeros((size, size, 4), np.float32), np.zeros((size, size, 4), np.float32)
    face = np.zeros((size, size), np.int32)
    for target, array in zip(targets, (position, normal, face), strict=True):
        target.read_into(array)
    return GBuffer(position[..., :3], normal[..., :3], position[..., 3], normal[..., 3], face)

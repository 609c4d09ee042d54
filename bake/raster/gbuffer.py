"""The surface per texel: an atlas rasterized in uv space once; every map is a function of the result.

h w texels · f faces · n atlas vertices · e border edges.  Image row 0 is the top, uv is v up: the centre of texel
(row, column) lies at u = (column + ½) / width, v = 1 − (row + ½) / height.  Positions are in source units.

Two draws.  Faces first, each texel whose centre they hold.  Then the borders of charts: each texel whose centre lies
within `REACH` of a border, evaluated at the nearest point of it.  √½ is half a texel's diagonal, so that is every
texel a chart touches.  A texel inside a face is never overwritten; among borders the nearest wins, then the first face.

The image is drawn in windows.  Which texel belongs to which face is decided in integers (see shaders/exact.glsl), so
it depends neither on the device nor on the windows; software.py comes to the same without OpenGL.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.errors import InputError
from ...runtime.pagesize import PageSize
from .context import check_error, drawing_into, max_texture_size, moderngl
from .layout import Layout, Planes, Window, windows
from .shaders import build_program

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Atlas
    from ...runtime.pagesize import Size

REACH = 0.71
"""Texels; a little over √½."""
LEAST = 2.0**-20
"""Least barycentric weight of a point inside a face, as in shaders/interior.frag.glsl; on a border one weight is 0."""
CHUNK = 1 << 18
"""Texels interpolated at once: bounds the memory of temporaries."""
GROWTH = 1.0 / 16.0
"""Texels by which faces are drawn larger: more than any device's rounding of places.  The fragments decide."""
WINDOW = 1 << 22
"""Texels drawn at once: the targets stay in the processor's cache, and their memory is used again."""


RECTANGLE = np.array([0, 1, 2, 2, 1, 3], np.int32)
"""Two triangles of four vertices."""


@dataclass(frozen=True, eq=False)
class GBuffer:
    """What lies under each texel.

    position: (h, w, 3) float32, source units.  normal: (h, w, 3) float32, unit, interpolated from the atlas' vertex
    normals. second, third: (h, w) float32, barycentric weights of corners 1 and 2 of the face, in [0, 1], sum at most
    1. face: (h, w) int32, −1 where nothing is; there the other arrays are 0.
    row, column: where this window begins in the image.  size: of the image, None = that of this window.
    """

    position: NDArray[np.float32]
    normal: NDArray[np.float32]
    second: NDArray[np.float32]
    third: NDArray[np.float32]
    face: NDArray[np.int32]
    row: int = 0
    column: int = 0
    size: PageSize | None = None

    @classmethod
    def of(cls, planes: Planes, row: int = 0, column: int = 0, size: PageSize | None = None) -> GBuffer:
        """Views of the planes."""
        position, normal, face = planes
        return cls(position[..., :3], normal[..., :3], position[..., 3], normal[..., 3], face, row, column, size)

    @property
    def page(self) -> PageSize:
        """Size of the whole image, of which this may be a window."""
        return self.size or PageSize(self.face.shape[1], self.face.shape[0])

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

    @property
    def inside(self) -> NDArray[np.bool_]:
        """(h, w) bool: texels whose centres lie in a face, not merely near the border of a chart."""
        edge = 0.5 * LEAST
        inside = (self.face >= 0) & (self.second > edge)
        inside &= self.third > edge
        inside &= self.second + self.third < 1.0 - edge
        return inside

    def image_texels(self, texels: NDArray[np.int64]) -> NDArray[np.int64]:
        """(t,) int64 flat indices in the whole image of flat indices in this window: seeds that no window changes."""
        row, column = np.divmod(texels, self.shape[1])
        return (row + self.row) * self.page.width + column + self.column

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


def rasterize(
    context: moderngl.Context,
    atlas: Atlas,
    size: Size | PageSize,
    *,
    limit: int | None = None,
    planes: Planes | None = None,
) -> GBuffer:
    """Draw the atlas into an image of that size.

    limit: the largest side drawn at once, in texels; it changes no bit.  planes: arrays of that size to draw into
    again, since new memory often takes longer than drawing.
    Raises: InputError for a size out of range, for uv outside [0, 1], for more faces than the device can hold.
    """
    layout = Layout.of(atlas, size)
    pieces = windows(layout.page, min(max_texture_size(context), limit or layout.page.side), WINDOW)
    planes = Planes.of(*layout.page.shape) if planes is None else planes
    with ExitStack() as stack:
        drawn = DeviceRasterizer(context, stack, atlas, layout, (pieces[0].height, pieces[0].width))
        for window in pieces:
            drawn.draw(window, planes.part(window.rows, window.columns))
    return GBuffer.of(planes, size=layout.page)


def check_faces(context: moderngl.Context, count: int) -> None:
    """Raise InputError for no face, or for more than one texture of the device can hold."""
    limit = max_texture_size(context)
    most = (limit // 6) * limit
    if not 1 <= count <= most:
        raise InputError(f"{count} faces: this OpenGL device rasterizes 1 to {most}; decimate or split the mesh")


class DeviceRasterizer:
    """An atlas on an OpenGL device, laid into an image; draws any window of it up to its capacity."""

    def __init__(
        self, context: moderngl.Context, stack: ExitStack, atlas: Atlas, layout: Layout, capacity: tuple[int, int]
    ) -> None:
        """capacity: height and width of the largest window, texels.  All objects are released by the stack.

        Raises: InputError for more faces than the device can hold.
        """
        check_faces(context, len(atlas.faces))
        self.layout = layout
        self._context = context
        self._height, self._width = capacity
        self._fresh = True
        self._corners = _corner_texture(context, stack, atlas, layout)
        self._targets = _targets(context, stack, self._width, self._height)
        self._blank = build_program(context, ("blank.vert",), ("blank.frag",))
        self._interior = _program(context, "interior")
        self._border = _program(context, "border")
        self._interior["growth"] = GROWTH
        self._border["reach"] = REACH

    def draw(self, window: Window, planes: Planes | None = None, *, clear: bool = True) -> GBuffer:
        """The G-buffer of a window, read into planes of its shape where given: they are then used, not copied.

        clear: False saves a fifth of the time; what lies where no surface is (face −1) is then left from before.
        Raises: InputError for a window beyond the capacity; FlexparaError when OpenGL reports an error.
        """
        if window.height > self._height or window.width > self._width:
            raise InputError(
                f"window of {window.height} × {window.width} texels: expected at most {self._height} × {self._width}"
            )
        into = Planes.of(window.height, window.width) if planes is None else planes
        with ExitStack() as stack:
            frame = self._cleared_frame(stack, clear=clear or self._fresh)
            self._fresh = False
            with drawing_into(self._context, frame):
                frame.viewport = (0, 0, window.width, window.height)
                self._context.enable_only(moderngl.DEPTH_TEST)
                self._corners.use(0)
                self._draw_faces(stack, window)
                self._draw_borders(stack, window)
                self._context.enable_only(moderngl.NOTHING)
                for attachment, plane in enumerate(into):
                    _read(frame, attachment, plane)
        check_error(self._context)
        return GBuffer.of(into, window.row, window.column, self.layout.page)

    def _cleared_frame(self, stack: ExitStack, *, clear: bool) -> moderngl.Framebuffer:
        """Over all targets: depth far, face −1 (drawn: moderngl clears floats only), floats 0 if clear."""
        *floats, face, depth = self._targets
        wiped = self._context.framebuffer(color_attachments=floats if clear else [], depth_attachment=depth)
        with drawing_into(self._context, wiped):
            wiped.clear(depth=1.0)
        with drawing_into(self._context, self._context.framebuffer(color_attachments=[face])):
            array = self._context.vertex_array(self._blank, [])
            stack.callback(array.release)
            array.render(moderngl.TRIANGLES, vertices=3)
        return self._context.framebuffer(color_attachments=[*floats, face], depth_attachment=depth)

    def _draw_faces(self, stack: ExitStack, window: Window) -> None:
        """A triangle for each face; two, a rectangle, for needles, whose numbers go down as ~face."""
        faces = self.layout.faces_in(window)
        needle = self.layout.radius[faces] < GROWTH
        order = 4 * np.arange(len(faces), dtype=np.int32)[:, None] + RECTANGLE
        drawn = np.repeat(needle[:, None], 6, axis=1)
        drawn[:, :3] = True
        self._render(stack, self._interior, "in_face", np.where(needle, ~faces, faces)[:, None], order[drawn], window)

    def _draw_borders(self, stack: ExitStack, window: Window) -> None:
        """A rectangle for each border edge."""
        edges = self.layout.edges_in(window, REACH)
        order = 4 * np.arange(len(edges), dtype=np.int32)[:, None] + RECTANGLE
        self._render(stack, self._border, "in_edge", edges, order.reshape(-1), window)

    def _render(
        self,
        stack: ExitStack,
        program: moderngl.Program,
        name: str,
        items: NDArray[np.int32],
        order: NDArray[np.int32],
        window: Window,
    ) -> None:
        """Triangles between vertices, four for each row of items (i, c), taken three by three in that order."""
        if len(items) == 0:
            return
        program["origin"] = (window.column, window.row)
        program["window"] = (window.width, window.height)
        vertices = self._context.buffer(np.repeat(items, 4, axis=0))
        stack.callback(vertices.release)
        indices = self._context.buffer(order)
        stack.callback(indices.release)
        array = self._context.vertex_array(program, [(vertices, f"{items.shape[1]}i4", name)], index_buffer=indices)
        stack.callback(array.release)
        array.render(moderngl.TRIANGLES)


def _corner_texture(context: moderngl.Context, stack: ExitStack, atlas: Atlas, layout: Layout) -> moderngl.Texture:
    """RGBA32F texture of all corners in the order that triangle.glsl reads."""
    faces = atlas.faces
    per_row = max_texture_size(context) // 6
    rows = -(-len(faces) // per_row)
    data = np.zeros((rows * per_row if rows > 1 else len(faces), 3, 2, 4), np.float32)
    data[: len(faces), :, 0, :3] = atlas.positions[faces]
    data[: len(faces), :, 1, :3] = atlas.normals[faces]
    data[: len(faces), :, :, 3] = layout.texel
    width = 6 * (len(data) // rows)
    texture = context.texture((width, rows), 4, data, dtype="f4")
    stack.callback(texture.release)
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return texture


def _targets(context: moderngl.Context, stack: ExitStack, width: int, height: int) -> list[moderngl.Texture]:
    """Textures for position, normal and face, then depth."""
    size = (width, height)
    targets = [context.texture(size, count, dtype=kind) for count, kind in ((4, "f4"), (4, "f4"), (1, "i4"))]
    targets.append(context.depth_texture(size))
    for target in targets:
        stack.callback(target.release)
    return targets


def _program(context: moderngl.Context, name: str) -> moderngl.Program:
    """The program of interior or border."""
    vertex, fragment = ("exact", "triangle", f"{name}.vert"), ("exact", "surface", f"{name}.frag")
    program = build_program(context, vertex, fragment)
    program["corners"] = 0
    return program


def _read(frame: moderngl.Framebuffer, attachment: int, plane: NDArray[np.generic]) -> None:
    """One attachment into a plane, by way of a new array where the plane's texels do not lie together."""
    components, kind = (plane.shape[2], "f4") if plane.ndim == 3 else (1, "i4")
    into = plane if plane.flags.c_contiguous else np.zeros_like(plane, order="C")
    viewport = (0, 0, plane.shape[1], plane.shape[0])
    frame.read_into(into, viewport=viewport, components=components, attachment=attachment, dtype=kind)
    if into is not plane:
        plane[...] = into

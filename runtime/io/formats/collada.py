"""What of a COLLADA file trimesh passes over: skinned meshes, and meshes whose materials are not there.

A mesh with bones or morph targets is no ``instance_geometry`` but an ``instance_controller``, as every character that a
modelling program exports.  A skin says where its mesh stood as it was bound, in the world (``bind_shape_matrix``; the
transforms of the node that holds it don't count: COLLADA 1.4.1, "Skinning a skeleton"), and that is the pose it gets.
An instance of a mesh that names a material which is absent or damaged is lost with it, unless it names none; and some
exporters write decimal commas.  The text is edited before trimesh sees it, in the time that its length takes.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple
from xml.sax.saxutils import unescape

if TYPE_CHECKING:
    from collections.abc import Iterable

CONTROLLER, INSTANCE, CLOSED = b"<controller", b"<instance_controller", b"</instance_controller>"
SCENE_END = b"</visual_scene>"
SOURCE = re.compile(rb"<(?:skin|morph)\b[^<>]*?\bsource\s*=\s*[\"']#([^\"'<>]*)[\"']")
MATRIX = re.compile(rb"<bind_shape_matrix>([^<>]*)</bind_shape_matrix>")
NAME = re.compile(rb"[^<>]*?\bid\s*=\s*[\"']([^\"'<>]*)[\"']")
TAG = re.compile(rb"[^<>]*?\burl\s*=\s*[\"']#([^\"'<>]*)[\"'][^<>]*>")
SKELETON = re.compile(rb"<skeleton>[^<>]*</skeleton>")
MESH = re.compile(rb"<instance_geometry\b[^<>]*?\burl\s*=\s*[\"']#([^\"'<>]*)[\"'][^<>]*>")
COMMA = re.compile(rb"(?<=[0-9]),(?=[0-9])")
MESH_CLOSED = b"</instance_geometry>"
DEEPEST = 8
"""Controllers of controllers that are followed: a skin over morph targets is one."""


class Controller(NamedTuple):
    """What a controller moves, a geometry or another controller, and its matrix, the text of 16 numbers."""

    source: bytes
    matrix: bytes


def unskinned(data: bytes) -> bytes:
    """A COLLADA file with each instance of a controller replaced by one of its mesh, at the end of its scene."""
    if INSTANCE not in data:
        return data
    controllers, kept, nodes, start = controllers_of(data), list[bytes](), list[bytes](), 0
    while (found := data.find(INSTANCE, start)) >= 0:
        tag = TAG.match(data, found + len(INSTANCE))
        if tag is None:
            break
        whole = tag[0].endswith(b"/>")
        end = tag.end() if whole else data.find(CLOSED, tag.end())
        if end < 0:
            break
        scene = data.find(SCENE_END, start)
        if nodes and 0 <= scene < found:  # the scene of those before it ends here
            kept += [data[start:scene], *nodes]
            nodes, start = [], scene
        kept.append(data[start:found])
        nodes.append(node_of(controllers, tag[1], b"" if whole else data[tag.end() : end]))
        start = end if whole else end + len(CLOSED)
    scene = data.find(SCENE_END, start)
    end = len(data) if scene < 0 else scene
    return b"".join([*kept, data[start:end], *nodes, data[end:]])


def controllers_of(data: bytes) -> dict[bytes, Controller]:
    """The controllers of a file by their id."""
    found: dict[bytes, Controller] = {}
    for text in data.split(CONTROLLER)[1:]:
        name, source, matrix = NAME.match(text), SOURCE.search(text), MATRIX.search(text)
        if name is not None and source is not None:
            found[name[1]] = Controller(source[1], b"" if matrix is None else matrix[1])
    return found


def node_of(controllers: dict[bytes, Controller], name: bytes, materials: bytes) -> bytes:
    """A node with the mesh of a controller where it was bound; materials: what its instance says of them."""
    matrix = b""
    for _ in range(DEEPEST):
        if name not in controllers:
            break
        name, own = controllers[name]
        matrix = matrix or own
    placed = b"<matrix>" + matrix + b"</matrix>" if matrix else b""
    instance = b'<instance_geometry url="#' + name + b'">' + SKELETON.sub(b"", materials) + b"</instance_geometry>"
    return b"<node>" + placed + instance + b"</node>"


def lost_meshes(data: bytes, read: Iterable[str]) -> set[bytes]:
    """The meshes that the scene asks for and that are not among those read, whose names may go on with a number."""
    names = {name.encode() for name in read}
    begun = names | {name.rpartition(b"_")[0] for name in names}
    return {name for name in (found[1] for found in MESH.finditer(data)) if _plain(name) not in begun}


def _plain(name: bytes) -> bytes:
    """A name without the escapes of XML."""
    return unescape(name.decode("utf-8", "replace")).encode()


def with_points(data: bytes) -> bytes:
    """The file with decimal points in place of decimal commas."""
    return COMMA.sub(b".", data)


def without_materials(data: bytes, meshes: set[bytes]) -> bytes:
    """The file without what the instances of these meshes say of their materials."""
    kept, start = list[bytes](), 0
    for found in MESH.finditer(data):
        end = data.find(MESH_CLOSED, found.end())
        if found[1] in meshes and not found[0].endswith(b"/>") and end >= 0:
            kept.append(data[start : found.end()])
            start = end
    return b"".join([*kept, data[start:]])

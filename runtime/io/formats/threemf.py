"""3MF → RawMesh: every item of the build where it stands, with the colours and textures of its triangles.

Words of the specification (3MF Consortium, core 1.3 and materials 1.2): object, component, build item, resource; pid
and p1 to p3 of a triangle name a group of properties and one of them for each corner.  Read here and not with trimesh,
which has no word for colours.   n vertices · f triangles of an object.
"""

from __future__ import annotations

import io
import posixpath
import re
import zipfile
import zlib
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple
from xml.etree import ElementTree

import numpy as np

from ...errors import MeshError
from ...material import Material, Picture, Slot, seen_through
from ..limits import limits, raised
from ..pictures.pictures import decode_image
from ..rawmesh import RawMesh, demand_few, merge, split_at_corners, transformed
from ..text import finite
from .archive import check_archive

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from xml.etree.ElementTree import Element

    from numpy.typing import NDArray

    Key = tuple[str, str]

MODEL = "3D/3dmodel.model"
NAMESPACES = (
    "http://schemas.microsoft.com/3dmanufacturing/core/2015/02",
    "http://schemas.microsoft.com/3dmanufacturing/material/2015/02",
    "http://schemas.microsoft.com/3dmanufacturing/production/2015/06",
)
"""Of the core, of materials and of production: extensions that a model may require."""
PREFIX, HEAD = re.compile(rb'xmlns:(\w+)\s*=\s*"([^"]*)"'), 8192
"""Declarations of namespaces, and the bytes of a part that they stand in."""
COLOR_GROUPS = {"basematerials": ("base", "displaycolor"), "colorgroup": ("color", "color")}
"""Kind of resource → its entries, and their attribute with a colour."""
BROKEN = (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, OSError)
"""What an entry of an archive raises that can't be unpacked."""
WHITE = (255, 255, 255, 255)


class Group(NamedTuple):
    """Properties by number: colours (k, 4) uint8 sRGB, or uv (k, 2) v up and the picture's path; one of the two."""

    colors: NDArray[np.uint8] | None = None
    uv: NDArray[np.float64] | None = None
    texture: str = ""


class Placed(NamedTuple):
    """An object that another one, or the build, puts somewhere: world (4, 4) for column vectors."""

    key: Key
    world: NDArray[np.float64]


@dataclass(eq=False)
class Model:
    """What the parts of a file hold so far: meshes and components of objects, by part and id, and the build."""

    archive: zipfile.ZipFile
    meshes: dict[Key, RawMesh] = field(default_factory=dict)
    components: dict[Key, list[Placed]] = field(default_factory=dict)
    build: list[Placed] = field(default_factory=list)
    pictures: dict[str, Material] = field(default_factory=dict)


def read_3mf(data: bytes) -> RawMesh:
    """Read a 3MF file.

    Raises: MeshError: damaged, of an extension that must be known and is not, or without triangles.
    """
    check_archive(data)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        model = Model(archive)
        try:
            _read_parts(model, _start(archive))
            placed = list(_placed(model))
        except MeshError:
            raise
        except (*BROKEN, ElementTree.ParseError, ValueError, LookupError, TypeError, OverflowError) as error:
            found = " ".join(str(error).split())[:80]
            raise MeshError(f"the 3MF file is damaged ({found}), expected its objects; export it again") from error
    if not placed:
        raise MeshError("the 3MF file builds nothing with triangles, expected a mesh; check the export")
    whole = merge(placed)
    joined = {"joined_nodes": len(placed)} if len(placed) > 1 else {}
    return replace(whole, changes={**joined, **whole.changes})


def _start(archive: zipfile.ZipFile) -> str:
    """Name of the part that holds the build."""
    names = archive.namelist()
    if "_rels/.rels" in names:
        for entry in _parsed(archive, "_rels/.rels"):
            if entry.get("Type", "").endswith("/3dmodel"):
                return entry.get("Target", "").lstrip("/")
    return next((name for name in names if name.lower() == MODEL.lower()), MODEL)


def _parsed(archive: zipfile.ZipFile, name: str) -> Element:
    """The tree of a part.  Raises: MeshError where it declares entities, or requires an extension that is not read."""
    data = archive.read(name)
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise MeshError(f"{name[:40]} of the 3MF file declares entities, expected none; export it again")
    root = ElementTree.fromstring(data)
    spaces = {prefix.decode(): space.decode() for prefix, space in PREFIX.findall(data[:HEAD])}
    for prefix in root.get("requiredextensions", "").split():
        if spaces.get(prefix, prefix) not in NAMESPACES:
            found = f"the 3MF file requires the extension {spaces.get(prefix, prefix)[:80]!r}"
            raise MeshError(f"{found}, which is not read; export it without")
    return root


def _read_parts(model: Model, start: str) -> None:
    """Read the part with the build, and all parts that refer to each other from there."""
    waiting, done = [start], set[str]()
    while waiting:
        name = waiting.pop()
        if name in done:
            continue
        done.add(name)
        root = _parsed(model.archive, name)
        groups, own = dict(_groups(model.archive, root)), list[Placed]()
        for entry in _all(root, "object"):
            key = (name, entry.attrib["id"])
            for mesh in _all(entry, "mesh"):
                model.meshes[key] = _mesh(model, mesh, groups, entry)
            model.components[key] = [_placement(each, name) for each in _all(entry, "component")]
            own += model.components[key]
        if name == start:
            model.build += [_placement(item, name) for build in _all(root, "build") for item in _all(build, "item")]
        waiting += [placed.key[0] for placed in (*own, *model.build)]


def _all(root: Element, name: str) -> Iterator[Element]:
    """Elements of a name in any namespace, at any depth."""
    return (entry for entry in root.iter() if entry.tag.rpartition("}")[2] == name)


def _groups(archive: zipfile.ZipFile, root: Element) -> Iterator[tuple[str, Group]]:
    """The groups of properties of a part by their ids."""
    textures = {entry.attrib["id"]: entry.attrib["path"].lstrip("/") for entry in _all(root, "texture2d")}
    for kind, (name, attribute) in COLOR_GROUPS.items():
        for entry in _all(root, kind):
            colors = [_color(each.attrib[attribute]) for each in _all(entry, name)]
            yield entry.attrib["id"], Group(colors=np.array(colors, np.uint8).reshape(-1, 4))
    for entry in _all(root, "texture2dgroup"):
        uv = [(finite(each.attrib["u"]), finite(each.attrib["v"])) for each in _all(entry, "tex2coord")]
        path = textures.get(entry.attrib["texid"], "")
        path = path if path in archive.namelist() else ""
        yield entry.attrib["id"], Group(uv=np.array(uv, np.float64).reshape(-1, 2), texture=path)


def _color(text: str) -> tuple[int, ...]:
    """#rrggbb or #rrggbbaa → four bytes."""
    found = bytes.fromhex(text.strip().removeprefix("#"))
    if len(found) not in (3, 4):
        raise ValueError(f"colour {text[:20]!r}")
    return (*found, 255)[:4]


def _placement(entry: Element, part: str) -> Placed:
    """What a component or an item of the build puts where."""
    path = next((value for name, value in entry.attrib.items() if name.rpartition("}")[2] == "path"), "")
    world, words = np.eye(4), entry.get("transform", "").split()
    if words:
        rows = np.array([finite(word) for word in words]).reshape(4, 3)
        world[:3, :3], world[:3, 3] = rows[:3].T, rows[3]
    return Placed((posixpath.normpath(path).lstrip("/") if path else part, entry.attrib["objectid"]), world)


def _mesh(model: Model, mesh: Element, groups: Mapping[str, Group], owner: Element) -> RawMesh:
    """The triangles of an object with their properties; those without take the object's own."""
    points = [[float(entry.attrib[axis]) for axis in "xyz"] for entry in _all(mesh, "vertex")]
    triangles = list(_all(mesh, "triangle"))
    faces = [[int(entry.attrib[name]) for name in ("v1", "v2", "v3")] for entry in triangles]
    demand_few(len(faces), len(points))
    raw = RawMesh(np.array(points, np.float64).reshape(-1, 3), np.array(faces, np.int64).reshape(-1, 3))
    if ((raw.faces < 0) | (raw.faces >= len(raw.positions))).any():
        raise ValueError(f"a triangle beyond {len(raw.positions)} vertices")
    own = (owner.get("pid", ""), owner.get("pindex", "0"))
    named = [_properties(entry, own) for entry in triangles]
    used = {name: groups[name] for name in dict.fromkeys(name for name, _ in named) if name in groups}
    return _coloured(model, raw, named, used) if used else raw


def _properties(triangle: Element, own: tuple[str, str]) -> tuple[str, tuple[int, int, int]]:
    """The group of a triangle, and its property at each corner."""
    group = triangle.get("pid", own[0])
    first = triangle.get("p1", own[1] if "pid" not in triangle.attrib else "0")
    corners = (first, triangle.get("p2", first), triangle.get("p3", first))
    return group, (int(corners[0]), int(corners[1]), int(corners[2]))


def _coloured(
    model: Model, raw: RawMesh, named: list[tuple[str, tuple[int, int, int]]], used: Mapping[str, Group]
) -> RawMesh:
    """The mesh with vertices split where colours or uv of its triangles differ."""
    count, changes = len(raw.faces), dict[str, int]()
    colors = np.tile(np.array(WHITE, np.uint8), (count, 3, 1))
    uv, texture = np.zeros((count, 3, 2)), np.array([used[name].texture if name in used else "" for name, _ in named])
    for name, group in used.items():
        rows = np.flatnonzero(np.array([each == name for each, _ in named]))
        at = np.array([named[row][1] for row in rows.tolist()])
        if group.colors is not None:
            colors[rows] = group.colors[at]
        elif group.uv is not None:
            uv[rows] = group.uv[at]
    missing = sum(group.uv is not None and not group.texture for group in used.values())
    if missing:
        changes["missing_textures"] = missing
    if any(group.colors is not None for group in used.values()):
        raw = split_at_corners(raw, colors=colors)
    if any(group.uv is not None for group in used.values()):
        raw = split_at_corners(raw, uv=uv)
    paths = sorted(set(texture.tolist()))
    if any(paths):
        materials = tuple(_material(model, path) for path in paths)
        raw = replace(raw, materials=materials, face_material=np.searchsorted(paths, texture))
    return replace(raw, changes=changes)


def _material(model: Model, path: str) -> Material:
    """The material of a picture in the archive, one for each; "" is that of triangles without."""
    if path not in model.pictures:
        known = (entry.pictures["base-color"].pixels for entry in model.pictures.values() if entry.pictures)
        picture = Picture(decode_image(model.archive.read(path), known)) if path else None
        pictures: dict[Slot, Picture] = {} if picture is None else {"base-color": picture}
        mode = "BLEND" if seen_through((1.0, 1.0, 1.0, 1.0), picture) else "OPAQUE"
        name = posixpath.splitext(posixpath.basename(path))[0] or "plain"
        model.pictures[path] = Material(name, pictures=pictures, alpha_mode=mode, tinted=False)
    return model.pictures[path]


def _placed(model: Model) -> Iterator[RawMesh]:
    """The meshes of the build, each as often as it stands somewhere."""
    waiting = [(placed.key, placed.world, frozenset[tuple[str, str]]()) for placed in reversed(model.build)]
    faces = vertices = count = 0
    while waiting:
        key, world, above = waiting.pop()
        count += 1
        if count > limits().nodes:
            raise MeshError(f"over {limits().nodes} components of a 3MF file, at most so many; {raised('nodes')}")
        if key in above:
            raise MeshError(f"object {key[1][:20]} of the 3MF file is a part of itself, expected none; export it again")
        mesh = model.meshes.get(key)
        if mesh is not None and len(mesh.faces):
            faces, vertices = faces + len(mesh.faces), vertices + len(mesh.positions)
            demand_few(faces, vertices)
            yield transformed(mesh, world)
        elif key not in model.components:
            raise ValueError(f"object {key[1][:20]!r} is not there")
        waiting += [(each.key, world @ each.world, above | {key}) for each in reversed(model.components[key])]

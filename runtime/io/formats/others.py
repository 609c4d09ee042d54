"""Formats without a reader of their own (dae, …) → RawMesh, by trimesh with its processing off.

Triangles keep their order; quads become two triangles in the order that trimesh gives them.  What trimesh makes up
(grey colours, averaged normals) is left out.  A file may come from anyone: it reaches nothing outside its folder, no
network, and no pickle.
"""

from __future__ import annotations

import io
import logging
import re
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh
from trimesh.exceptions import ExceptionWrapper
from trimesh.exchange.load import mesh_loaders
from trimesh.resolvers import Resolver

from ...errors import InputError, MeshError, MissingDependencyError
from ...material import Material, Picture, seen_through
from ..pictures.colors import as_rgba
from ..pictures.pictures import picture_pixels, read_in_folder
from ..rawmesh import RawMesh, merge, transformed, unit_vectors
from .archive import check_archive
from .collada import lost_meshes, unskinned, with_points, without_materials
from .converted import CONVERTED

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

NOT_MESHES = frozenset({"json", "dict", "dict64", "msgpack", "xyz", "zip", "stl_ascii"})
REMEDY = "pip install 'flexpara[formats]', or convert the file"
COLLADA = {
    "kept_axes": rb"<up_axis>\s*Z_UP",
    "skipped_cameras": rb"<instance_camera\b",
    "skipped_lights": rb"<instance_light\b",
    "skipped_animations": rb"<animation\b",
    "skipped_skins": rb"<instance_controller\b",
    "skipped_morph_targets": rb"<morph\b",
}
"""What of a COLLADA file no mesh of trimesh says: change → how its elements begin."""
MADE_UP_GREY = [102, 102, 102, 255]
logging.getLogger("trimesh").addHandler(logging.NullHandler())  # its log would end on stderr
ARCHIVES = frozenset({"3dxml", "zae"})


def read_with_trimesh(data: bytes, path: Path) -> RawMesh:
    """The bytes of a mesh file; path names its format and the folder that it may refer to.

    Raises:
        MeshError: no mesh format, unreadable, or without triangles.
        MissingDependencyError: trimesh reads this format with a package that is absent.
    """
    kind = path.suffix.lower().removeprefix(".")
    if kind in CONVERTED:
        raise MeshError(f".{kind}: {CONVERTED[kind]}")
    loader = mesh_loaders.get(kind)
    if loader is None or kind in NOT_MESHES:
        raise MeshError(
            f"extension {path.suffix!r} is no mesh format, expected .obj .ply .stl .glb .gltf .off …; convert the file"
        )
    if isinstance(loader, ExceptionWrapper):
        raise MissingDependencyError(f".{kind} needs packages that are absent; {REMEDY}")
    if kind in ARCHIVES:
        check_archive(data)
    return _read_with_trimesh(data, kind, path.parent)


class _FolderResolver(Resolver):
    """Gives trimesh the files of one folder and nothing else."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def get(self, key: str) -> bytes:
        """Bytes of a file in the folder."""
        found = read_in_folder(self.folder, key)
        if found is None:
            raise FileNotFoundError(key)
        return found

    def keys(self) -> list[str]:
        """Names in the folder."""
        return [entry.name for entry in self.folder.iterdir() if entry.is_file()]

    def namespaced(self, namespace: str) -> _FolderResolver:  # noqa: ARG002  # as trimesh calls it
        """The same folder: names never leave it."""
        return self

    def write(self, name: str, data: object) -> None:  # noqa: ARG002  # as trimesh calls it
        """Refused: reading writes nothing."""
        raise PermissionError(name)


def _read_with_trimesh(data: bytes, kind: str, folder: Path) -> RawMesh:
    try:
        parts, others = _trimesh_parts(data, kind, folder)
    except InputError:
        raise
    except ImportError as error:
        raise MissingDependencyError(f".{kind} needs the package {error.name!r}, which is absent; {REMEDY}") from error
    except Exception as error:
        raise MeshError(
            f"the file is damaged, or no .{kind} that can be read; export it again or convert it"
        ) from error
    if not parts:
        found = "points or lines only (give points as .ply, .xyz or .npy)" if others else "no face"
        raise MeshError(f"the file holds {found}, expected triangles; give a triangle mesh")
    whole = merge(parts)
    return replace(whole, changes={**whole.changes, **_unread(data, kind, len(parts))})


def _unread(data: bytes, kind: str, parts: int) -> dict[str, int]:
    """What trimesh passes over, name → count."""
    counts = {"joined_nodes": parts if parts > 1 else 0}
    if kind == "dae":
        counts |= {name: len(re.findall(pattern, data)) for name, pattern in COLLADA.items()}
        sizes = b" ".join(re.findall(rb"<vcount>([\d\s]*)</vcount>", data)).split()
        counts["polygons_as_triangles"] = sum(size not in (b"0", b"1", b"2", b"3") for size in sizes)
    return {name: count for name, count in counts.items() if count}


def _trimesh_parts(data: bytes, kind: str, folder: Path) -> tuple[list[RawMesh], int]:
    """The meshes of the scene in its order, and how many other things with vertices it holds."""
    scene, bare = _scene(data, kind, folder)
    parts, others = [], 0
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        geometry = scene.geometry[name]
        if isinstance(geometry, trimesh.Trimesh) and len(geometry.faces):
            parts.append(_part(geometry, np.asarray(matrix, dtype=np.float64)))
        else:
            others += len(getattr(geometry, "vertices", ())) > 0
    if parts and bare:
        parts[0] = replace(parts[0], changes={**parts[0].changes, "unreadable_materials": bare})
    return parts, others


def _scene(data: bytes, kind: str, folder: Path) -> tuple[trimesh.Scene, int]:
    """The scene as trimesh reads it, and how many meshes are in it only since their materials were left out."""

    def loaded(data: bytes) -> trimesh.Scene:
        return trimesh.load_scene(io.BytesIO(data), file_type=kind, resolver=_FolderResolver(folder), process=False)

    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")  # what is wrong with the file is said once, by the exception or by cleaning
        if kind != "dae":
            return loaded(data), 0
        data = unskinned(data)
        scene = loaded(data)
        if lost_meshes(data, scene.geometry):
            data = with_points(data)
            scene = loaded(data)
        if not (lost := lost_meshes(data, scene.geometry)):
            return scene, 0
        scene = loaded(without_materials(data, lost))
        return scene, len(lost - lost_meshes(data, scene.geometry))


def _part(mesh: trimesh.Trimesh, matrix: NDArray[np.float64]) -> RawMesh:
    """One geometry of trimesh, in world space, without what trimesh makes up (grey colours, averaged normals)."""
    positions = np.array(mesh.vertices, dtype=np.float64)
    visual: Any = mesh.visual
    changes: dict[str, int] = {}
    colors = mesh.vertex_attributes.get("color")
    uv = getattr(visual, "uv", None)
    if visual.kind == "vertex":
        colors = visual.vertex_colors
    elif visual.kind == "face":
        changes["dropped_face_colors"] = len(mesh.faces)
    normals = mesh.vertex_normals if "vertex_normals" in mesh._cache else None
    material = _material(getattr(visual, "material", None))
    part = RawMesh(
        positions=positions,
        faces=np.array(mesh.faces, dtype=np.int64),
        normals=None if normals is None else unit_vectors(np.array(normals, dtype=np.float64)),
        colors=as_rgba(np.asarray(colors))
        if colors is not None and np.shape(colors)[:1] == positions.shape[:1]
        else None,
        uv=np.array(uv, dtype=np.float64)[:, :2]
        if uv is not None and np.shape(uv)[:1] == positions.shape[:1]
        else None,
        materials=() if material is None else (material,),
        face_material=None if material is None else np.zeros(len(mesh.faces), dtype=np.int64),
        changes=changes,
    )
    return transformed(part, matrix)


def _material(source: Any) -> Material | None:
    """Material of trimesh, or None where it says nothing (trimesh makes up a 40 % grey and a plain picture)."""
    image = getattr(source, "baseColorTexture", None)
    image = getattr(source, "image", None) if image is None else image
    color = getattr(source, "baseColorFactor", None)
    color = getattr(source, "diffuse", None) if color is None else color
    pixels = picture_pixels(image) if image is not None and image.format is not None else None
    factor = np.full(4, 255, dtype=np.uint8) if color is None else as_rgba(np.atleast_2d(color))[0]
    if pixels is None and (color is None or factor.tolist() == MADE_UP_GREY):
        return None
    red, green, blue, alpha = (1.0, 1.0, 1.0, 1.0) if pixels is not None else (factor / 255.0).tolist()
    picture = None if pixels is None else Picture(pixels)
    return Material(
        name=str(getattr(source, "name", None) or "material"),
        base_color_factor=(red, green, blue, alpha),
        pictures={} if picture is None else {"base-color": picture},
        alpha_mode="BLEND" if seen_through((red, green, blue, alpha), picture) else "OPAQUE",
        tinted=False,
    )

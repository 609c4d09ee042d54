"""Commands that need neither torch nor OpenGL.  Options in, one call, files and summary out."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ..errors import InputError
from ..options.atlas import AtlasOptions
from ..options.unwrap import Flag, Output
from ..pagesize import Size
from .console import Console, show

SAMPLE_FORMATS = (".ply", ".obj", ".stl", ".off", ".glb")


def query(bundle: Path, points: Path, *, output: Output, force: Flag = False) -> int:
    """Find chart and uv of any points of an unwrapped surface, without torch and without the mesh.

    Args:
        bundle: The ONNX file that unwrap wrote.
        points: A file of points (npy, npz, csv or ply) in the units of the source file.
        output: The file for points, uv, chart and score: npz or csv.
        force: Overwrite that file, though no query wrote it.
    """
    from ..files import check_whole, write_whole
    from ..io.points.pointfile import check_output, is_unwrapped, read_points, write_unwrapped
    from ..sessions.session import UnwrapSession

    check_output(output)
    force = force or (output.is_file() and is_unwrapped(output))
    check_whole(output, force=force)
    session, xyz = UnwrapSession(bundle), read_points(points)
    answer = session.unwrap(xyz)
    write_whole(output, lambda path: write_unwrapped(path, xyz, *answer), force=force)
    return 0


def evaluate(
    mesh: Path,
    *,
    size: Size | None = None,
    faces: Path | None = None,
    uv_set: int | None = None,
    force: Flag = False,
    as_json: Annotated[bool, Parameter(name="--json", negative="", show_default=False)] = False,
) -> int:
    """Measure a mesh that has uv, whoever made them.

    Args:
        mesh: A mesh with uv.
        size: Texels of the atlas, as 2048 or 2048x1024, which texel density and bleeding are measured for.
        faces: Also write an npz file with what is true of each triangle: charts, distortion (mean symmetric Dirichlet
            energy, 1 is isometric), and polygons, which of the file's polygons it is of.
        uv_set: The uv set that is measured; by default the one that the mesh's textures are read with.
        force: Overwrite that file, though no evaluation wrote it.
        as_json: Print JSON.
    """
    if size is not None:
        AtlasOptions(size=size)
    from ..files import check_whole, write_whole
    from ..geometry.metrics import measure
    from ..io.formats.npz import is_faces, write_faces
    from ..io.gltf.uvsets import with_set
    from ..io.meshfile import load

    force = force or (faces is not None and faces.is_file() and is_faces(faces))
    if faces is not None:
        check_whole(faces, force=force)
    asset = with_set(load(mesh), uv_set, Console().note)
    if asset.uv is None:
        raise InputError(
            f"{mesh} has no uv, expected a mesh that carries them; make some: flexpara unwrap {mesh} -o out/"
        )
    metrics = measure(asset.surface, asset.uv[asset.faces], size=size).to_dict()
    if faces is not None:
        write_whole(faces, lambda path: write_faces(path, asset), force=force)
    if as_json:
        sys.stdout.write(json.dumps(metrics, indent=2) + "\n")
    else:
        show(metrics, ())
    return 0


def sample(name: str, *, output: Output, resolution: int | None = None, force: Flag = False) -> int:
    """Write a procedural test surface.

    Args:
        name: The surface: sphere, torus, trefoil, gyroid, bracket, cloth, …
        output: The file to write: ply, obj, stl, off or glb.
        resolution: The number of edges along the longest line.
        force: Overwrite that file.
    """
    from ..files import check_whole, write_whole
    from ..samples import make_sample

    if output.suffix.lower() not in SAMPLE_FORMATS:
        expected = ", ".join(SAMPLE_FORMATS)
        raise InputError(f"output ends in {output.suffix or 'nothing'}, expected one of {expected}; rename {output}")
    check_whole(output, force=force)
    vertices, faces = make_sample(name) if resolution is None else make_sample(name, resolution=resolution)
    import trimesh

    mesh = trimesh.Trimesh(vertices, faces, process=False)
    write_whole(output, lambda path: mesh.export(path), force=force)
    return 0

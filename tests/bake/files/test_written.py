"""What stands in the files is what was meant: read by readers of this project, and by those of others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
import pytest
import trimesh
from numpy.typing import NDArray

from flexpara.bake.files.gltf import write_glb
from flexpara.bake.files.usd import write_usda
from flexpara.bake.files.written import Reading, corner_uv_of, written_report
from flexpara.bake.results.output import written_notes
from flexpara.runtime.errors import MeshError
from flexpara.runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from flexpara.runtime.io.obj.write import write_obj
from flexpara.runtime.io.ply.write import write_ply
from flexpara.runtime.mesh import Asset, Atlas

Pair = tuple[Atlas, Asset]
FORMATS = ("glb", "obj", "ply", "usda")
STEP = 2.0**-24
"""Multiples of it in [0, 1] are float32 numbers, and so is 1 minus each of them."""


def written(pair: Pair, folder: Path) -> dict[str, Path]:
    """The pair in every format."""
    atlas, asset = pair
    paths = {kind: folder / f"mesh.{kind}" for kind in FORMATS}
    write_glb(atlas, asset, {}, paths["glb"])
    write_obj(atlas, paths["obj"])
    write_ply(atlas, paths["ply"])
    write_usda(atlas, asset, {}, paths["usda"])
    return paths


def on_the_lattice(pair: Pair) -> Pair:
    """The pair with uv that are multiples of `STEP`, among them triangles one step high."""
    atlas, asset = pair
    uv = np.round(atlas.uv.astype(np.float64) / STEP) * STEP
    return replace(atlas, uv=uv.astype(np.float32)), asset


def needle(pair: Callable[..., Pair]) -> Pair:
    """Two triangles of 2⁻²⁴ uv in height, one above the other, near the lower border, where float32 is finest."""
    low = 3 * STEP
    uv = [[0.25, low], [0.75, low], [0.5, low + STEP], [0.5, low - STEP]]
    return pair([[0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.5, -1, 0]], [[0, 1, 2], [1, 0, 3]], uv)


def by_trimesh(path: Path) -> NDArray[np.float64]:
    """(f, 3, 2) float64 v up."""
    mesh: Any = trimesh.load(path, process=False, force="mesh")
    return np.asarray(mesh.visual.uv, np.float64)[mesh.faces]


def by_pygltflib(path: Path) -> NDArray[np.float64]:
    """(f, 3, 2) float64 as stored, v down."""
    document: Any = pygltflib.GLTF2().load(str(path))
    blob, primitive = document.binary_blob(), document.meshes[0].primitives[0]

    def accessor(number: int, kind: str, width: int) -> NDArray[Any]:
        found = document.accessors[number]
        start = document.bufferViews[found.bufferView].byteOffset or 0
        return np.frombuffer(blob, kind, found.count * width, start).reshape(-1, width)

    uv = accessor(primitive.attributes.TEXCOORD_0, "<f4", 2).astype(np.float64)
    return uv[accessor(primitive.indices, "<u2", 1).reshape(-1, 3)]


def by_usd(path: Path) -> NDArray[np.float64]:
    """(f, 3, 2) float64 v up."""
    usd, geometry = pytest.importorskip("pxr.Usd"), pytest.importorskip("pxr.UsdGeom")
    stage = usd.Stage.Open(str(path))
    (prim,) = [prim for prim in stage.Traverse() if prim.IsA(geometry.Mesh)]
    st = np.array(geometry.PrimvarsAPI(prim).GetPrimvar("st").Get(), np.float64)
    return st[np.array(geometry.Mesh(prim).GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)]


def test_every_format_holds_the_very_numbers(sphere: Pair, tmp_path: Path) -> None:
    exact = on_the_lattice(sphere)
    for path in written(exact, tmp_path).values():
        np.testing.assert_array_equal(corner_uv_of(path), exact[0].corner_uv, path.suffix)


def test_readers_of_others_find_the_same_numbers(sphere: Pair, tmp_path: Path) -> None:
    exact = on_the_lattice(sphere)
    paths = written(exact, tmp_path)
    stored = by_pygltflib(paths["glb"])
    np.testing.assert_array_equal(1.0 - stored[..., 1], exact[0].corner_uv[..., 1])
    np.testing.assert_array_equal(by_usd(paths["usda"]), exact[0].corner_uv)
    for kind in ("obj", "ply", "glb"):  # trimesh sorts corners of obj by their own order: compare as sets of triangles
        found, wanted = by_trimesh(paths[kind]), exact[0].corner_uv
        np.testing.assert_allclose(np.sort(found.reshape(-1, 6), 0), np.sort(wanted.reshape(-1, 6), 0), atol=1e-7)


def test_needles_stay_triangles_v_up_and_v_down(pair: Callable[..., Pair], tmp_path: Path) -> None:
    thin = needle(pair)
    paths = written(thin, tmp_path)
    down = by_pygltflib(paths["glb"])
    for uv in (down[:, ::-1], by_usd(paths["usda"]), *(corner_uv_of(path) for path in paths.values())):
        assert not flipped_triangles(uv).any()
        assert len(overlapping_pairs(uv)) == 0
    report = written_report(paths, thin[0].uv[thin[0].faces])
    clean = {"faces": 2, "flipped": 0, "overlapping": 0, "read_back": True}
    assert report == dict.fromkeys(FORMATS, clean)


def test_what_rounding_collapses_is_found(pair: Callable[..., Pair], tmp_path: Path) -> None:
    """A triangle a hundred times thinner than the lattice is one in the file with v up, and none with v down."""
    thin = pair([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], [[0.25, 1e-9], [0.75, 1e-9], [0.5, 1.5e-9]])
    report = written_report(written(thin, tmp_path), thin[0].uv[thin[0].faces])
    assert {kind: report[kind]["flipped"] for kind in FORMATS} == {"glb": 1, "obj": 0, "ply": 0, "usda": 0}
    assert written_notes(report) == ["the glb holds 1 flipped triangles and 0 pairs that overlap in uv"]
    unread = written_report(dict.fromkeys(FORMATS), thin[0].uv[thin[0].faces])
    assert unread == {kind: {**report[kind], "read_back": False} for kind in FORMATS}


def test_overlaps_are_found(pair: Callable[..., Pair], tmp_path: Path) -> None:
    twice = pair([[0, 0, 0], [1, 0, 0], [0, 1, 0]] * 2, [[0, 1, 2], [3, 4, 5]], [[0, 0], [0.5, 0], [0, 0.5]] * 2)
    report = written_report(written(twice, tmp_path), twice[0].uv[twice[0].faces])
    assert {found["overlapping"] for found in report.values()} == {1}
    paths = {kind: tmp_path / f"mesh.{kind}" for kind in FORMATS}
    believed = written_report(paths, twice[0].uv[twice[0].faces], Reading(apart=True))
    assert {found["overlapping"] for found in believed.values()} == {0}


def test_large_meshes_are_judged_by_what_was_serialized(quad: Pair, tmp_path: Path) -> None:
    report = written_report(written(quad, tmp_path), quad[0].uv[quad[0].faces], Reading(most=1))
    assert {found["read_back"] for found in report.values()} == {False}


def test_a_file_cut_short_is_named(quad: Pair, tmp_path: Path) -> None:
    for path in written(quad, tmp_path).values():
        path.write_bytes(path.read_bytes()[:120])
        with pytest.raises(MeshError, match=f"mesh{path.suffix} holds no triangles with uv"):
            corner_uv_of(path)
    with pytest.raises(MeshError, match=r"mesh\.stl: expected one of \.glb, \.gltf, \.obj, \.ply, \.usda"):
        corner_uv_of(tmp_path / "mesh.stl")

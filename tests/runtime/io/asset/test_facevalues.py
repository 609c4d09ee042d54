"""Values of faces by points, by a picture over the uv, and by vertex attributes of glTF, PLY and vertex colours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scenefile import Scene

from flexpara.runtime.errors import InputError, MissingFileError
from flexpara.runtime.io.asset.facevalues import face_values, read_points
from flexpara.runtime.io.asset.wantedseams import wanted_seams
from flexpara.runtime.io.meshfile import asset_from_arrays, load_asset
from flexpara.runtime.mesh import Asset
from flexpara.runtime.options.seams import SeamOptions

SQUARES = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0]]
FACES = [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]]


def squares(**more: object) -> Asset:
    """Two squares side by side in the plane, two triangles each."""
    return asset_from_arrays(SQUARES, FACES, **more)  # pyright: ignore[reportArgumentType]


def test_faces_near_a_point_have_one_and_all_others_none(tmp_path: Path) -> None:
    file = tmp_path / "points.npy"
    beside = squares().surface.triangles[2].mean(axis=0) + np.array([0.03, 0.0, 0.0])
    np.save(file, beside[None])
    assert face_values(squares(), file).tolist() == [0.0, 0.0, 1.0, 0.0]  # 0.02 of an extent of 2 is 0.04
    np.save(file, np.zeros((0, 3)))
    assert face_values(squares(), file).tolist() == [0.0] * 4


def test_a_picture_is_read_through_the_uv_with_row_0_at_the_top(tmp_path: Path) -> None:
    file, uv = tmp_path / "mask.png", np.array(SQUARES)[:, :2] / [2.0, 1.0]
    pixels = np.zeros((64, 64), np.uint8)
    pixels[:, 32:] = 255  # the right half is white
    Image.fromarray(pixels).save(file)
    assert face_values(squares(uv=uv), file).tolist() == [0.0, 0.0, 1.0, 1.0]
    assert face_values(squares(uv=uv + np.array([3.0, -2.0])), file).tolist() == [0.0, 0.0, 1.0, 1.0]  # it repeats
    Image.fromarray(pixels.T[::-1]).save(file)  # the upper half, v near 1
    lower, upper, *_ = face_values(squares(uv=uv), file)
    assert lower == pytest.approx(0.25, abs=0.06)
    assert upper == pytest.approx(0.75, abs=0.06)
    with pytest.raises(InputError, match="without uv"):
        face_values(squares(), file)
    with pytest.raises(MissingFileError, match="no file"):
        face_values(squares(), tmp_path / "none.png")


def test_channels_of_vertex_colours_are_named_by_their_colour() -> None:
    colors = np.zeros((6, 4), np.uint8)
    colors[[1, 2, 5]] = [0, 255, 51, 255]
    asset = squares(colors=colors)
    assert face_values(asset, Path("green")).tolist() == pytest.approx([1 / 3, 0.0, 1.0, 2 / 3])
    assert face_values(asset, Path("blue")).tolist() == pytest.approx([0.2 / 3, 0.0, 0.2, 0.4 / 3])
    with pytest.raises(InputError, match="red, green, blue, alpha, nor"):
        face_values(asset, Path("_PROTECT"))


def test_a_property_of_a_ply_file_is_found_by_its_name_after_cleaning(tmp_path: Path) -> None:
    file = tmp_path / "squares.ply"
    head = ["ply", "format ascii 1.0", "element vertex 7", *(f"property float {name}" for name in "xyz")]
    head += ["property uchar keep", "property float other", "element face 4"]
    head += ["property list uchar int vertex_indices", "end_header"]
    keep = [0, 255, 255, 0, 0, 255]
    rows = ["9 9 9 255 1"]  # used by no face: all numbers after it are one more
    rows += [f"{x} {y} {z} {k} nan" for (x, y, z), k in zip(SQUARES, keep, strict=True)]
    rows += ["3 " + " ".join(str(corner + 1) for corner in face) for face in FACES]
    file.write_text("\n".join([*head, *rows]) + "\n", encoding="utf-8")
    asset = load_asset(file)
    assert len(asset.positions) == 6
    assert face_values(asset, Path("keep")).tolist() == pytest.approx([1 / 3, 0.0, 1.0, 2 / 3])
    assert face_values(asset, Path("other")).tolist() == [0.0] * 4  # nan counts as 0
    with pytest.raises(InputError, match="has keep, other, nor"):
        face_values(asset, Path("x"))


def test_an_attribute_of_gltf_is_taken_where_parts_have_it_and_must_be_a_scalar(tmp_path: Path) -> None:
    scene = Scene()
    marked = np.array([[0], [0], [1], [1], [1], [1]], np.float32)
    first = scene.strip(2, 0.0, _KEEP=marked, _WIDE=np.ones((6, 2), np.float32))
    scene.tree |= {
        "meshes": [{"primitives": [first, scene.strip(1, 5.0)]}], "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}],
    }  # fmt: skip
    file = tmp_path / "scene.glb"
    file.write_bytes(scene.glb())
    asset = load_asset(file)
    assert face_values(asset, Path("_KEEP")).tolist() == pytest.approx([2 / 3, 1 / 3, 1.0, 1.0, 0.0, 0.0])
    with pytest.raises(InputError, match="2 numbers a vertex"):
        face_values(asset, Path("_WIDE"))
    with pytest.raises(InputError, match="has _KEEP, _WIDE, nor"):
        face_values(asset, Path("_NONE"))


def test_points_are_read_and_anything_else_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "points.npy"
    np.save(file, np.eye(3, dtype=np.float32))
    assert np.array_equal(read_points(file), np.eye(3))
    found = wanted_seams(squares(), SeamOptions(protect=file), 30.0)
    assert found.cut is None
    assert found.protected is not None
    assert found.protected.shape == (4,)
    for wrong in (np.zeros((2, 2)), np.full((1, 3), np.nan), np.array([["a", "b", "c"]])):
        np.save(file, wrong)
        with pytest.raises(InputError, match="finite points"):
            read_points(file)
    file.write_bytes(b"no array")
    with pytest.raises(InputError, match="can't be read"):
        read_points(file)
    with pytest.raises(MissingFileError, match=r"\.npy"):
        read_points(tmp_path / "none.npy")

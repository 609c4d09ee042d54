"""OBJ: face i of the file is face i of the mesh, whatever the materials, quads and relative indices."""

from __future__ import annotations

import io
from collections.abc import Callable

import numpy as np
import pytest
from PIL import Image

from flexpara.runtime.errors import InputError
from flexpara.runtime.io.obj.read import read_obj
from flexpara.runtime.io.pictures.pictures import OTHERS
from flexpara.runtime.io.rawmesh import RawMesh

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def nothing(_: str) -> bytes | None:
    return None


def read(text: str, siblings: Callable[[str], bytes | None] = nothing) -> RawMesh:
    return read_obj(text.encode(), siblings)


def nonzero(raw: RawMesh) -> dict[str, int]:
    return {name: count for name, count in raw.changes.items() if count}


def corners(raw: RawMesh) -> list[list[list[float]]]:
    return raw.positions[raw.faces].tolist()


def test_one_triangle() -> None:
    raw = read("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    np.testing.assert_array_equal(raw.positions, [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    np.testing.assert_array_equal(raw.faces, [[0, 1, 2]])
    assert (raw.uv, raw.normals, raw.colors, raw.face_material) == (None, None, None, None)


def test_polygons_become_fans_in_their_place() -> None:
    raw = read(SQUARE + "v 2 0.5 0\nf 1 2 3 4\nf 2 5 3\nf 1 2 5 3 4\n")
    np.testing.assert_array_equal(raw.faces, [[0, 1, 2], [0, 2, 3], [1, 4, 2], [0, 1, 4], [0, 4, 2], [0, 2, 3]])


def test_relative_indices_count_back_from_their_own_line() -> None:
    raw = read("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 5 0 0\nv 6 0 0\nv 5 1 0\nf -3 -2 -1\n")
    np.testing.assert_array_equal(raw.faces, [[0, 1, 2], [3, 4, 5]])


def test_vertices_split_only_where_uv_differ_and_stay_in_file_order() -> None:
    raw = read(SQUARE + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 0.5 0.5\nf 1/1 2/2 3/3\nf 1/1 3/5 4/4\n")
    assert raw.uv is not None
    np.testing.assert_array_equal(raw.positions[:, :2], [[0, 0], [1, 0], [1, 1], [1, 1], [0, 1]])
    np.testing.assert_array_equal(raw.uv[raw.faces], [[[0, 0], [1, 0], [1, 1]], [[0, 0], [0.5, 0.5], [0, 1]]])


def test_normals_are_read_with_and_without_uv() -> None:
    for corner in ("{0}//1", "{0}/1/1"):
        face = "f " + " ".join(corner.format(i) for i in (1, 2, 3))
        raw = read(f"{SQUARE}vt 0.25 0.75\nvn 0 0 1\n{face}\n")
        assert raw.normals is not None
        np.testing.assert_array_equal(raw.normals[raw.faces], np.tile([0.0, 0.0, 1.0], (1, 3, 1)))


def test_normals_on_some_corners_only_are_no_normals() -> None:
    assert read(f"{SQUARE}vn 0 0 1\nf 1//1 2//1 3//1\nf 1 3 4\n").normals is None


def test_faces_without_uv_among_others_are_counted() -> None:
    raw = read(f"{SQUARE}vt 0.5 0.5\nf 1/1 2/1 3/1\nf 1 3 4\n")
    assert raw.uv is not None
    assert nonzero(raw) == {"faces_without_uv": 1}
    np.testing.assert_array_equal(raw.uv[raw.faces[1]], np.zeros((3, 2)))


@pytest.mark.parametrize("scale", [1.0, 255.0])
def test_vertex_colours_are_read_in_both_ranges(scale: float) -> None:
    rows = [(0, 0, 0, 1, 0, 0), (1, 0, 0, 0, 0.2, 0), (0, 1, 0, 0, 0, 1)]
    text = "".join(f"v {x} {y} {z} {r * scale} {g * scale} {b * scale}\n" for x, y, z, r, g, b in rows)
    raw = read(text + "f 1 2 3\n")
    np.testing.assert_array_equal(raw.colors, [[255, 0, 0, 255], [0, 51, 0, 255], [0, 0, 255, 255]])


def test_untidy_text_is_read() -> None:
    raw = read(
        "# made by hand\r\n  v\t0 0 0 # origin\r\nv 1e0 0 0\r\nv 0 1 0\r\n\r\ng a b\r\ns off\r\nf 1 \\\r\n 2 3 # last"
    )
    np.testing.assert_array_equal(raw.faces, [[0, 1, 2]])


def test_materials_keep_the_order_of_the_faces() -> None:
    library = b"newmtl red\nKd 1 0 0\nd 0.5\nnewmtl blue\nKd 0 0 1\nnewmtl unused\nKd 0 1 0\n"
    text = f"mtllib a.mtl\n{SQUARE}f 1 2 3\nusemtl blue\nf 1 3 4\nusemtl red\nf 1 2 4\nusemtl blue\nf 2 3 4\n"
    raw = read(text, {"a.mtl": library}.get)
    assert raw.face_material is not None
    names = [raw.materials[index].name for index in raw.face_material]
    assert names == ["default", "blue", "red", "blue"]
    factors = {material.name: material.base_color_factor for material in raw.materials}
    assert factors == {"default": (1, 1, 1, 1), "blue": (0, 0, 1, 1), "red": (1, 0, 0, 0.5)}
    np.testing.assert_array_equal(raw.faces, [[0, 1, 2], [0, 2, 3], [0, 1, 3], [1, 2, 3]])


def test_a_texture_is_read_with_row_0_on_top() -> None:
    pixels = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, format="PNG")
    files = {"a.mtl": b"newmtl m\nKd 0.1 0.1 0.1\nmap_Kd -s 1 1 1 skin.png\n", "skin.png": stream.getvalue()}
    raw = read(f"mtllib a.mtl\n{SQUARE}usemtl m\nf 1 2 3\n", files.get)
    np.testing.assert_array_equal(raw.materials[0].pictures["base-color"].pixels, pixels)
    assert raw.materials[0].base_color_factor == (1.0, 1.0, 1.0, 1.0)


def test_comments_behind_the_values_of_a_material_are_none_of_them() -> None:
    stream = io.BytesIO()
    Image.fromarray(np.full((2, 2, 4), 7, np.uint8)).save(stream, format="PNG")
    text = b"newmtl m\nKd 1 0 0 # red (say)\nd 0.5\t# half\nPr 0.25 #\nmap_Ke a b.png # glow\nmap_Kd #1 #2.png\n"
    files = {"a.mtl": text, "a b.png": stream.getvalue(), "#1 #2.png": stream.getvalue()}
    (material,) = read(f"mtllib a.mtl\n{SQUARE}usemtl m\nf 1 2 3\n", files.get).materials
    assert material.base_color_factor == (1, 1, 1, 0.5)
    assert material.roughness == 0.25
    assert set(material.pictures) == {"emissive", "base-color"}


@pytest.mark.parametrize("begin", OTHERS)
def test_a_texture_of_another_kind_of_picture_is_left_out_and_counted(begin: bytes) -> None:
    files = {"a.mtl": b"newmtl m\nmap_Kd skin.dds", "skin.dds": begin + bytes(100)}
    raw = read(f"mtllib a.mtl\n{SQUARE}usemtl m\nf 1 2 3\n", files.get)
    assert nonzero(raw) == {"missing_textures": 1}
    assert raw.materials[0].pictures == {}


def test_what_is_missing_is_counted() -> None:
    raw = read(
        f"mtllib a.mtl b.mtl\nmtllib gone.mtl\n{SQUARE}usemtl m\nf 1 2 3\n",
        {"a.mtl b.mtl": b"newmtl m\nmap_Kd x.png"}.get,
    )
    assert nonzero(raw) == {"missing_materials": 1, "missing_textures": 1}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        ("\nhello\n", "it begins with 'hello'"),
        (SQUARE, "points and no faces"),
        (f"{SQUARE}f 1 2\n", "all 1 faces have under three corners .first: line 5"),
        (f"{SQUARE}f 1 2 5\n", "line 5 refers to vertex 5, expected 1 to 4"),
        (f"{SQUARE}f 1 2 3\n\nf 0 1 2\n", "line 7 refers to vertex 0"),
        (f"{SQUARE}f 1 2 -5\n", "line 5 refers to vertex -5"),
        (f"{SQUARE}f 1 2 3\nf a b c\n", "line 6 has the corner 'a'"),
        (f"{SQUARE}f 1 2 3.5\n", "line 5 has the corner '3.5'"),
        (f"{SQUARE}f 1 2 99999999999999999999\n", "line 5 has the corner '99999999999999999999'"),
        ("v 0\nf 1 1 1\n", "line 1 has 1 numbers"),
        ("v 0 0 0\nv 0 0 zero\nf 1 1 1\n", "line 2 holds what is no number .'0 0 zero'"),
        ("v 0 0 0\n# ok\nv nan 0 0\nf 1 2 1\n", "vertex 2 .line 3. has NaN"),
        ("f 1 2 3\n", "line 1 refers to vertex 1, expected 1 to 0"),
        (f"mtllib a.mtl\n{SQUARE}usemtl m\nf 1 2 3\n", "no picture that is read"),
    ],
)
def test_damage_is_named_in_one_line(text: str, message: str) -> None:
    files = {"a.mtl": b"newmtl m\nmap_Kd a.png", "a.png": b"no picture"}
    with pytest.raises(InputError, match=message) as caught:
        read(text, files.get)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("face", ["f 1/ 2/ 3/", "f 1// 2// 3//", "f 1 2/ 3//"])
def test_empty_places_behind_slashes_mean_absent(face: str) -> None:
    raw = read(f"{SQUARE}vt 0 0\nvn 0 0 1\n{face}\n")
    np.testing.assert_array_equal(raw.faces, [[0, 1, 2]])
    assert (raw.uv, raw.normals) == (None, None)


def test_mixed_corners_read_like_uniform_ones() -> None:
    head = f"{SQUARE}vt 0 0\nvt 1 1\nvn 0 0 1\nvn 1 0 0\n"
    mixed = read(head + "f 1/1/1 2/2/2 3/1/1\nf 1//1 3//2 4//1\n")
    assert mixed.normals is not None
    np.testing.assert_array_equal(mixed.normals[mixed.faces][:, :, 0], [[0, 1, 0], [0, 1, 0]])
    assert nonzero(mixed) == {"faces_without_uv": 1}


def test_uv_and_normals_that_are_not_there_count_as_absent() -> None:
    raw = read(f"{SQUARE}vt 0 0\nf 1/1/1 2/9/1 3/1/1\n")
    assert raw.normals is None
    assert nonzero(raw) == {"missing_uv_or_normals": 4, "faces_without_uv": 1}
    assert read(f"{SQUARE}f 1/1 2/1 3/1\n").uv is None


def test_faces_under_three_corners_are_skipped_and_counted_lines_and_points_kept_as_text() -> None:
    raw = read(f"{SQUARE}f 1 2\nf 1 2 3\nl 1 2 3\np 1 2\nl 1 2\n")
    np.testing.assert_array_equal(raw.faces, [[0, 1, 2]])
    assert nonzero(raw) == {"faces_under_three_corners": 1}
    assert raw.obj is not None
    assert raw.obj.beyond_meshes() == {"skipped_lines": 2, "skipped_points": 1}


def test_vertices_of_two_numbers_lie_at_z_0() -> None:
    raw = read("v 1 2\nv 3 4 5\nv 6 7\nf 1 2 3\n")
    np.testing.assert_array_equal(raw.positions, [[1, 2, 0], [3, 4, 5], [6, 7, 0]])
    assert nonzero(raw) == {"vertices_without_z": 2}
    np.testing.assert_array_equal(read("v 1 2\nv 3 4\nv 6 7\nf 1 2 3\n").positions[:, 2], 0.0)


def test_a_colour_beyond_all_numbers_is_cut_off() -> None:
    """Without a warning: those are errors here."""
    mesh = read_obj(b"v 0 0 0 1 -1e308 0\nv 1 0 0 0 -inf 0\nv 0 1 0 0 0 1\nf 1 2 3\n", lambda _: None)
    assert mesh.colors is not None
    assert mesh.colors[:, :3].tolist() == [[255, 0, 0], [0, 0, 0], [0, 0, 255]]


def test_vertices_without_colours_among_others_are_white_and_counted() -> None:
    raw = read("v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0 0 0 1\nf 1 2 3\n")
    np.testing.assert_array_equal(raw.colors, [[255, 0, 0, 255], [255, 255, 255, 255], [0, 0, 255, 255]])
    assert nonzero(raw) == {"vertices_without_colors": 1}


def test_a_concave_polygon_keeps_its_area() -> None:
    raw = read("v 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nv 0 0 0\nf 1 2 3 4 5 6\n")
    corner = raw.positions[raw.faces]
    assert np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2].min() > 0
    assert np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2].sum() == 6.0


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_every_encoding_and_line_end_reads_alike(encoding: str, end: str) -> None:
    text = "# Maßstab\x85 mü\no Körper\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl Stück\nf 1 2 3\n".replace("\n", end)
    raw = read_obj(text.encode(encoding), nothing)
    np.testing.assert_array_equal(raw.positions[raw.faces], [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    assert raw.materials[0].name == "Stück"


def test_uv_of_one_number_have_v_0() -> None:
    raw = read(f"{SQUARE}vt 0.25\nvt 0.5 0.75\nf 1/1 2/2 3/2\n")
    assert raw.uv is not None
    np.testing.assert_array_equal(raw.uv[raw.faces[0]], [[0.25, 0], [0.5, 0.75], [0.5, 0.75]])


def test_a_line_may_name_several_material_libraries() -> None:
    files = {"a.mtl": b"newmtl one\nKd 1 0 0\n", "b.mtl": b"newmtl two\nKd 0 1 0\n"}
    raw = read(f"mtllib a.mtl b.mtl\n{SQUARE}usemtl one\nf 1 2 3\nusemtl two\nf 1 3 4\n", files.get)
    assert [material.base_color_factor[:2] for material in raw.materials] == [(1, 0), (0, 1)]
    assert not nonzero(raw)

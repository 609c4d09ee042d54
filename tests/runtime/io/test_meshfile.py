"""Files → Asset: formats through trimesh, hostile files, real meshes; and the same from arrays."""

from __future__ import annotations

import hashlib
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from flexpara.runtime.errors import MeshError, MissingDependencyError, MissingFileError, ShapeError
from flexpara.runtime.io.meshfile import asset_from_arrays, load_asset
from flexpara.runtime.samples import make_sample

TRIANGLE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
SQUARE_PLY = """ply
format ascii 1.0
{comment}element vertex 4
property float x
property float y
property float z
{vertex}element face 2
property list uchar int vertex_indices
{face}end_header
"""


def ply(rows: list[str], faces: list[str], *, vertex: str = "", face: str = "", comment: str = "") -> str:
    head = SQUARE_PLY.format(vertex=vertex, face=face, comment=comment)
    return head + "\n".join([*rows, *faces]) + "\n"


@pytest.mark.parametrize("kind", ["obj", "ply", "stl", "off", "glb"])
def test_a_solid_reads_the_same_from_every_format(tmp_path: Path, kind: str) -> None:
    vertices, faces = make_sample("torus", resolution=12)
    single = vertices.astype(np.float32).astype(np.float64)
    trimesh.Trimesh(single, faces, process=False).export(tmp_path / f"a.{kind}")
    asset = load_asset(tmp_path / f"a.{kind}")
    np.testing.assert_allclose(asset.surface.triangles, single[faces], atol=1e-7)
    np.testing.assert_array_equal(asset.surface.faces, faces if kind != "stl" else asset.surface.faces)
    assert set(asset.changes) <= {"welded_vertices"}
    assert asset.colors is None
    assert asset.uv is None
    assert asset.stem == "a"
    assert asset.sha256 == hashlib.sha256((tmp_path / f"a.{kind}").read_bytes()).hexdigest()
    assert not any(material.pictures for material in asset.materials)


def test_extensions_are_read_in_any_case(tmp_path: Path) -> None:
    trimesh.creation.box().export(tmp_path / "a.stl")
    (tmp_path / "a.stl").rename(tmp_path / "a.STL")
    assert len(load_asset(tmp_path / "a.STL").faces) == 12


@pytest.mark.parametrize(("u", "v"), [("s", "t"), ("u", "v"), ("texture_u", "texture_v")])
def test_ply_keeps_vertex_order_with_uv_normals_and_colours(tmp_path: Path, u: str, v: str) -> None:
    names = ["float nx", "float ny", "float nz", f"float {u}", f"float {v}", "uchar red", "uchar green", "uchar blue"]
    rows = [f"{x} {y} 0 0 0 1 {x / 2} {y / 4} {10 * x} {20 * y} 30" for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    text = ply(rows, ["3 3 0 2", "3 0 1 2"], vertex="".join(f"property {name}\n" for name in names))
    (tmp_path / "a.ply").write_text(text)
    asset = load_asset(tmp_path / "a.ply")
    np.testing.assert_array_equal(asset.positions[:, :2], [[0, 0], [1, 0], [1, 1], [0, 1]])
    np.testing.assert_array_equal(asset.faces, [[3, 0, 2], [0, 1, 2]])
    np.testing.assert_array_equal(asset.uv, [[0, 0], [0.5, 0], [0.5, 0.25], [0, 0.25]])
    np.testing.assert_array_equal(asset.normals, [[0, 0, 1]] * 4)
    np.testing.assert_array_equal(
        asset.colors, [[0, 0, 30, 255], [10, 0, 30, 255], [10, 20, 30, 255], [0, 20, 30, 255]]
    )
    assert asset.materials == ()


def test_ply_with_uv_per_corner_splits_there_and_takes_the_texture(tmp_path: Path) -> None:
    Image.fromarray(np.full((2, 2, 4), 77, dtype=np.uint8)).save(tmp_path / "skin.png")
    rows = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"]
    faces = ["3 0 1 2 6 0 0 1 0 1 1", "3 0 2 3 6 0.5 0.5 1 1 0 1"]
    text = ply(rows, faces, face="property list uchar float texcoord\n", comment="comment TextureFile skin.png\n")
    (tmp_path / "a.ply").write_text(text)
    asset = load_asset(tmp_path / "a.ply")
    assert asset.uv is not None
    np.testing.assert_array_equal(asset.uv[asset.faces], [[[0, 0], [1, 0], [1, 1]], [[0.5, 0.5], [1, 1], [0, 1]]])
    assert len(asset.positions) == 5
    assert asset.changes == {"welded_vertices": 1}
    np.testing.assert_array_equal(asset.materials[0].pictures["base-color"].pixels, np.full((2, 2, 4), 77))


def test_face_colours_split_vertices_where_they_differ(tmp_path: Path) -> None:
    names = "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
    text = ply(["0 0 0", "1 0 0", "1 1 0", "0 1 0"], ["3 0 1 2 255 0 0", "3 0 2 3 0 0 255"], face=names)
    (tmp_path / "a.ply").write_text(text)
    asset = load_asset(tmp_path / "a.ply")
    assert asset.colors is not None
    red, blue = asset.colors[asset.faces]
    assert (red == (255, 0, 0, 255)).all()
    assert (blue == (0, 0, 255, 255)).all()
    assert asset.changes == {"welded_vertices": 2}


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.obj", b"", "the file is empty"),
        ("a.obj", b"# nothing\n", "no face"),
        ("a.stl", b"", "a.stl"),
        ("a.stl", b"nothing", "a.stl"),
        ("a.stl", b"\0" * 80 + struct.pack("<I", 4_000_000_000), r"a\.stl"),
        ("a.ply", b"nothing", "no PLY header"),
        ("a.ply", b"ply\nformat binary_little_endian 1.0\nelement vertex 999999999999\n", "a.ply"),
        ("a.off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n", "a.off"),
        ("a.md", b"hello", r"extension '\.md'"),
        ("a", b"hello", "extension ''"),
        ("a.json", b"{}", "no mesh format"),
        ("a.zip", b"PK", "no mesh format"),
        ("a.svg", b"<svg/>", "no mesh format"),
        ("a.dxf", b"", "no mesh format"),
        ("a.xyz", b"0 0 0\n1 1 1\n", "points and no faces"),
        ("a.glb", b"glTF", "damaged"),
    ],
)
def test_what_is_no_mesh_says_so_in_one_line(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(MeshError, match=message) as caught:
        load_asset(tmp_path / name)
    assert "\n" not in str(caught.value)
    assert caught.value.exit_code == 2


def test_a_point_cloud_is_told_apart_from_damage(tmp_path: Path) -> None:
    trimesh.PointCloud(np.random.default_rng(0).random((5, 3))).export(tmp_path / "a.ply")
    with pytest.raises(MeshError, match=r"points and no faces.* flexpara unwrap takes point clouds"):
        load_asset(tmp_path / "a.ply")


def test_indices_out_of_range_are_refused_in_ply(tmp_path: Path) -> None:
    for wrong in (7, -1):
        (tmp_path / "a.ply").write_text(ply(["0 0 0", "1 0 0", "1 1 0", "0 1 0"], ["3 0 1 2", f"3 0 2 {wrong}"]))
        with pytest.raises(MeshError):
            load_asset(tmp_path / "a.ply")


def test_nan_is_refused_in_a_file(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(MeshError, match=r"a\.obj: vertex 2 \(line 2\) has NaN"):
        load_asset(tmp_path / "a.obj")


def test_missing_files_and_folders_are_named(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match=r"none\.obj does not exist"):
        load_asset(tmp_path / "none.obj")
    with pytest.raises(MeshError, match="is a folder"):
        load_asset(tmp_path)


def test_an_archive_that_unpacks_to_too_much_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FLEXPARA_LIMITS", "bytes=10000")
    monkeypatch.setattr("flexpara.runtime.io.formats.others.mesh_loaders", {"3mf": None, "3dxml": dict})
    with zipfile.ZipFile(tmp_path / "a.3dxml", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("big", b"\0" * 1_000_000)
    with pytest.raises(MeshError, match="unpacks to 1000000 bytes"):
        load_asset(tmp_path / "a.3dxml")


def test_a_format_whose_reader_is_absent_names_the_remedy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from trimesh.exceptions import ExceptionWrapper

    monkeypatch.setattr(
        "flexpara.runtime.io.formats.others.mesh_loaders", {"dae": ExceptionWrapper(ImportError("collada"))}
    )
    (tmp_path / "a.dae").write_text("")
    with pytest.raises(MissingDependencyError, match="pip install"):
        load_asset(tmp_path / "a.dae")


@pytest.mark.parametrize("name", ["../skin.png", "/tmp/../etc/skin.png", "C:\\art\\skin.png"])
def test_an_obj_reaches_no_picture_outside_its_folder(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "inside"
    folder.mkdir()
    Image.fromarray(np.zeros((1, 1, 4), dtype=np.uint8)).save(tmp_path / "skin.png")
    (folder / "a.mtl").write_text(f"newmtl m\nmap_Kd {name}\n")
    (folder / "a.obj").write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n")
    asset = load_asset(folder / "a.obj")
    assert not asset.materials[0].pictures
    assert asset.changes == {"missing_textures": 1}
    Image.fromarray(np.full((1, 1, 4), 9, dtype=np.uint8)).save(folder / "skin.png")
    (material,) = load_asset(folder / "a.obj").materials
    np.testing.assert_array_equal(material.pictures["base-color"].pixels, [[[9, 9, 9, 9]]])


def test_arrays_are_cleaned_like_files() -> None:
    asset = asset_from_arrays(
        TRIANGLE.astype(np.float32).tolist(),
        [[0, 1, 2], [2, 1, 2]],
        normals=[[0, 0, 2]] * 3,
        colors=[[1.0, 0.5, 0.0]] * 3,
        uv=TRIANGLE[:, :2],
        stem="thing",
    )
    assert asset.changes == {"degenerate_faces": 1}
    assert (asset.stem, asset.sha256) == ("thing", "")
    np.testing.assert_array_equal(asset.normals, [[0, 0, 1]] * 3)
    np.testing.assert_array_equal(asset.colors, [[255, 128, 0, 255]] * 3)
    np.testing.assert_array_equal(asset.uv, TRIANGLE[:, :2])


def test_the_caller_keeps_their_arrays() -> None:
    positions, faces = TRIANGLE.copy(), np.array([[0, 1, 2]])
    asset = asset_from_arrays(positions, faces)
    positions[:], faces[:] = 7.0, 0
    np.testing.assert_array_equal(asset.surface.triangles, [TRIANGLE])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"positions": TRIANGLE[:, :2]}, r"positions has shape \(3, 2\).*expected \(n, 3\) numbers"),
        ({"positions": TRIANGLE.T[:2]}, None),
        ({"faces": [[0, 1, 2, 0]]}, r"faces has shape \(1, 4\)"),
        ({"faces": [[0.0, 1.0, 2.0]]}, "dtype float64.*integers"),
        ({"faces": [0, 1, 2]}, r"faces has shape \(3,\)"),
        ({"normals": TRIANGLE[:2]}, r"expected \(3, 3\)"),
        ({"colors": np.zeros((3, 4), dtype=np.int64)}, "colors has"),
        ({"colors": np.zeros((3, 4), dtype=np.uint16)}, "expected uint8"),
        ({"uv": TRIANGLE}, r"expected \(3, 2\)"),
    ],
)
def test_arrays_of_another_shape_are_refused(arguments: dict[str, np.ndarray], message: str | None) -> None:
    whole = {"positions": TRIANGLE, "faces": [[0, 1, 2]], **arguments}
    with pytest.raises((ShapeError, MeshError), match=message or "face 0") as caught:
        asset_from_arrays(**whole)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", ["stl", "ply", "off", "obj"])
def test_no_damaged_byte_gets_past_the_errors(tmp_path: Path, kind: str) -> None:
    vertices, faces = make_sample("torus", resolution=6)
    trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / f"a.{kind}")
    whole = np.frombuffer((tmp_path / f"a.{kind}").read_bytes(), dtype=np.uint8)
    rng = np.random.default_rng(0)
    for _ in range(60):
        damaged = whole[: rng.integers(len(whole) // 2, len(whole) + 1)].copy()
        damaged[rng.integers(0, len(damaged), 3)] = rng.integers(0, 256, 3)
        (tmp_path / f"b.{kind}").write_bytes(damaged.tobytes())
        try:
            asset = load_asset(tmp_path / f"b.{kind}")
        except MeshError:
            continue
        assert np.isfinite(asset.positions).all()


@pytest.mark.parametrize("name", ["bunny", "spot", "fandisk", "suzanne"])
def test_real_meshes_keep_their_faces_in_order(
    models: Path, facts: dict[str, tuple[int, dict[str, int]]], name: str
) -> None:
    asset = load_asset(models / f"{name}.obj")
    assert (len(asset.faces), asset.changes) == facts[name]
    text = (models / f"{name}.obj").read_text().splitlines()
    points = np.array([line.split()[1:4] for line in text if line.startswith("v ")], dtype=np.float64)
    corners = np.array(
        [[int(word.split("/")[0]) for word in line.split()[1:4]] for line in text if line.startswith("f ")]
    )
    if all(len(line.split()) == 4 for line in text if line.startswith("f ")):
        np.testing.assert_array_equal(asset.positions[asset.faces], points[corners - 1])


@pytest.mark.parametrize(
    ("name", "remedy"),
    [
        ("a.fbx", "import it in Blender and export glTF"),
        ("a.blend", "export glTF"),
        ("a.usdz", "export .glb"),
        ("a.igs", "tessellate them"),
        ("a.max", "export .glb or .obj there"),
    ],
)
def test_formats_that_people_bring_and_none_reads_name_the_way_out(tmp_path: Path, name: str, remedy: str) -> None:
    (tmp_path / name).write_bytes(b"Kaydara FBX Binary  ")
    with pytest.raises(MeshError, match=remedy):
        load_asset(tmp_path / name)


@pytest.mark.parametrize("kind", ["3mf", "dae"])
def test_formats_of_the_extra_come_in_with_their_triangles(tmp_path: Path, kind: str) -> None:
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    box.export(tmp_path / f"box.{kind}")
    found = load_asset(tmp_path / f"box.{kind}")
    assert len(found.faces) == 12
    np.testing.assert_allclose(np.sort(np.ptp(found.positions, axis=0)), [1.0, 2.0, 3.0], atol=1e-6)
    assert found.surface.face_areas().sum() == pytest.approx(22.0)


def test_what_trimesh_passes_over_in_collada_is_counted(tmp_path: Path) -> None:
    pytest.importorskip("collada")
    box = trimesh.creation.box()
    box.export(tmp_path / "box.dae")
    text = (tmp_path / "box.dae").read_text(encoding="utf-8")
    more = "<up_axis>Z_UP</up_axis>", "<!-- <instance_camera url='#c'/><animation id='a'/> <vcount>3 4 5</vcount> -->"
    text = text.replace("<up_axis>Y_UP</up_axis>", more[0]) + more[1]
    (tmp_path / "more.dae").write_text(text, encoding="utf-8")
    found, plain = (load_asset(tmp_path / name).changes for name in ("more.dae", "box.dae"))
    assert {name: count for name, count in found.items() if name not in plain} == {
        "kept_axes": 1,
        "skipped_cameras": 1,
        "skipped_animations": 1,
        "polygons_as_triangles": 2,
    }

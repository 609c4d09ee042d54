"""OBJ and PLY: what is written is what other readers and our own read back, exactly."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from flexpara.runtime.errors import InputError, ShapeError
from flexpara.runtime.io.meshfile import asset_from_arrays, load_asset
from flexpara.runtime.io.obj.write import write_obj
from flexpara.runtime.io.ply.write import write_ply
from flexpara.runtime.mesh import Atlas
from flexpara.runtime.samples import make_sample


def atlas_of(vertices: np.ndarray, faces: np.ndarray, corner_uv: np.ndarray) -> Atlas:
    """Split vertices wherever corner uv differ, numbered in an order that is not the source's."""
    key = np.concatenate([corner_uv.reshape(-1, 2), faces.reshape(-1, 1)], axis=1)
    distinct, inverse = np.unique(key, axis=0, return_inverse=True)
    source = distinct[:, 2].astype(np.int64)
    normals = np.cross(vertices[source], [0.3, 0.5, 0.7]).astype(np.float32)
    return Atlas(
        positions=vertices[source],
        faces=inverse.reshape(-1, 3).astype(np.int64),
        uv=distinct[:, :2].astype(np.float32),
        normals=normals / np.linalg.norm(normals, axis=1, keepdims=True),
        face_chart=np.zeros(len(faces), dtype=np.int64),
        source_vertex=source,
        size=64,
        padding=2,
    )


def uv_of(mesh: trimesh.Trimesh) -> np.ndarray:
    return np.asarray(getattr(mesh.visual, "uv", None))


@pytest.fixture
def solid() -> tuple[np.ndarray, np.ndarray, Atlas]:
    """A torus at a position that float32 can't hold, every tenth face with uv of its own."""
    vertices, faces = make_sample("torus", resolution=24)
    vertices = vertices / 3.0 + 1234.567
    rng = np.random.default_rng(0)
    uv = rng.random((len(vertices), 2)).astype(np.float32)[faces].astype(np.float64)
    uv[::10] = rng.random((len(uv[::10]), 3, 2)).astype(np.float32)
    return vertices, faces, atlas_of(vertices, faces, uv)


def test_obj_of_one_triangle_is_the_text_one_expects(tmp_path: Path) -> None:
    vertices = np.array([[0.1, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0 / 3.0, 0.0]])
    atlas = atlas_of(vertices, np.array([[0, 1, 2]]), np.array([[[0.0, 0.0], [0.5, 0.0], [0.0, 0.25]]]))
    flat = Atlas(**{**vars(atlas), "normals": np.tile(np.array([0, 0, 1], dtype=np.float32), (3, 1))})
    write_obj(flat, tmp_path / "a.obj", texture="a b.png")
    assert (tmp_path / "a.obj").read_text().splitlines()[1:] == [
        "mtllib a.mtl",
        "v 0.1 0.0 0.0",
        "v 1.0 0.0 0.0",
        "v 0.0 0.3333333333333333 0.0",
        "vt 0.0 0.0",
        "vt 0.0 0.25",
        "vt 0.5 0.0",
        "vn 0.0 0.0 1.0",
        "usemtl atlas",
        "f 1/1/1 2/3/1 3/2/1",
    ]
    assert "map_Kd a b.png" in (tmp_path / "a.mtl").read_text().splitlines()


def test_obj_splits_uv_and_nothing_else(tmp_path: Path, solid: tuple[np.ndarray, np.ndarray, Atlas]) -> None:
    vertices, faces, atlas = solid
    write_obj(atlas, tmp_path / "a.obj")
    lines = (tmp_path / "a.obj").read_text().splitlines()
    positions = np.array([line.split()[1:] for line in lines if line.startswith("v ")], dtype=np.float64)
    corners = np.array([[word.split("/") for word in line.split()[1:]] for line in lines if line.startswith("f ")])
    np.testing.assert_array_equal(positions, vertices)
    np.testing.assert_array_equal(corners[:, :, 0].astype(np.int64) - 1, faces)
    assert len(atlas.uv) > len(vertices)
    assert sum(line.startswith("vt ") for line in lines) == len(atlas.uv)
    assert not list(tmp_path.glob("*.mtl"))


def test_obj_reads_back_exactly(tmp_path: Path, solid: tuple[np.ndarray, np.ndarray, Atlas]) -> None:
    vertices, faces, atlas = solid
    write_obj(atlas, tmp_path / "a.obj")
    back = load_asset(tmp_path / "a.obj")
    assert back.uv is not None
    assert back.normals is not None
    np.testing.assert_array_equal(back.positions[back.faces], vertices[faces])
    np.testing.assert_array_equal(back.uv[back.faces], atlas.corner_uv)
    np.testing.assert_array_equal(back.normals[back.faces], atlas.normals[atlas.faces].astype(np.float64))
    np.testing.assert_array_equal(back.surface.faces, faces)


def test_obj_reads_back_through_trimesh(tmp_path: Path, solid: tuple[np.ndarray, np.ndarray, Atlas]) -> None:
    vertices, faces, atlas = solid
    write_obj(atlas, tmp_path / "a.obj")
    mesh = trimesh.load_mesh(tmp_path / "a.obj", process=False)
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], vertices[faces])
    np.testing.assert_array_equal(uv_of(mesh)[mesh.faces], atlas.corner_uv)


def test_a_soup_becomes_one_surface_in_obj(tmp_path: Path) -> None:
    vertices, faces = make_sample("sphere", resolution=12)
    soup, corners = vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)
    write_obj(atlas_of(soup, corners, soup[corners][:, :, :2]), tmp_path / "a.obj")
    assert sum(line.startswith("v ") for line in (tmp_path / "a.obj").read_text().splitlines()) == len(vertices)


def test_ply_reads_back_exactly(tmp_path: Path, solid: tuple[np.ndarray, np.ndarray, Atlas]) -> None:
    vertices, faces, atlas = solid
    colors = np.random.default_rng(3).integers(0, 256, (len(vertices), 4)).astype(np.uint8)
    write_ply(atlas, tmp_path / "a.ply", colors=colors)
    back = load_asset(tmp_path / "a.ply")
    assert back.uv is not None
    assert back.normals is not None
    assert back.colors is not None
    np.testing.assert_array_equal(back.positions, atlas.positions)
    np.testing.assert_array_equal(back.faces, atlas.faces)
    np.testing.assert_array_equal(back.uv, atlas.uv.astype(np.float64))
    np.testing.assert_allclose(back.normals, atlas.normals, atol=1e-7)
    np.testing.assert_array_equal(back.colors, colors[atlas.source_vertex])
    np.testing.assert_array_equal(back.surface.triangles, vertices[faces])


def test_ply_reads_back_through_trimesh(tmp_path: Path, solid: tuple[np.ndarray, np.ndarray, Atlas]) -> None:
    vertices, faces, atlas = solid
    write_ply(atlas, tmp_path / "a.ply")
    mesh = trimesh.load_mesh(tmp_path / "a.ply", process=False)
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], vertices[faces])
    np.testing.assert_array_equal(uv_of(mesh)[mesh.faces], atlas.corner_uv)


def test_obj_carries_vertex_colours(tmp_path: Path, solid: tuple[np.ndarray, np.ndarray, Atlas]) -> None:
    vertices, _, atlas = solid
    colors = np.random.default_rng(3).integers(0, 256, (len(vertices), 4)).astype(np.uint8)
    colors[:, 3] = 255
    write_obj(atlas, tmp_path / "a.obj", colors=colors)
    back = load_asset(tmp_path / "a.obj")
    assert back.colors is not None
    np.testing.assert_array_equal(back.colors[back.faces], colors[atlas.source_vertex[atlas.faces]])


def test_ply_names_its_picture_for_those_that_read_it(
    tmp_path: Path, solid: tuple[np.ndarray, np.ndarray, Atlas]
) -> None:
    Image.new("RGB", (2, 2), (9, 8, 7)).save(tmp_path / "größe 1.png")
    write_ply(solid[2], tmp_path / "a.ply", texture="größe 1.png")
    (material,) = load_asset(tmp_path / "a.ply").materials
    assert material.pictures["base-color"].pixels[0, 0].tolist() == [9, 8, 7, 255]
    write_ply(solid[2], tmp_path / "b.ply", texture="a\nelement vertex 9")
    assert load_asset(tmp_path / "b.ply").materials == ()


@pytest.mark.parametrize("writer", [write_obj, write_ply])
@pytest.mark.parametrize(
    "wrong", [np.zeros((3, 4), dtype=np.uint8), np.zeros((10_000, 3), dtype=np.uint8), np.zeros((10_000, 4))]
)
def test_colours_of_another_mesh_are_refused(
    tmp_path: Path, solid: tuple[np.ndarray, np.ndarray, Atlas], writer: object, wrong: np.ndarray
) -> None:
    with pytest.raises(ShapeError, match=r"Asset\.colors"):
        writer(solid[2], tmp_path / "a", colors=wrong)  # pyright: ignore[reportCallIssue]


def test_a_name_that_breaks_lines_is_refused(tmp_path: Path, solid: tuple[np.ndarray, np.ndarray, Atlas]) -> None:
    with pytest.raises(InputError, match="printable"):
        write_obj(solid[2], tmp_path / "a.obj", texture="a\nf 1 1 1")
    assert list(tmp_path.iterdir()) == []


def test_a_real_mesh_keeps_its_triangles(models: Path, tmp_path: Path) -> None:
    asset = load_asset(models / "spot.obj")
    assert asset.uv is not None
    atlas = atlas_of(asset.positions, asset.faces, asset.uv[asset.faces])
    for writer, name in ((write_obj, "a.obj"), (write_ply, "a.ply")):
        writer(atlas, tmp_path / name)
        back = load_asset(tmp_path / name)
        np.testing.assert_array_equal(back.positions[back.faces], asset.positions[asset.faces])
        assert asset_from_arrays(back.positions, back.faces).changes.keys() <= {"welded_vertices"}

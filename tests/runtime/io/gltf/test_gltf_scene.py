"""glTF: attributes, transforms and scene order by hand-made files; references that leave the folder are refused."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from scenefile import Scene

from flexpara.runtime.errors import MeshError
from flexpara.runtime.io.gltf.scene import read_gltf
from flexpara.runtime.samples import make_sample

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=np.float32)


def triangle(**attributes: np.ndarray) -> Scene:
    maker = Scene()
    places = {"POSITION": maker.add(TRIANGLE)}
    places.update({name: maker.add(array) for name, array in attributes.items()})
    maker.scene({"attributes": places})
    return maker


def test_one_triangle_without_indices(tmp_path: Path) -> None:
    for data in (triangle().glb(), triangle().gltf()):
        raw = read_gltf(data, tmp_path)
        np.testing.assert_array_equal(raw.positions, TRIANGLE)
        np.testing.assert_array_equal(raw.faces, [[0, 1, 2]])
        assert (raw.uv, raw.normals, raw.colors, raw.face_material) == (None, None, None, None)


def test_uv_turn_v_up_without_any_material(tmp_path: Path) -> None:
    uv = np.array([[0.0, 0.0], [1.0, 0.25], [0.5, 1.0]], dtype=np.float32)
    raw = read_gltf(triangle(TEXCOORD_0=uv).glb(), tmp_path)
    np.testing.assert_array_equal(raw.uv, [[0, 1], [1, 0.75], [0.5, 0]])


def test_normalized_integers_become_fractions(tmp_path: Path) -> None:
    maker = Scene()
    uv = maker.add(np.array([[0, 0], [65535, 0], [0, 13107]], dtype=np.uint16), normalized=True)
    colors = maker.add(np.array([[255, 0, 0, 255], [0, 55, 0, 128], [0, 0, 0, 0]], dtype=np.uint8), normalized=True)
    normals = maker.add(np.array([[0, 0, 127, 0]] * 3, dtype=np.int8)[:, :3].copy(), normalized=True)
    places = {"POSITION": maker.add(TRIANGLE), "TEXCOORD_0": uv, "COLOR_0": colors, "NORMAL": normals}
    maker.scene({"attributes": places})
    raw = read_gltf(maker.glb(), tmp_path)
    assert raw.uv is not None
    np.testing.assert_allclose(raw.uv, [[0, 1], [1, 1], [0, 0.8]], atol=1e-12)
    np.testing.assert_array_equal(raw.normals, [[0, 0, 1]] * 3)
    # 55/255 linear is 0.5019 in sRGB (IEC 61966-2-1); alpha stays linear
    np.testing.assert_array_equal(raw.colors, [[255, 0, 0, 255], [0, 128, 0, 128], [0, 0, 0, 0]])


def test_interleaved_and_sparse_accessors_are_read(tmp_path: Path) -> None:
    maker = Scene()
    rows = np.zeros(3, dtype=[("xyz", "<f4", (3,)), ("uv", "<f4", (2,))])
    rows["xyz"], rows["uv"] = TRIANGLE, [[0, 0], [1, 0], [0, 1]]
    view = maker.view(rows.tobytes()[:-8] + rows.tobytes()[-8:])
    maker.tree["bufferViews"][view]["byteStride"] = 20
    common = {"bufferView": view, "componentType": 5126, "count": 3}
    sparse = {
        "count": 1,
        "indices": {"bufferView": maker.view(np.array([1], dtype=np.uint16).tobytes()), "componentType": 5123},
        "values": {"bufferView": maker.view(np.array([9, 9, 9], dtype=np.float32).tobytes())},
    }
    maker.tree["accessors"] += [
        {**common, "type": "VEC3", "sparse": sparse},
        {**common, "type": "VEC2", "byteOffset": 12},
    ]
    maker.scene({"attributes": {"POSITION": 0, "TEXCOORD_0": 1}})
    raw = read_gltf(maker.glb(), tmp_path)
    np.testing.assert_array_equal(raw.positions, [[0, 0, 0], [9, 9, 9], [0, 1, 0]])
    np.testing.assert_array_equal(raw.uv, [[0, 1], [1, 1], [0, 0]])


@pytest.mark.parametrize(
    ("mode", "faces"), [(4, [[0, 1, 2]]), (5, [[0, 1, 2], [1, 3, 2]]), (6, [[1, 2, 0], [2, 3, 0]])]
)
def test_strips_and_fans_become_triangles_of_one_winding(tmp_path: Path, mode: int, faces: list[list[int]]) -> None:
    maker = Scene()
    positions = maker.add(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], dtype=np.float32))
    indices = maker.add(np.array([0, 1, 2, 3][: 3 if mode == 4 else 4], dtype=np.uint8))
    maker.scene({"attributes": {"POSITION": positions}, "indices": indices, "mode": mode})
    np.testing.assert_array_equal(read_gltf(maker.glb(), tmp_path).faces, faces)


def test_nodes_are_placed_depth_first_in_scene_order(tmp_path: Path) -> None:
    maker = Scene()
    places = {"POSITION": maker.add(TRIANGLE)}
    turn = [0.0, 0.0, np.sin(np.pi / 4), np.cos(np.pi / 4)]
    maker.scene(
        {"attributes": places},
        nodes=[
            {"mesh": 0, "translation": [10, 0, 0], "children": [2]},
            {"mesh": 0, "matrix": [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 5, 1]},
            {"mesh": 0, "translation": [0, 1, 0], "rotation": turn, "scale": [3, 1, 1]},
        ],
    )
    maker.tree["scenes"] = [{"nodes": [1]}, {"nodes": [0, 1]}]
    maker.tree["scene"] = 1
    raw = read_gltf(maker.glb(), tmp_path, instances=True)
    np.testing.assert_allclose(raw.positions[:3], TRIANGLE + np.array([10, 0, 0]))
    np.testing.assert_allclose(raw.positions[3:6], [[10, 1, 0], [10, 4, 0], [9, 1, 0]], atol=1e-7)
    np.testing.assert_allclose(raw.positions[6:], 2 * TRIANGLE + np.array([0, 0, 5]))


def test_a_mirroring_node_keeps_the_normals_outside(tmp_path: Path) -> None:
    normals = np.tile(np.array([0, 0, 1], dtype=np.float32), (3, 1))
    maker = triangle(NORMAL=normals)
    maker.tree["nodes"][0]["scale"] = [-1, 1, 1]
    raw = read_gltf(maker.glb(), tmp_path)
    a, b, c = raw.positions[raw.faces[0]]
    np.testing.assert_allclose(np.cross(b - a, c - a), [0, 0, 1])
    assert raw.normals is not None
    np.testing.assert_allclose(raw.normals, normals)


def textured(picture: np.ndarray) -> Scene:
    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, format="PNG")
    maker = triangle(TEXCOORD_0=TRIANGLE[:, :2].copy(), TEXCOORD_1=TRIANGLE[:, 1:].copy())
    maker.tree["images"] = [{"bufferView": maker.view(stream.getvalue()), "mimeType": "image/png"}]
    maker.tree["textures"] = [{"source": 0}]
    surface = {"baseColorTexture": {"index": 0, "texCoord": 1}, "baseColorFactor": [0.5, 1, 1, 1]}
    maker.tree["materials"] = [{"name": "skin", "pbrMetallicRoughness": surface}]
    maker.tree["meshes"][0]["primitives"][0]["material"] = 0
    return maker


def test_a_material_brings_its_picture_and_its_own_uv_set(tmp_path: Path) -> None:
    picture = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)
    raw = read_gltf(textured(picture).glb(), tmp_path)
    np.testing.assert_array_equal(raw.materials[0].pictures["base-color"].pixels, picture)
    assert raw.materials[0].base_color_factor == (0.5, 1.0, 1.0, 1.0)
    np.testing.assert_array_equal(raw.uv, TRIANGLE[:, 1:] * [1, -1] + [0, 1])


def test_a_solid_survives_the_way_through_trimesh(tmp_path: Path) -> None:
    vertices, faces = make_sample("torus", resolution=12)
    trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / "a.glb")
    raw = read_gltf((tmp_path / "a.glb").read_bytes(), tmp_path)
    np.testing.assert_array_equal(raw.faces, faces)
    np.testing.assert_array_equal(raw.positions, vertices.astype(np.float32))


def test_a_buffer_beside_the_file_is_read(tmp_path: Path) -> None:
    (tmp_path / "a b.bin").write_bytes(triangle().data)
    np.testing.assert_array_equal(read_gltf(triangle().gltf("a%20b.bin"), tmp_path).positions, TRIANGLE)


@pytest.mark.parametrize(
    "uri",
    [
        "../secret.bin",
        "/etc/passwd",
        "%2e%2e/secret.bin",
        "http://a.b/c.bin",
        "https://a.b/c",
        "file:///etc/passwd",
        "link.bin",
    ],
)
@pytest.mark.parametrize("kind", ["buffer", "image"])
def test_references_out_of_the_folder_are_refused(tmp_path: Path, uri: str, kind: str) -> None:
    (tmp_path / "secret.bin").write_bytes(triangle().data)
    folder = tmp_path / "inside"
    folder.mkdir()
    (folder / "link.bin").symlink_to(tmp_path / "secret.bin")
    maker = textured(np.zeros((1, 1, 4), dtype=np.uint8))
    if kind == "image":
        maker.tree["images"] = [{"uri": uri}]
    with pytest.raises(MeshError, match="does not lie beside it"):
        read_gltf(maker.gltf(uri if kind == "buffer" else None), folder)


def test_a_reference_to_nothing_is_named(tmp_path: Path) -> None:
    with pytest.raises(MeshError, match=r"'gone\.bin', which does not lie beside it"):
        read_gltf(triangle().gltf("gone.bin"), tmp_path)


def broken(change: str) -> bytes:
    maker = triangle()
    tree = maker.tree
    match change:
        case "points only":
            tree["meshes"][0]["primitives"][0]["mode"] = 0
        case "no mesh":
            tree["nodes"] = [{}]
        case "huge count":
            tree["accessors"][0]["count"] = 10**12
        case "huge zeros":
            tree["accessors"][0] = {"componentType": 5126, "count": 10**12, "type": "VEC3"}
        case "more than there is":
            tree["accessors"][0]["count"] = 4
        case "negative offset":
            tree["accessors"][0]["byteOffset"] = -12
        case "view too long":
            tree["bufferViews"][0]["byteLength"] = 10**9
        case "no stride":
            tree["bufferViews"][0]["byteStride"] = 1
        case "own parent":
            tree["nodes"][0]["children"] = [0]
        case "extension":
            tree["extensionsRequired"] = ["KHR_texture_transform", "ACME_folded_space"]
        case "used":
            tree["extensionsUsed"] = 0.5
        case "used by none":
            tree["extensionsUsed"] = [["KHR_xmp"]]
        case "version":
            tree["asset"]["version"] = "1.0"
        case "text":
            return b"{not json"
        case "list":
            return b"[1, 2]"
        case "nothing":
            return b""
        case "cut":
            return maker.glb()[:-20]
        case "head only":
            return maker.glb()[:12]
        case "deep":
            return b'{"asset":' * 100_000
    return maker.glb()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("points only", "give points as"),
        ("no mesh", "no mesh"),
        ("huge count", "elements"),
        ("huge zeros", "elements"),
        ("more than there is", "damaged"),
        ("negative offset", "damaged"),
        ("view too long", "ends behind"),
        ("no stride", "damaged"),
        ("own parent", "several parents"),
        ("extension", "requires the extension .ACME_folded_space"),
        ("used", "extensionsUsed is no list of names"),
        ("used by none", "extensionsUsed is no list of names"),
        ("version", "1.0, expected 2"),
        ("text", "damaged"),
        ("list", "damaged"),
        ("nothing", "damaged"),
        ("cut", "cut short"),
        ("head only", "damaged"),
        ("deep", "damaged"),
    ],
)
def test_damage_is_named_in_one_line(tmp_path: Path, change: str, message: str) -> None:
    with pytest.raises(MeshError, match=message) as caught:
        read_gltf(broken(change), tmp_path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("seed", range(3))
def test_no_damaged_byte_gets_past_the_errors(tmp_path: Path, seed: int) -> None:
    whole = np.frombuffer(textured(np.zeros((2, 2, 4), dtype=np.uint8)).glb(), dtype=np.uint8)
    rng = np.random.default_rng(seed)
    refused = 0
    for _ in range(150):
        damaged = whole.copy()
        damaged[rng.integers(0, len(whole), 3)] = rng.integers(0, 256, 3)
        try:
            read_gltf(damaged.tobytes(), tmp_path)
        except MeshError:
            refused += 1
    assert refused > 20

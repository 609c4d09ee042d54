"""glTF nodes: instances, and what a still mesh can't say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenefile import Scene

from flexpara.runtime.errors import MeshError
from flexpara.runtime.io.gltf.scene import read_gltf


class Maker(Scene):
    """A file of one triangle, with room for more accessors of floats."""

    def __init__(self) -> None:
        super().__init__()
        self.tree["meshes"] = [{"primitives": [{"attributes": {"POSITION": self.floats(np.eye(3, k=-1))}}]}]
        self.tree["nodes"] = [{"mesh": 0}]

    def floats(self, rows: np.ndarray) -> int:
        return self.add(rows.astype(np.float32))


def test_what_a_still_mesh_cannot_say_is_counted(tmp_path: Path) -> None:
    maker = Maker()
    maker.tree |= {"animations": [{}], "skins": [{}, {}], "cameras": [{}]}
    maker.tree["meshes"][0]["primitives"][0]["targets"] = [{}, {}, {}]
    maker.tree["meshes"][0]["primitives"].append({"attributes": {"POSITION": 0}, "mode": 1})
    maker.tree["extensions"] = {"KHR_lights_punctual": {"lights": [{}]}}
    raw = read_gltf(maker.gltf(), tmp_path)
    assert {name: count for name, count in raw.changes.items() if count} == {}
    assert raw.document is not None
    assert raw.document.beyond_meshes() == {
        "skipped_animations": 1,
        "skipped_skins": 2,
        "skipped_morph_targets": 3,
        "skipped_cameras": 1,
        "skipped_lights": 1,
        "skipped_primitives": 1,
    }


def test_instances_stand_where_they_are_put(tmp_path: Path) -> None:
    maker = Maker()
    half = np.sqrt(0.5)
    names = {
        "TRANSLATION": maker.floats(np.array([[5, 0, 0], [0, 0, 7]])),
        "ROTATION": maker.floats(np.array([[0, 0, 0, 1], [0, 0, half, half]])),
        "SCALE": maker.floats(np.array([[2, 2, 2], [1, 1, 1]])),
    }
    node = maker.tree["nodes"][0]
    node["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": names}}
    node["translation"] = [0, 0, 1]
    raw = read_gltf(maker.gltf(), tmp_path, instances=True)
    expected = [[[5, 0, 1], [7, 0, 1], [5, 2, 1]], [[0, 0, 8], [0, 1, 8], [-1, 0, 8]]]
    np.testing.assert_allclose(raw.positions[raw.faces], expected, atol=1e-6)
    maker.tree["accessors"][names["SCALE"]]["count"] = 1
    with pytest.raises(MeshError, match="instance attributes of different lengths"):
        read_gltf(maker.gltf(), tmp_path)


def test_a_mesh_is_read_once_where_it_is_neither_mirrored_nor_stretched(tmp_path: Path) -> None:
    maker = Maker()
    maker.tree["nodes"] = [
        {"mesh": 0, "scale": [-1, 1, 1]},
        {"mesh": 0, "scale": [1, 2, 1]},
        {"mesh": 0, "scale": [3, 3, 3], "translation": [7, 0, 0]},
        {"mesh": 0},
    ]
    raw = read_gltf(maker.gltf(), tmp_path)
    np.testing.assert_allclose(raw.positions, 3 * np.eye(3, k=-1) + np.array([7, 0, 0]))
    assert raw.document is not None
    assert [entry.node for entry in raw.document.placements] == [0, 1, 2, 3]


def test_a_skinned_mesh_stands_where_its_first_joint_takes_it(tmp_path: Path) -> None:
    maker = Maker()
    bind = np.eye(4)
    bind[:3, 3] = (0, 0, -4)
    matrices = maker.floats(np.concatenate([bind.T, np.eye(4)]))
    maker.tree["accessors"][matrices] |= {"type": "MAT4", "count": 2}
    maker.tree["skins"] = [{"joints": [1, 2], "inverseBindMatrices": matrices}]
    maker.tree["nodes"] = [{"mesh": 0, "skin": 0, "translation": [9, 9, 9]}, {"translation": [0, 0, 5]}, {}]
    np.testing.assert_allclose(read_gltf(maker.gltf(), tmp_path).positions, np.eye(3, k=-1) + np.array([0, 0, 1]))


def test_meshes_of_all_scenes_are_read_the_default_one_first(tmp_path: Path) -> None:
    maker = Maker()
    maker.tree["meshes"].append(maker.tree["meshes"][0])
    maker.tree["nodes"] = [{"mesh": 0}, {"mesh": 1, "translation": [0, 0, 1]}]
    maker.tree |= {"scenes": [{"nodes": [0]}, {"nodes": [1]}], "scene": 1}
    raw = read_gltf(maker.gltf(), tmp_path)
    assert raw.document is not None
    assert [(entry.mesh, entry.first) for entry in raw.document.placements] == [(1, True), (0, False)]
    assert len(raw.faces) == 2
    assert len(read_gltf(maker.gltf(), tmp_path, instances=True).faces) == 1

"""A glTF scene with what scenes have, made by hand: instances, a skin, a morph target, an animation, a light, extras.

Two meshes of strips of quads along x: "Board" (two primitives, materials Paint and Glass) stands three times, once
mirrored; "Arm" has a skin and a morph target.
"""

from __future__ import annotations

import base64
import io
import json
import struct
from typing import Any

import numpy as np
from PIL import Image

KINDS = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


class Scene:
    """Collects arrays into one buffer and knows their accessors."""

    def __init__(self) -> None:
        self.data = b""
        self.tree: dict[str, Any] = {"asset": {"version": "2.0"}, "bufferViews": [], "accessors": []}

    def view(self, data: bytes) -> int:
        self.data += b"\0" * (-len(self.data) % 4)
        self.tree["bufferViews"].append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)})
        self.data += data
        return len(self.tree["bufferViews"]) - 1

    def add(self, array: np.ndarray, **more: object) -> int:
        rows = array.reshape(len(array), -1)
        kind = {"componentType": KINDS[rows.dtype.name], "count": len(rows), "type": TYPES[rows.shape[1]]}
        self.tree["accessors"].append({"bufferView": self.view(rows.tobytes()), **kind, **more})
        return len(self.tree["accessors"]) - 1

    def points(self, array: np.ndarray) -> int:
        return self.add(array, min=array.min(axis=0).tolist(), max=array.max(axis=0).tolist())

    def scene(self, *primitives: dict[str, Any], nodes: list[dict[str, Any]] | None = None) -> None:
        """One mesh per primitive and, unless told, one node per mesh."""
        self.tree["meshes"] = [{"primitives": [primitive]} for primitive in primitives]
        self.tree["nodes"] = nodes or [{"mesh": index} for index in range(len(primitives))]
        self.tree["scenes"] = [{"nodes": list(range(len(self.tree["nodes"])))}]

    def gltf(self, uri: str | None = None) -> bytes:
        inline = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        buffers = [{"byteLength": len(self.data), "uri": uri or inline}]
        return json.dumps({**self.tree, "buffers": buffers}).encode()

    def glb(self) -> bytes:
        data = self.data + b"\0" * (-len(self.data) % 4)
        text = json.dumps({**self.tree, "buffers": [{"byteLength": len(data)}]}).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks

    def strip(self, quads: int, z: float, **more: np.ndarray) -> dict[str, Any]:
        """A primitive: quads from x = 0 to quads in the plane z, their uv, and what more is given for a vertex each."""
        x, y = (line.reshape(-1) for line in np.meshgrid(np.arange(quads + 1), [0, 1], indexing="ij"))
        positions = np.column_stack([x, y, np.full(len(x), z)]).astype(np.float32)
        normals = np.tile(np.array([0, 0, 1], np.float32), (len(x), 1))
        uv = np.column_stack([x / quads, y]).astype(np.float32)
        first = 2 * np.arange(quads)[:, None]
        faces = (first + np.array([0, 2, 3, 0, 3, 1])).astype(np.uint16)
        names = {"POSITION": self.points(positions), "NORMAL": self.add(normals), "TEXCOORD_0": self.add(uv)}
        names |= {name: self.add(rows) for name, rows in more.items()}
        return {"attributes": names, "indices": self.add(faces.reshape(-1, 1)), "mode": 4}


def png(level: int) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(np.full((4, 4, 3), level, np.uint8)).save(stream, "PNG")
    return stream.getvalue()


def whole_scene() -> Scene:
    """The scene described above."""
    scene = Scene()
    wind = np.linspace(0, 1, 6, dtype=np.float32)[:, None]
    lower, upper = scene.strip(2, 0.0, _WIND=wind), scene.strip(2, 1.0, TEXCOORD_1=np.zeros((6, 2), np.float32))
    joints = np.zeros((8, 4), np.uint8)
    joints[4:, 0] = 1
    weights = np.tile(np.array([1, 0, 0, 0], np.float32), (8, 1))
    arm = scene.strip(3, 0.0, JOINTS_0=joints, WEIGHTS_0=weights)
    lift = np.zeros((8, 3), np.float32)
    lift[:, 2] = np.arange(8) / 8
    arm["targets"] = [{"POSITION": scene.points(lift)}]
    half = float(np.sqrt(0.5))
    times = scene.add(np.array([[0], [1]], np.float32), min=[0.0], max=[1.0])
    turns = scene.add(np.array([[0, 0, 0, 1], [0, half, 0, half]], np.float32))
    bind = np.tile(np.eye(4, dtype=np.float32).reshape(1, 16), (2, 1))
    scene.tree |= {
        "scene": 0,
        "scenes": [{"nodes": [0, 5, 6, 7]}],
        "nodes": [
            {"name": "Root", "children": [1, 2, 3], "extras": {"kept": [1, 2]}},
            {"name": "A", "mesh": 0},
            {"name": "B", "mesh": 0, "translation": [0, 5, 0], "scale": [2, 1, 1]},
            {"name": "C", "mesh": 0, "translation": [0, 9, 0], "scale": [-1, 1, 1]},
            {"name": "Bone", "translation": [1, 0, 0]},
            {"name": "Arm", "mesh": 1, "skin": 0},
            {"name": "Shoulder", "children": [4]},
            {"name": "Eye", "camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}},
        ],
        "meshes": [
            {"name": "Board", "primitives": [{**lower, "material": 0}, {**upper, "material": 1}], "extras": {"a": 1}},
            {"name": "Arm", "primitives": [{**arm, "material": 0}], "weights": [0.25]},
        ],
        "materials": [
            {
                "name": "Paint",
                "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0.0},
                "extensions": {"KHR_materials_clearcoat": {"clearcoatTexture": {"index": 1}, "clearcoatFactor": 0.5}},
                "extras": {"brush": 3},
            },
            {"name": "Glass", "alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.4, 1, 0.5]}},
        ],
        "images": [{"bufferView": scene.view(png(level)), "mimeType": "image/png"} for level in (60, 200)],
        "textures": [{"source": 0}, {"source": 1}],
        "skins": [{"joints": [6, 4], "inverseBindMatrices": scene.add(bind)}],
        "animations": [
            {
                "channels": [{"sampler": 0, "target": {"node": 4, "path": "rotation"}}],
                "samplers": [{"input": times, "output": turns}],
            }
        ],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point"}]}},
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_clearcoat"],
    }
    return scene

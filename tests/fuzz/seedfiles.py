"""Small whole files of every format that is read: what mutators start from; and found ones, in `seeds/READER/`."""

from __future__ import annotations

import contextlib
import io
import json
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import DracoPy
import meshoptimizer
import numpy as np
import torch
import trimesh
from PIL import Image
from trimesh.exchange.gltf import export_gltf

import flexpara
from flexpara.__main__ import main
from flexpara.runtime.cli.runfile import Run
from flexpara.runtime.options.unwrap import Options, Outputs
from flexpara.train.paper.checkpoint import Checkpoints, State
from flexpara.train.paper.config import PaperConfig, PaperNets

from .mutate import glb
from .readers import TENSORS

FOUND = Path(__file__).parent / "seeds"
CORPUS = Path(__file__).resolve().parents[3] / "shared" / "corpus"
LARGEST = 40_000
"""Bytes of a file of the corpus that is taken."""
OBJ = """mtllib box.mtl
v 0 0 0 1 0 0
v 1 0 0 0 1 0
v 1 1 0 0 0 1
v 0 1 0 1 1 1
v 0 0 1 .5 .5 .5
vt 0 0
vt 1 0
vt 1 1
vn 0 0 1
usemtl paint
s 1
f 1/1/1 2/2/1 3/3/1 4/1/1
usemtl glass
s off
f 1 2 5
f -5 -4 -3
f 3//1 4//1 5//1
"""
MTL = "newmtl paint\nKd .2 .4 1\nd .5\nPm 1\nPr .3\nKe 1 0 0\nmap_Kd -clamp on skin.png\nnorm skin.png\n"
MTL += "newmtl glass\nd .2\n"
PLAIN = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\nf 1 4 2\n"
PLY = """ply
format ascii 1.0
comment TextureFile skin.png
element vertex 4
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
element face 2
property list uchar int vertex_indices
property list uchar float texcoord
property int texnumber
end_header
0 0 0 255 0 0
1 0 0 0 255 0
1 1 0 0 0 255
0 1 0 9 9 9
4 0 1 2 3 8 0 0 1 0 1 1 0 1 0
3 0 1 2 6 0 0 1 0 1 1 0
"""
STRIPS = """ply
format ascii 1.0
element vertex 4
property double x
property double y
property double z
element tristrips 1
property list int int vertex_indices
end_header
0 0 0
1 0 0
1 1 0
0 1 1
7 0 1 2 3 -1 0 1
"""
POINTS = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
POINTS += "property float nx\nproperty float ny\nproperty float nz\nend_header\n"
POINTS += "0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n1 1 0 0 0 1\n2 1 0 0 0 1\n"
STL = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
STL += "endloop\nendfacet\nendsolid a\n"
OFFS = (
    "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 1\n4 0 1 2 3 255 0 0\n3 0 1 2\n",
    "STCNOFF\n3 1 0\n0 0 0 0 0 1 1 0 0 1 0 0\n1 0 0 0 0 1 1 0 0 1 1 0\n0 1 0 0 0 1 1 0 0 1 0 1\n3 0 1 2\n",
)
TABLES = ("x,y,z\n0,0,0\n1,0,0\n0,1,0\n0,0,1\n", "# a\n0 0 0 255 0 0\n1 0 0 0 255 0\n0 1 0 0 0 255\n1 1 1 9 9 9\n")


def box() -> trimesh.Trimesh:
    """A box with normals and uv."""
    mesh = trimesh.creation.box()
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def exported(kind: str) -> bytes:
    """A box as trimesh writes it."""
    found = box().export(file_type=kind)
    return found.encode() if isinstance(found, str) else bytes(found)


def skinned_dae() -> bytes:
    """A box that hangs on a skin."""
    text = exported("dae")
    mesh = text.split(b'<instance_geometry url="#')[1].split(b'"')[0]
    skin = (
        b'<controller id="s"><skin source="#%b"><bind_shape_matrix>1 0 0 5 0 1 0 0 0 0 1 0 0 0 0 1</bind_shape_matrix>'
    )
    library = b"<library_controllers>" + skin % mesh + b"</skin></controller></library_controllers>"
    text = text.replace(b"<library_visual_scenes>", library + b"<library_visual_scenes>")
    text = text.replace(b'<instance_geometry url="#%b"' % mesh, b'<instance_controller url="#s"')
    return text.replace(b"</instance_geometry>", b"</instance_controller>")


def binary_off() -> bytes:
    """OFF BINARY, big-endian, faces with a colour count."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], ">f4").tobytes()
    return b"OFF BINARY\n" + np.array([3, 1, 0], ">i4").tobytes() + points + np.array([3, 0, 1, 2, 0], ">i4").tobytes()


def picture(kind: str, mode: str = "RGBA") -> bytes:
    """A picture of 16 × 16 texels."""
    stream = io.BytesIO()
    pixels = np.random.default_rng(0).integers(0, 255, (16, 16, 4)).astype(np.uint8)
    Image.fromarray(pixels).convert(mode).save(stream, kind)
    return stream.getvalue()


def array_file(array: np.ndarray) -> bytes:
    """A .npy file."""
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def arrays_file(**arrays: np.ndarray) -> bytes:
    """A .npz file."""
    stream = io.BytesIO()
    np.savez_compressed(stream, allow_pickle=False, **arrays)
    return stream.getvalue()


def draco() -> list[bytes]:
    """The packed triangles of a box, with and without prediction."""
    points, faces = box().vertices.astype(np.float32), box().faces.astype(np.uint32)
    return [bytes(DracoPy.encode(points, faces, compression_level=level)) for level in (0, 7)]


def meshopt() -> list[bytes]:
    """The packed positions of a box, and its packed corners, in both modes; the first byte tells which."""
    points, corners = box().vertices.astype(np.float32), box().faces.astype(np.uint32).ravel()
    vertex = bytes(meshoptimizer.encode_vertex_buffer(points, len(points), 12))
    index = bytes(meshoptimizer.encode_index_buffer(corners, len(corners), len(points)))
    return [vertex, index, bytes(meshoptimizer.encode_index_sequence(corners, len(corners), len(points)))]


def corpus(*endings: str) -> list[bytes]:
    """Small files of the corpus, where it is there."""
    paths = sorted(path for path in CORPUS.rglob("*") if path.suffix.lower() in endings) if CORPUS.is_dir() else []
    return [path.read_bytes() for path in paths if path.is_file() and path.stat().st_size < LARGEST][:12]


LIST = b"""{"file": "a.obj"}
{"file": "b/c.obj", "options": {"charts": 3, "maps": "ao", "size": 64, "rotation": "off"}}
{"file": "d.gltf", "options": {"high": ["e/{stem}.obj"], "cage": 0.1, "match_names": true, "cut": "g.txt"}}
{"file": "h.obj", "options": {"start": "{folder}/{stem}_*.obj", "protect": "_weight", "fields": "i.onnx"}}
"""


def unwrapped() -> dict[str, list[bytes]]:
    """What flexpara itself writes and reads: the networks, what training found, the report, a run."""
    with tempfile.TemporaryDirectory() as place, contextlib.redirect_stdout(io.StringIO()):
        folder = Path(place)
        (folder / "box.obj").write_bytes(exported("obj"))
        flexpara.unwrap(folder / "box.obj", charts=2, size=64).save(folder / "out", maps=(), inverse=True)
        main(["train", str(folder / "box.obj"), "-o", str(folder / "out"), "--quiet"])
        Run(folder / "mesh.obj", folder / "run", Options(preset="paper"), Outputs(), 5).save()
        files = {path.name: path.read_bytes() for path in (folder / "out").iterdir()}
        main(["batch", str(folder / "box.obj"), "-o", str(folder / "batch"), "--maps", "none", "--quiet"])
        ledger, plan = ((folder / "batch" / name).read_bytes() for name in ("manifest.jsonl", "batch.json"))
        config = PaperConfig(nets=PaperNets(hidden=16))
        Checkpoints(folder / "kept").save(State(5, {"networks.a": torch.ones(16, 128)}), config, "0" * 64)
        checkpoint, tensors = ((folder / "kept" / name).read_bytes() for name in ("checkpoint.json", TENSORS))
        run = (folder / "run" / "mesh.checkpoint" / "run.json").read_bytes()
    report = json.loads(files["box.report.json"]) | {"textures": {"files": {"normal": "link.bin", "a": "../b.png"}}}
    return {
        "onnx": [files["box.onnx"]],
        "wrap": [files["box.wrap.onnx"]],
        "trained": [files["box.trained.safetensors"]],
        "report": [json.dumps(report).encode()],
        "run": [run],
        "manifest": [ledger + ledger.replace(b"box.obj", b"b.obj")],
        "plan": [plan],
        "list": [LIST],
        "checkpoint": [checkpoint],
        "tensors": [tensors],
        "mesh": [files["box.glb"]],
        "boxobj": [exported("obj")],
    }


def gltf() -> bytes:
    """A glTF file in one piece, with a node of instances, a sparse accessor, a strip and a material."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32).tobytes()
    uv, skin = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32).tobytes(), picture("PNG")
    places, sparse = (
        np.array([[0, 0, 2], [0, 0, 4]], np.float32).tobytes(),
        np.array([1], np.uint16).tobytes() + b"\0\0",
    )
    tree, body = {"asset": {"version": "2.0"}, "scene": 0}, b""
    tree["bufferViews"] = []
    for part in (points, uv, places, sparse, np.array([5, 5, 5], np.float32).tobytes(), skin):
        tree["bufferViews"].append({"buffer": 0, "byteOffset": len(body), "byteLength": len(part)})
        body += part
    values = {"count": 1, "indices": {"bufferView": 3, "componentType": 5123}, "values": {"bufferView": 4}}
    tree["buffers"] = [{"byteLength": len(body)}]
    tree["accessors"] = [
        {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "sparse": values},
        {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
        {"bufferView": 2, "componentType": 5126, "count": 2, "type": "VEC3"},
        {"componentType": 5121, "count": 4, "type": "VEC3", "normalized": True},
    ]
    instances = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2}}}
    names = {"POSITION": 0, "TEXCOORD_0": 1, "COLOR_0": 3}
    tree["meshes"] = [{"name": "a", "primitives": [{"attributes": names, "mode": 5, "material": 0}]}]
    tree["nodes"] = [{"children": [1, 2], "scale": [1, 2, 1]}, {"mesh": 0, "extensions": instances}, {"mesh": 0}]
    tree["scenes"] = [{"nodes": [0]}]
    tree["images"], tree["samplers"] = [{"bufferView": 5}, {"uri": "skin.png"}], [{"wrapS": 33071}]
    tree["textures"] = [{"source": 0, "sampler": 0}, {"source": 1}]
    placed = {"KHR_texture_transform": {"offset": [0.5, 0], "rotation": 1.5, "scale": [2, 1]}}
    surface = {"baseColorTexture": {"index": 0, "extensions": placed}, "metallicRoughnessTexture": {"index": 1}}
    tree["materials"] = [{"pbrMetallicRoughness": surface, "alphaMode": "MASK", "emissiveFactor": [1, 0, 0]}]
    return glb(json.dumps(tree).encode(), body)


def gltf_text() -> bytes:
    """A .gltf file whose buffer is a data URI."""
    files = export_gltf(trimesh.Scene(box()), embed_buffers=True)
    return files["model.gltf"]


def coloured_3mf() -> bytes:
    """Components of two parts, with colours, a texture and its uv."""
    head = 'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"'
    corners = "".join(f'<vertex x="{x}" y="{y}" z="{x * y}"/>' for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)))
    faces = (
        '<triangle v1="0" v2="1" v3="2" pid="1" p1="0"/><triangle v1="0" v2="2" v3="3" pid="3" p1="0" p2="1" p3="0"/>'
    )
    groups = '<colorgroup id="1"><color color="#00FF0080"/></colorgroup><texture2d id="2" path="/a.png"/>'
    groups += '<texture2dgroup id="3" texid="2"><tex2coord u="0" v="0.5"/><tex2coord u="1" v="1"/></texture2dgroup>'
    inner = f'{groups}<object id="4"><mesh><vertices>{corners}</vertices><triangles>{faces}</triangles></mesh></object>'
    pair = '<component path="/b.model" objectid="4" transform="1 0 0 0 2 0 0 0 1 5 0 0"/><component objectid="4"/>'
    both = f'{inner}<object id="5"><components>{pair}</components></object>'
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr(
            "3D/3dmodel.model",
            f'<model {head}><resources>{both}</resources><build><item objectid="5"/></build></model>',
        )
        archive.writestr("b.model", f"<model {head}><resources>{inner}</resources></model>")
        archive.writestr("a.png", picture("PNG"))
    return stream.getvalue()


MADE: dict[str, Callable[[], list[bytes]]] = {
    "obj": lambda: [OBJ.encode(), PLAIN.encode(), *corpus(".obj")],
    "mtl": lambda: [MTL.encode()],
    "ply": lambda: [PLY.encode(), STRIPS.encode(), POINTS.encode(), exported("ply"), *corpus(".ply")],
    "stl": lambda: [STL.encode(), exported("stl"), *corpus(".stl")],
    "off": lambda: [*(text.encode() for text in OFFS), binary_off(), *corpus(".off")],
    "glb": lambda: [gltf(), exported("glb"), *corpus(".glb")],
    "gltf": lambda: [gltf_text(), *corpus(".gltf")],
    "draco": draco,
    "meshopt": meshopt,
    "png": lambda: [picture("PNG"), picture("PNG", "P"), picture("PNG", "L"), picture("WEBP")],
    "jpg": lambda: [picture("JPEG", "RGB"), picture("JPEG", "L"), picture("JPEG", "CMYK")],
    "ktx2": list,
    "npy": lambda: [array_file(np.arange(24.0).reshape(8, 3) % 5), array_file(np.eye(6, dtype=np.float32))],
    "npz": lambda: [
        arrays_file(points=np.arange(24.0).reshape(8, 3) % 5, colors=np.ones((8, 3))),
        arrays_file(a=np.eye(3)),
    ],
    "csv": lambda: [table.encode() for table in TABLES],
    "3mf": lambda: [exported("3mf"), coloured_3mf()],
    "dae": lambda: [exported("dae"), skinned_dae()],
}


def all_seeds() -> dict[str, list[bytes]]:
    """Seeds by reader: made ones, small ones of the corpus, and those that were found by fuzzing."""
    seeds = {name: make() for name, make in MADE.items()} | unwrapped()
    for folder in sorted(FOUND.iterdir()):
        seeds[folder.name] = [*seeds.get(folder.name, []), *(path.read_bytes() for path in sorted(folder.iterdir()))]
    return seeds

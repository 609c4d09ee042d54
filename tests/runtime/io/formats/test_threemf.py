"""3MF by hand: components, colours by triangle and corner, textures, parts; damage is named."""

from __future__ import annotations

import io
import zipfile

import numpy as np
import pytest
from PIL import Image

from flexpara.runtime.errors import MeshError
from flexpara.runtime.io.formats.archive import check_archive
from flexpara.runtime.io.formats.threemf import read_3mf
from flexpara.runtime.io.rawmesh import RawMesh

HEAD = 'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"'
COLORS = (
    '<basematerials id="1"><base name="Red" displaycolor="#FF0000"/><base name="Clear" displaycolor="#0000FF80"/>'
    '</basematerials><colorgroup id="2"><color color="#00FF00"/><color color="#FFFF00"/></colorgroup>'
)
YELLOW = 'pid="2" p1="1"'
VERTICES = (
    '<vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="1" y="1" z="0"/><vertex x="0" y="1" z="0"/>'
)


def mesh(first: str = "", second: str = "") -> str:
    faces = f'<triangle v1="0" v2="1" v3="2" {first}/><triangle v1="0" v2="2" v3="3" {second}/>'
    return f"<mesh><vertices>{VERTICES}</vertices><triangles>{faces}</triangles></mesh>"


BEYOND = mesh().replace('"2"', '"9"')


def model(objects: str, build: str = '<item objectid="3"/>', head: str = "", more: str = COLORS) -> str:
    return f"<model {HEAD} {head}><resources>{more}{objects}</resources><build>{build}</build></model>"


def packed(text: str, **files: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("3D/3dmodel.model", text)
        for name, data in files.items():
            archive.writestr(name.replace("__", "/").replace("_dot_", "."), data)
    return stream.getvalue()


def counted(raw: RawMesh) -> dict[str, int]:
    return {name: count for name, count in raw.changes.items() if count}


def test_triangles_without_any_colour_have_none() -> None:
    raw = read_3mf(packed(model(f'<object id="3">{mesh()}</object>')))
    np.testing.assert_array_equal(raw.faces, [[0, 1, 2], [0, 2, 3]])
    assert (raw.colors, raw.uv, raw.face_material) == (None, None, None)


def test_colours_are_those_of_the_triangle_its_corners_or_the_object() -> None:
    body = mesh('pid="1" p1="1"', 'pid="2" p1="0" p2="1" p3="0"')
    raw = read_3mf(packed(model(f'<object id="3">{body}</object>')))
    assert raw.colors is not None
    green, yellow = [0, 255, 0, 255], [255, 255, 0, 255]
    assert raw.colors[raw.faces].tolist() == [[[0, 0, 255, 128]] * 3, [green, yellow, green]]
    own = read_3mf(packed(model(f'<object id="3" pid="1" pindex="0">{mesh("", YELLOW)}</object>')))
    assert own.colors is not None
    assert own.colors[own.faces][:, 0].tolist() == [[255, 0, 0, 255], yellow]


def test_components_stand_where_they_are_put_and_are_counted() -> None:
    pair = '<component objectid="3"/><component objectid="3" transform="0 1 0 -1 0 0 0 0 1 5 0 0"/>'
    objects = f'<object id="3">{mesh()}</object><object id="4"><components>{pair}</components></object>'
    raw = read_3mf(packed(model(objects, '<item objectid="4" transform="2 0 0 0 2 0 0 0 2 0 0 7"/>')))
    np.testing.assert_allclose(raw.positions[raw.faces[0]], [[0, 0, 7], [2, 0, 7], [2, 2, 7]])
    np.testing.assert_allclose(raw.positions[raw.faces[2]], [[10, 0, 7], [10, 2, 7], [8, 2, 7]])
    assert counted(raw) == {"joined_nodes": 2}


def test_a_texture_of_the_archive_is_read_through_its_uv() -> None:
    stream = io.BytesIO()
    Image.fromarray(np.full((2, 2, 3), 200, np.uint8)).save(stream, "PNG")
    more = '<texture2d id="5" path="/3D/Textures/wood.png" contenttype="image/png"/><texture2dgroup id="6" texid="5">'
    more += '<tex2coord u="0" v="0.25"/><tex2coord u="1" v="0"/><tex2coord u="1" v="1"/></texture2dgroup>'
    first = 'pid="6" p1="0" p2="1" p3="2"'
    body = model(f'<object id="3">{mesh(first)}</object>', more=more)
    raw = read_3mf(packed(body, **{"3D__Textures__wood_dot_png": stream.getvalue()}))
    assert raw.uv is not None
    np.testing.assert_array_equal(raw.uv[raw.faces[0]], [[0, 0.25], [1, 0], [1, 1]])
    assert raw.face_material is not None
    assert [raw.materials[number].name for number in raw.face_material] == ["wood", "plain"]
    assert raw.materials[raw.face_material[0]].pictures["base-color"].pixels[0, 0].tolist() == [200, 200, 200, 255]
    assert counted(read_3mf(packed(body)))["missing_textures"] == 1


def test_objects_of_other_parts_are_found() -> None:
    head = 'xmlns:p="http://schemas.microsoft.com/3dmanufacturing/production/2015/06" requiredextensions="p"'
    component = '<component p:path="/3D/Objects/part.model" objectid="3"/>'
    outer = model(f'<object id="9"><components>{component}</components></object>', '<item objectid="9"/>', head)
    inner = model(f'<object id="3">{mesh()}</object>', build="")
    data = packed(outer, **{"3D__Objects__part_dot_model": inner.encode()})
    assert len(read_3mf(data).faces) == 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (model(f'<object id="3">{mesh()}</object>', build=""), "builds nothing with triangles"),
        (model(f'<object id="3">{mesh()}</object>', '<item objectid="8"/>'), "object '8' is not there"),
        (model('<object id="3"><components><component objectid="3"/></components></object>'), "a part of itself"),
        (model(f'<object id="3">{mesh().replace("v3=", "v4=", 1)}</object>'), "damaged"),
        (
            model(f'<object id="3">{BEYOND}</object>'),
            "a triangle beyond 4 vertices",
        ),
        (model("<object"), "damaged"),
        (f"<!DOCTYPE a>{model('')}", "declares entities"),
        (
            model("", head='xmlns:b="http://a.b/beams" requiredextensions="b"'),
            "requires the extension 'http://a.b/beams'",
        ),
    ],
)
def test_damage_is_named_in_one_line(text: str, message: str) -> None:
    with pytest.raises(MeshError, match=message) as caught:
        read_3mf(packed(text))
    assert "\n" not in str(caught.value)


def test_what_is_no_archive_is_refused() -> None:
    with pytest.raises(MeshError, match="no zip archive"):
        read_3mf(b"PK")


def test_an_archive_of_a_version_that_there_is_not_yet_is_refused() -> None:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        archive.writestr("3D/3dmodel.model", "")
    newer = bytearray(data.getvalue())
    newer[newer.index(b"PK\x01\x02") + 6] = 148
    with pytest.raises(MeshError, match="no zip archive"):
        check_archive(bytes(newer))

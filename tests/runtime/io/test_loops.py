"""Polygons come back from the triangles they became; one that a seam cuts comes back as triangles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flexpara.runtime.io.clean.clean import clean
from flexpara.runtime.io.loops import loops_of
from flexpara.runtime.io.obj.read import read_obj
from flexpara.runtime.mesh import Asset, Atlas

HOUSE = """v 0 0 0
v 2 0 0
v 2 2 0
v 1 1 0
v 0 2 0
v 4 0 0
v 4 2 0
f 1 2 3 4 5
f 2 6 7 3
f 1 1 2
"""
"""A concave pentagon, a quad beside it, and a face without area."""


def asset_of(text: str) -> Asset:
    return clean(read_obj(text.encode(), lambda _: None))


def atlas_of(asset: Asset, faces: np.ndarray | None = None, source: np.ndarray | None = None) -> Atlas:
    source = np.arange(len(asset.positions)) if source is None else source
    count = len(source)
    return Atlas(
        positions=asset.positions[source],
        faces=asset.faces if faces is None else faces,
        uv=np.column_stack([np.arange(count), np.zeros(count)]).astype(np.float32),
        normals=np.zeros((count, 3), np.float32),
        face_chart=np.zeros(len(asset.faces), np.int64),
        source_vertex=source,
        size=16,
        padding=1,
    )


def test_polygons_come_back_in_their_order_and_from_their_first_corner() -> None:
    asset = asset_of(HOUSE)
    loops = loops_of(atlas_of(asset), asset)
    assert loops.size.tolist() == [5, 4]
    assert loops.polygon.tolist() == [0, 1]
    np.testing.assert_array_equal(
        asset.positions[loops.vertex[:5]], [[0, 0, 0], [2, 0, 0], [2, 2, 0], [1, 1, 0], [0, 2, 0]]
    )
    np.testing.assert_array_equal(asset.positions[loops.vertex[5:]], [[2, 0, 0], [4, 0, 0], [4, 2, 0], [2, 2, 0]])
    assert loops.cut == 0


def test_a_polygon_that_a_seam_cuts_becomes_triangles() -> None:
    asset = asset_of(HOUSE)
    last = len(asset.faces) - 1
    faces, source = asset.faces.copy(), np.arange(len(asset.positions))
    faces[last] = len(source) + np.arange(3)
    source = np.concatenate([source, asset.faces[last]])
    loops = loops_of(atlas_of(asset, faces, source), asset)
    assert loops.size.tolist() == [5, 3, 3]
    assert loops.polygon.tolist() == [0, 1, 1]
    assert loops.cut == 1


def test_a_polygon_that_was_turned_runs_the_other_way() -> None:
    asset = asset_of("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\nf 1 2 3 4\nf 2 3 6 5\n")
    assert asset.changes["flipped_faces"] == 2
    loops = loops_of(atlas_of(asset), asset)
    assert loops.size.tolist() == [4, 4]
    corner = asset.positions[loops.vertex]
    normals = [np.cross(c[1] - c[0], c[2] - c[0])[2] for c in (corner[:4], corner[4:])]
    assert np.sign(normals[0]) == np.sign(normals[1])


def test_triangles_are_loops_of_three() -> None:
    asset = asset_of(HOUSE)
    bare = Asset(asset.positions, asset.faces, asset.weld, asset.surface)
    loops = loops_of(atlas_of(asset), bare)
    assert set(loops.size.tolist()) == {3}
    np.testing.assert_array_equal(loops.triangles, asset.faces)


def flat_atlas_of(asset: Asset, mirror: float = 1.0) -> Atlas:
    """Uv are the positions, x mirrored where asked."""
    return replace(atlas_of(asset), uv=(asset.positions[:, :2] * [mirror, 1.0]).astype(np.float32))


BENT = "v 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nv 0 0 0\nf 1 2 3 4 5 6\n"
"""An L from a corner whose fan turns inside out; the fan from (1, 1) does not."""
ZIGZAG = "".join(f"v {x} {y} 0\n" for x, y in [(0, 0), (4, 0), (4, 3), (3, 3), (3, 1), (1, 1), (1, 3), (0, 3)])


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_a_concave_polygon_begins_where_its_fan_lies_right(mirror: float) -> None:
    asset = asset_of(BENT)
    loops = loops_of(flat_atlas_of(asset, mirror), asset)
    assert (loops.size.tolist(), loops.cut) == ([6], 0)
    assert asset.positions[loops.vertex[0]].tolist() == [1, 1, 0]
    assert sorted(loops.corner.tolist()) == list(range(6))


STEP = "".join(f"v {x} {y} 0\n" for x, y in [(0, 0), (1, 0), (3, 0), (3, 2), (0, 2)])
"""A rectangle with a corner in the middle of a side: its fan from the first one begins with a triangle of no area."""


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_a_polygon_with_corners_on_a_line_begins_where_all_its_fan_has_area(mirror: float) -> None:
    asset = asset_of(STEP + "f 1 2 3 4 5\n")
    loops = loops_of(flat_atlas_of(asset, mirror), asset)
    assert (loops.size.tolist(), loops.corner.tolist(), loops.cut) == ([5], [1, 2, 3, 4, 0], 0)


THIRDS = [(0, 0), (1, 0), (2, 0), (3, 0), (3, 1), (3, 2), (3, 3), (2, 3), (1, 3), (0, 3), (0, 2), (0, 1)]
"""A square with two corners on each side: no fan of it has area everywhere."""


def test_a_polygon_each_of_whose_fans_has_as_many_triangles_without_area_stays_as_it_is() -> None:
    text = "".join(f"v {x} {y} 0\n" for x, y in THIRDS)
    asset = asset_of(text + "f 2 3 4 5 6 7 8 9 10 11 12 1\n")
    loops = loops_of(flat_atlas_of(asset), asset)
    assert (loops.corner.tolist(), loops.cut) == (list(range(12)), 0)


def test_a_polygon_whose_fans_all_lose_what_has_an_area_in_space_becomes_triangles() -> None:
    bent = [(x, y, 0.1 * (x == 1 or y == 1)) for x, y in THIRDS]
    asset = asset_of("".join(f"v {x} {y} {z}\n" for x, y, z in bent) + "f 1 2 3 4 5 6 7 8 9 10 11 12\n")
    loops = loops_of(flat_atlas_of(asset), asset)
    assert (set(loops.size.tolist()), loops.cut) == ({3}, 1)


def test_a_polygon_that_no_fan_covers_becomes_triangles() -> None:
    asset = asset_of(ZIGZAG + "f 1 2 3 4 5 6 7 8\n")
    loops = loops_of(flat_atlas_of(asset), asset)
    assert loops.cut == 1
    assert set(loops.size.tolist()) == {3}
    points = asset.positions[loops.vertex].reshape(-1, 3, 3)
    area = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])[:, 2] / 2.0
    assert (area > 0.0).all()
    assert area.sum() == pytest.approx(8.0)

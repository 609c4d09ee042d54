"""Edges that are to be seams: two squares by hand, a cube, and files of cuts with mistakes in them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexpara.runtime.errors import InputError, MissingFileError
from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.io.asset.wantedseams import NO_WISH, WantedSeams, read_cuts, wanted_seams
from flexpara.runtime.io.meshfile import asset_from_arrays
from flexpara.runtime.mesh import Asset
from flexpara.runtime.options.seams import SeamOptions
from flexpara.runtime.samples import make_sample

ANGLE = 30.0


def two_squares(rise: float = 0.0) -> Asset:
    """Squares left and right of the edge from (1, 0) to (1, 1), two triangles each; the right one rises."""
    points = [[0, 0, 0], [1, 0, 0], [2, 0, rise], [0, 1, 0], [1, 1, 0], [2, 1, rise]]
    return asset_from_arrays(points, [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])


def edges_of(asset: Asset, wanted: WantedSeams) -> list[list[int]]:
    assert wanted.cut is not None
    return edge_table(asset.surface.faces).edges[wanted.cut].tolist()


def test_nothing_is_wanted_by_default() -> None:
    assert wanted_seams(two_squares(), SeamOptions(), ANGLE) == NO_WISH


def test_a_hard_edge_is_one_above_the_crease_angle_and_none_below() -> None:
    options, bent = SeamOptions(hard_edges="split"), two_squares(rise=1.0)  # 45 degrees
    assert edges_of(bent, wanted_seams(bent, options, 40.0)) == [[1, 4]]
    assert edges_of(bent, wanted_seams(bent, options, 50.0)) == []


def test_split_normals_of_the_file_decide_without_the_angle() -> None:
    flat = two_squares()
    apart = flat.faces.copy()
    apart[2:][apart[2:] == 1], apart[2:][apart[2:] == 4] = 6, 7
    normals = np.tile([0.0, 0.0, 1.0], (8, 1))
    normals[[2, 5, 6, 7]] = [0.0, 0.6, 0.8]
    split = replace(
        flat,
        positions=flat.positions[[0, 1, 2, 3, 4, 5, 1, 4]],
        faces=apart,
        weld=flat.weld[[0, 1, 2, 3, 4, 5, 1, 4]],
        normals=normals,
    )
    assert edges_of(split, wanted_seams(split, SeamOptions(keep_seams=("hard",)), ANGLE)) == [[1, 4]]


def test_borders_of_materials_and_of_uv_are_found() -> None:
    flat = two_squares()
    painted = replace(flat, face_material=np.array([0, 0, 1, 1]), uv=flat.positions[:, :2].copy())
    assert edges_of(painted, wanted_seams(painted, SeamOptions(keep_seams=("material",)), ANGLE)) == [[1, 4]]
    assert edges_of(painted, wanted_seams(painted, SeamOptions(keep_seams=("uv",)), ANGLE)) == []


def test_uv_that_a_mesh_has_not_can_not_be_kept() -> None:
    with pytest.raises(InputError, match="without uv"):
        wanted_seams(two_squares(), SeamOptions(keep_seams=("uv",)), ANGLE)


def test_all_edges_of_a_cube_are_hard_and_no_diagonal_is() -> None:
    cube = asset_from_arrays(*make_sample("cube", resolution=8))
    found = edges_of(cube, wanted_seams(cube, SeamOptions(hard_edges="split"), ANGLE))
    points = cube.surface.vertices
    ends = points[np.array(found)]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    assert np.isclose(length.sum(), 12.0 * np.ptp(points[:, 0]))
    assert ((np.abs(ends[:, 0] - ends[:, 1]) > 1e-9).sum(axis=1) == 1).all()


def test_a_cut_takes_the_shortest_way_between_its_two_points(tmp_path: Path) -> None:
    file = tmp_path / "cuts.txt"
    file.write_text("# down the middle\n1.01 0 0, 1 0.98 0\n\n", encoding="utf-8")
    flat = two_squares()
    assert edges_of(flat, wanted_seams(flat, SeamOptions(cut=file), ANGLE)) == [[1, 4]]


@pytest.mark.parametrize("text", ["1 2 3\n", "1 2 3 4 5 six\n", "", "1 2 3 4 5 nan\n", "0 0 0 1 1 0\n1 2\n"])
def test_a_file_of_other_than_six_numbers_a_line_is_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "cuts.txt"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="six"):
        read_cuts(file)


def test_a_missing_file_and_a_cut_without_length_are_refused(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="six numbers"):
        read_cuts(tmp_path / "none.txt")
    file = tmp_path / "cuts.txt"
    file.write_text("0 0 0 0 0 0\n", encoding="utf-8")
    with pytest.raises(InputError, match="joins no two"):
        wanted_seams(two_squares(), SeamOptions(cut=file), ANGLE)

"""`flexpara pack --pages` and `--udim`, from words to files that others read."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pygltflib
import pytest

from flexpara.__main__ import main
from flexpara.runtime.io.meshfile import load_asset

if TYPE_CHECKING:
    from pathlib import Path

pytest.importorskip("moderngl")

from flexpara.bake.files.images import read_image

RED, BLUE = (255, 0, 0), (0, 0, 255)


def packed(path: Path, out: Path, *words: str) -> int:
    return main(["pack", str(path), "-o", str(out), "--size", "64", "--pages", "2", *words])


def middle(picture: np.ndarray) -> tuple[int, ...]:
    return tuple(picture[len(picture) // 2, len(picture) // 2, :3].tolist())


def test_udim_tiles_hold_an_island_each_and_their_textures_are_named_by_number(house: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert packed(house, out, "--udim") == 0
    made = load_asset(out / "house.obj")
    assert made.uv is not None
    tile = np.floor(made.uv[made.faces].mean(axis=1)).astype(int)
    assert sorted({tuple(place) for place in tile.tolist()}) == [(0, 0), (1, 0)]
    for faces, color in ((slice(0, 2), RED), (slice(2, 4), BLUE)):
        number = 1001 + int(tile[faces][0, 0])
        assert middle(read_image(out / f"house_base-color.{number}.png")) == color
    assert "map_Kd house_base-color.<UDIM>.png" in (out / "house.mtl").read_text(encoding="utf-8")
    report = json.loads((out / "house.report.json").read_text(encoding="utf-8"))
    assert report["tiles"] == [1001, 1002]
    assert report["metrics"]["packing_efficiency"] > 0.85
    assert sum(line.startswith("f ") for line in (out / "house.obj").read_text(encoding="utf-8").splitlines()) == 2


def test_polygons_that_no_fan_covers_are_told_and_counted_on_tiles_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    places = [(0, 0), (4, 0), (4, 3), (3, 3), (3, 1), (1, 1), (1, 3), (0, 3), (6, 0), (7, 0), (7, 1), (6, 1)]
    lines = [f"v {x} {y} 0\nvt {x / 7} {y / 7}" for x, y in places]
    lines += ["f " + " ".join(f"{corner}/{corner}" for corner in face) for face in (range(1, 9), range(9, 13))]
    (tmp_path / "zigzag.obj").write_text("\n".join(lines), encoding="utf-8")
    assert packed(tmp_path / "zigzag.obj", tmp_path / "out", "--udim", "--maps", "none") == 0
    assert "1 polygon cut by seams or covered by no fan, written as triangles" in capsys.readouterr().err
    report = json.loads((tmp_path / "out" / "zigzag.report.json").read_text(encoding="utf-8"))
    assert report["changes"]["polygons_cut"] == 1
    assert "polygons_cut" not in report


def test_usd_names_the_tiles_too(house: Path, tmp_path: Path) -> None:
    assert packed(house, tmp_path / "out", "--udim", "--format", "usda") == 0
    assert "@house_base-color.<UDIM>.png@" in (tmp_path / "out" / "house.usda").read_text(encoding="utf-8")


def test_pages_without_tiles_are_materials_of_one_glb(house: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert packed(house, out) == 0
    file = pygltflib.GLTF2().load(str(out / "house.glb"))
    assert file is not None
    primitives = [primitive for mesh in file.meshes for primitive in mesh.primitives]
    assert len(primitives) == 2
    assert len({primitive.material for primitive in primitives}) == 2
    assert len(file.images) == 2
    colors = {middle(read_image(out / f"house_{page}_base-color.png")) for page in (1, 2)}
    assert colors == {RED, BLUE}
    made = load_asset(out / "house.glb")
    assert made.uv is not None
    assert len(made.faces) == 4
    assert (made.uv >= 0.0).all()
    assert (made.uv <= 1.0).all()
    assert np.ptp(made.uv[made.faces[:2]].reshape(-1, 2), axis=0).min() > 0.85


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--udim", "--format", "glb"), "format glb with udim"),
        (("--udim", "--target", "godot"), "udim with layers, a target or report"),
        (("--format", "obj"), "pass --format glb"),
        (("--stack", "identical"), "stack with several pages"),
    ],
)
def test_what_pages_cannot_hold_is_refused_with_the_remedy(
    house: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], said: str
) -> None:
    assert packed(house, tmp_path / "out", *words) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_pages_are_counted_from_one(house: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["pack", str(house), "-o", str(tmp_path / "out"), "--pages", "0"]) == 2
    assert "pages is 0, expected 1 to 1000" in capsys.readouterr().err

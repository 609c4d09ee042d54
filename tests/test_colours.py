"""Colours of vertices, faces and splats reach the texture as they were, in 8 bits to a step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh
from PIL import Image

from flexpara.__main__ import main
from flexpara.runtime.io.meshfile import load_asset

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

pytest.importorskip("moderngl")

from flexpara.bake.files.images import read_image
from flexpara.runtime.io.points.cloudfile import load_cloud

CUBE = trimesh.creation.box()
ORANGE, TEAL = (255, 128, 64), (10, 200, 180)


def ply(path: Path, vertex: dict[str, NDArray[np.generic]], face: dict[str, NDArray[np.generic]] | None = None) -> None:
    """An ascii PLY of columns; faces of the cube where face holds further columns of them."""
    kinds = {"f": "float", "u": "uchar"}
    lines = ["ply", "format ascii 1.0", f"element vertex {len(vertex['x'])}"]
    lines += [f"property {_kind(values, kinds)} {name}" for name, values in vertex.items()]
    if face is not None:
        lines += [f"element face {len(CUBE.faces)}", "property list uchar int vertex_indices"]
        lines += [f"property {_kind(values, kinds)} {name}" for name, values in face.items()]
    lines.append("end_header")
    lines += [" ".join(str(number) for number in row) for row in zip(*vertex.values(), strict=True)]
    if face is not None:
        more = zip(*face.values(), strict=True) if face else [()] * len(CUBE.faces)
        lines += [
            " ".join(map(str, (3, *corners, *row))) for corners, row in zip(CUBE.faces.tolist(), more, strict=True)
        ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _kind(values: NDArray[np.generic], kinds: dict[str, str]) -> str:
    return "ushort" if values.dtype == np.uint16 else kinds[values.dtype.kind]


def xyz() -> dict[str, NDArray[np.generic]]:
    return dict(zip("xyz", np.asarray(CUBE.vertices, np.float32).T, strict=True))


def unwrapped(path: Path, out: Path) -> None:
    argv = ["unwrap", str(path), "-o", str(out), "--size", "128", "--no-preview", "--quiet", "--maps", "auto"]
    assert main(argv) == 0


def at_faces(out: Path, stem: str) -> NDArray[np.uint8]:
    """(f, 3) colour of the texture under the middle of each face of what was written."""
    made, picture = load_asset(out / f"{stem}.glb"), read_image(out / f"{stem}_base-color.png")
    assert made.uv is not None
    middle = made.uv[made.faces].mean(axis=1)
    column, row = (middle[:, 0] * 128).astype(int), ((1 - middle[:, 1]) * 128).astype(int)
    return np.asarray(picture[row, column, :3], np.uint8)


def test_face_colours_reach_the_texture(tmp_path: Path) -> None:
    of_face = np.where(np.arange(12)[:, None] < 6, ORANGE, TEAL).astype(np.uint8)
    ply(tmp_path / "cube.ply", xyz(), dict(zip(("red", "green", "blue"), of_face.T, strict=True)))
    unwrapped(tmp_path / "cube.ply", tmp_path / "out")
    found = at_faces(tmp_path / "out", "cube").astype(int)
    assert np.abs(found - of_face).max() <= 1


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_vertex_colours_of_8_and_16_bits_reach_the_texture(tmp_path: Path, kind: type[np.unsignedinteger]) -> None:
    level = np.array(ORANGE, np.float64) / 255.0 * np.iinfo(kind).max
    columns = {
        name: np.full(8, round(value), kind) for name, value in zip(("red", "green", "blue"), level, strict=True)
    }
    ply(tmp_path / "cube.ply", {**xyz(), **columns}, {})
    unwrapped(tmp_path / "cube.ply", tmp_path / "out")
    assert np.abs(at_faces(tmp_path / "out", "cube").astype(int) - ORANGE).max() <= 1


def splats(path: Path, count: int = 1500) -> NDArray[np.float64]:
    """A ball of Gaussian splats, orange above and teal below; its points."""
    step = np.arange(count) + 0.5
    polar, turn = np.arccos(1 - 2 * step / count), np.pi * (1 + 5**0.5) * step
    points = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], axis=1)
    color = np.where(points[:, 2:] > 0.0, ORANGE, TEAL) / 255.0
    first = ((color - 0.5) / 0.28209479177387814).astype(np.float32)
    columns = dict(zip("xyz", points.astype(np.float32).T, strict=True))
    columns |= {name: np.zeros(count, np.float32) for name in ("nx", "ny", "nz")}
    columns |= {f"f_dc_{channel}": first[:, channel] for channel in range(3)}
    columns |= {"f_rest_0": np.ones(count, np.float32), "opacity": np.full(count, 9.0, np.float32)}
    ply(path, columns)
    return points


def test_the_first_band_of_splats_is_their_colour_and_opacity_their_alpha(tmp_path: Path) -> None:
    points = splats(tmp_path / "splats.ply")
    cloud = load_cloud(tmp_path / "splats.ply")
    assert cloud.normals is None
    assert cloud.colors is not None
    wanted = np.where(points[:, 2:] > 0.0, ORANGE, TEAL)
    assert np.abs(cloud.colors[:, :3].astype(int) - wanted).max() <= 1
    assert (cloud.colors[:, 3] == 255).all()  # 1 / (1 + e⁻⁹) = .99988


def test_half_open_splats_have_half_an_alpha(tmp_path: Path) -> None:
    columns = dict(zip("xyz", np.eye(4, 3, dtype=np.float32).T, strict=True))
    columns |= {f"f_dc_{channel}": np.zeros(4, np.float32) for channel in range(3)}
    ply(tmp_path / "four.ply", {**columns, "opacity": np.array([0.0, 2.0, -2.0, 40.0], np.float32)})
    colors = load_cloud(tmp_path / "four.ply").colors
    assert colors is not None
    assert colors[:, 0].tolist() == [128] * 4
    np.testing.assert_allclose(colors[:, 3], 255 / (1 + np.exp([0.0, -2.0, 2.0, -40.0])), atol=0.5)


def test_splats_reach_the_texture(tmp_path: Path) -> None:
    splats(tmp_path / "splats.ply")
    unwrapped(tmp_path / "splats.ply", tmp_path / "out")
    made = load_asset(tmp_path / "out" / "splats.glb")
    middle = made.positions[made.faces].mean(axis=1)
    clear = np.abs(middle[:, 2]) > 0.15
    wanted = np.where(middle[:, 2:] > 0.0, ORANGE, TEAL)
    assert np.abs(at_faces(tmp_path / "out", "splats").astype(int) - wanted)[clear].max() <= 2


def sheet(folder: Path, texels: NDArray[np.uint8], mode: str) -> Path:
    """One quad whose material has a texture of its own, in levels of 8 or 16 bits."""
    height, width = texels.shape
    if mode == "I;16":
        Image.fromarray(texels.astype(np.uint16) * 257).save(folder / "levels.png")
    else:
        Image.fromarray(texels).convert(mode).save(folder / "levels.png")
    (folder / "sheet.mtl").write_text("newmtl paint\nKd 1 1 1\nmap_Kd levels.png\n", encoding="utf-8")
    corners = "".join(f"v {x * width} {y * height} 0\nvt {x} {y}\n" for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)))
    path = folder / "sheet.obj"
    path.write_text(f"mtllib sheet.mtl\n{corners}usemtl paint\nf 1/1 2/2 3/3 4/4\n", encoding="utf-8")
    return path


def baked_sheet(path: Path, out: Path, size: str) -> NDArray[np.int64]:
    assert main(["bake", str(path), "-o", str(out), "--maps", "base-color", "--size", size, "--quiet"]) == 0
    return read_image(out / "sheet_base-color.png")[..., :3].astype(np.int64)


@pytest.mark.parametrize("mode", ["L", "RGB", "I;16"])
def test_all_levels_of_a_texture_come_through_baking(tmp_path: Path, mode: str) -> None:
    levels = np.arange(256, dtype=np.uint8).reshape(8, 32).repeat(2, axis=0).repeat(2, axis=1)
    found = baked_sheet(sheet(tmp_path, levels, mode), tmp_path / "out", "64x16")
    assert np.abs(found - levels[..., None]).max() <= 1
    inner = np.full((16, 64), 77, np.uint8)
    (tmp_path / "flat").mkdir()
    flat = baked_sheet(sheet(tmp_path / "flat", inner, mode), tmp_path / "flat" / "out", "64x16")
    assert (flat == 77).all()


def test_texels_are_averaged_in_linear_light(tmp_path: Path) -> None:
    """A checker of black and white texels at half the size is the grey of half the light, 188, not 128."""
    checker = (np.indices((32, 64)).sum(axis=0) % 2 * 255).astype(np.uint8)
    found = baked_sheet(sheet(tmp_path, checker, "L"), tmp_path / "out", "32x16")
    assert np.abs(found - 188).max() <= 1

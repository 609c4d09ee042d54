"""Made meshes that stand in for the real ones where `../shared/models` is absent: the same names and kinds.

bunny, homer: closed, without uv, with long ears or limbs and hollow folds.  spot: closed, with uv in six charts that
don't touch.  fandisk: flat and round faces that meet in creases.  suzanne: quads in three parts, with a face twice,
corners twice and three faces along one edge.  Written as OBJ files.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexpara.runtime.samples import make_sample

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    Bump = tuple[tuple[float, float, float], float, float]

FACTS: dict[str, tuple[int, dict[str, int]]] = {
    "bunny": (20480, {}),
    "spot": (5292, {"welded_vertices": 256}),
    "fandisk": (10800, {}),
    "suzanne": (903, {"welded_vertices": 2, "coincident_faces": 4, "non_manifold_edges": 1, "components": 4}),
}
"""Name → faces that are kept and what cleaning changes."""


def write_standins(folder: Path) -> None:
    """Write NAME.obj for each of MAKERS into an existing folder."""
    for name, make in MAKERS.items():
        (folder / f"{name}.obj").write_text(make(), encoding="utf-8")


def obj_text(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    uv: NDArray[np.float64] | None = None,
    corners: NDArray[np.int64] | None = None,
) -> str:
    """An OBJ file of polygons (f, n) over vertices (v, 3); corners (f, n) index uv (t, 2)."""
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in vertices.tolist()]
    if uv is None or corners is None:
        lines += ["f " + " ".join(map(str, face)) for face in (faces + 1).tolist()]
    else:
        lines += [f"vt {u:.6f} {v:.6f}" for u, v in uv.tolist()]
        pairs = np.stack([faces, corners], axis=-1) + 1
        lines += ["f " + " ".join(f"{vertex}/{corner}" for vertex, corner in face) for face in pairs.tolist()]
    return "\n".join(lines) + "\n"


def bulged(direction: NDArray[np.float64], bumps: list[Bump]) -> NDArray[np.float64]:
    """Unit vectors (v, 3) pushed outwards: each bump has a direction, a height and a sharpness."""
    radius = np.ones(len(direction))
    for towards, height, sharpness in bumps:
        axis = np.asarray(towards) / np.linalg.norm(towards)
        radius += height * np.exp(sharpness * (direction @ axis - 1.0))
    return direction * radius[:, None]


def eared(*ears: Bump) -> str:
    """A warty ball of 20,480 faces with dents, and with ears that lean forwards over it."""
    direction, faces = make_sample("sphere", resolution=160)
    rng = np.random.default_rng(0)
    axes = [(x, y, z) for x, y, z in rng.normal(size=(60, 3)).tolist() if z < 1.0]
    skin = [(axis, 0.15, 250.0) for axis in axes[::2]] + [(axis, -0.35, 40.0) for axis in axes[1::2]]
    x, y, z = bulged(direction, [*ears, *skin]).T
    return obj_text(np.stack([x, y - 2.0 * np.maximum(z - 1.2, 0.0), z], axis=1), faces)


def patchwork() -> str:
    """A lumpy cube of 21 × 21 cells a side, each side a chart of its own, with a gap between charts."""
    cells = 21
    line = np.linspace(-1.0, 1.0, cells + 1)
    u, v = (axis.ravel() for axis in np.meshgrid(line, line, indexing="ij"))
    sides = [
        np.roll(np.stack([u * sign, v, np.full_like(u, sign)], axis=1), shift, axis=1)
        for shift in range(3)
        for sign in (1.0, -1.0)
    ]
    corner = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    faces = np.stack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)], axis=1).reshape(-1, 3)
    corners = np.concatenate([faces + side * len(u) for side in range(6)])
    square = np.stack([(u + 1.0) / 2.0, (v + 1.0) / 2.0], axis=1) * 0.3 + 0.015
    uv = np.concatenate([square + np.array([side % 3 / 3.0, side // 3 / 2.0]) for side in range(6)])
    vertices, weld = np.unique(np.concatenate(sides).round(9), axis=0, return_inverse=True)
    direction = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    lumps = [((1.0, 0.3, 0.2), 0.4, 6.0), ((-0.5, 1.0, 0.1), 0.3, 8.0), ((0.2, -0.4, 1.0), 0.35, 10.0)]
    return obj_text(bulged(direction, lumps), weld.reshape(-1)[corners], uv, corners)


def creased() -> str:
    """A tapered block with two round faces, all its edges sharp."""
    vertices, faces = make_sample("cube", resolution=120)
    x, y, z = vertices.T
    bulge = 1.0 + 0.6 * np.cos(np.pi * x)
    return obj_text(4.0 * np.stack([x * (1.0 - 0.2 * z), y * (1.0 - 0.2 * z), z * bulge], axis=1), faces)


def monkey() -> str:
    """Three lumpy cubes of quads, large, small and small; then a face again and a fin on an edge that has two faces.

    The fin has corners of its own where it meets the cube.
    """
    cells = 5
    vertices, faces = make_sample("cube", resolution=4 * cells)
    quads = np.concatenate([faces[0::2], faces[1::2, 2:]], axis=1)
    ball = bulged(vertices / np.linalg.norm(vertices, axis=1, keepdims=True), [((1.0, 0.2, 0.4), 0.5, 8.0)])
    eyes = [ball * 0.2 + [side * 0.4, -1.2, 0.3] for side in (-1.0, 1.0)]
    every = np.concatenate([quads + part * len(ball) for part in range(3)])
    text = obj_text(np.concatenate([ball, *eyes]), every)
    fin = np.concatenate([ball[quads[10][:2]], [[1.9, 0.0, 0.0]]])
    text += obj_text(fin, np.array([[0, 1, 2]]) + 3 * len(ball))
    return text + "f " + " ".join(str(corner + 1) for corner in quads[20].tolist()) + "\n"


MAKERS: dict[str, Callable[[], str]] = {
    "bunny": lambda: eared(((0.4, 0.1, 1.0), 1.2, 60.0), ((-0.4, 0.1, 1.0), 1.2, 60.0)),
    "homer": lambda: eared(*(((x, 0.2, z), 1.5, 30.0) for x in (-0.8, 0.8) for z in (-1.0, 1.0))),
    "spot": patchwork,
    "fandisk": creased,
    "suzanne": monkey,
}

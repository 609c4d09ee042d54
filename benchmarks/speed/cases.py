"""What is timed: shared models, the bunny subdivided, and made meshes and clouds of a thousand to a million faces.

Each is made once, as FOLDER/NAME.obj with an .npz of vertices (v, 3) and faces (f, 3) beside it for the peers; a cloud
is FOLDER/NAME.npy, points (n, 3), and for flexpara alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.samples import make_sample

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    Mesh = tuple[np.ndarray, np.ndarray]

MODELS = ("spot", "homer", "cow", "bunny")
RESOLUTIONS = (48, 96, 192, 384, 768, 1536)
"""Of the sphere that a scan is made of: 1,280 faces and four times as many each, to 1,310,720."""
NOISE = 0.05
"""Standard deviation of a scan's vertex along its normal, in edge lengths."""
CELLS = (10, 20, 40, 80, 160, 290)
"""Marching cubes along a side of the gyroid: about a thousand faces to a million."""
CLOUDS = (500_000, 1_000_000)


class Case(NamedTuple):
    """One thing to time: its family, and how many faces (of a cloud: points) its file has."""

    family: str
    path: Path
    faces: int


def scan(resolution: int) -> Mesh:
    """A sphere as a scanner would see it, stretched to an egg: vertices (v, 3) and faces (f, 3)."""
    vertices, faces = make_sample("sphere", resolution=resolution)
    edge = float(np.linalg.norm(vertices[faces[:, 0]] - vertices[faces[:, 1]], axis=1).mean())
    noise = np.random.default_rng(0).normal(scale=NOISE * edge, size=(len(vertices), 1))
    return vertices * (1.0 + noise) * [1.0, 0.8, 1.4], faces


def gyroid(cells: int) -> Mesh:
    """A thick gyroid by marching cubes: closed, with a tunnel for each opening, and the slivers that they leave."""
    from skimage.measure import marching_cubes  # of the extra `bench`  # pyright: ignore[reportMissingImports]

    x, y, z = np.meshgrid(*[np.linspace(-np.pi, np.pi, cells)] * 3, indexing="ij")
    sheet = np.abs(np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)) - 0.5
    ball = np.sqrt(x * x + y * y + z * z) - 2.8
    vertices, faces, _, _ = marching_cubes(np.maximum(sheet, ball), 0.0)
    return vertices.astype(np.float64), faces.astype(np.int64)


def subdivided(mesh: Mesh, times: int) -> Mesh:
    """Each face in four, through its edges' midpoints, so many times."""
    for _ in range(times):
        mesh = make_finer(*mesh)
    return mesh


def make_finer(vertices: np.ndarray, faces: np.ndarray) -> Mesh:
    """Each face in four, through its edges' midpoints."""
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, middle = np.unique(ends, axis=0, return_inverse=True)
    (a, b, c), (ab, bc, ca) = faces.T, (middle.reshape(-1, 3) + len(vertices)).T
    four = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    return np.concatenate([vertices, vertices[edges].mean(axis=1)]), np.concatenate([np.stack(f, 1) for f in four])


def sampled(mesh: Mesh, count: int) -> np.ndarray:
    """(n, 3) points drawn evenly on a mesh, with a scanner's noise, in no order."""
    vertices, faces = mesh
    corners, rng = vertices[faces], np.random.default_rng(0)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    chosen = rng.choice(len(faces), size=count, p=area / area.sum())
    u, v = np.sqrt(rng.random(count)), rng.random(count)
    weights = np.stack([1.0 - u, u * (1.0 - v), u * v], axis=1)
    points = np.einsum("nc,ncd->nd", weights, corners[chosen])
    return points + rng.normal(scale=0.2 * np.sqrt(area.sum() / 2.0 / count), size=points.shape)


def write(path: Path, mesh: Mesh) -> None:
    """A mesh as OBJ, and as .npz beside it."""
    vertices, faces = mesh
    np.savez(path.with_suffix(".npz"), vertices=vertices, faces=faces)
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def cases(folder: Path, models: Path | None, most: int) -> Iterator[Case]:
    """All that have at most so many faces, made where they are absent.  models: the folder of the shared ones."""
    for name in MODELS if models is not None else ():
        yield from made(folder, "models", name, lambda name=name: read(models, name), most)
    for times, size in ((1, "225k"), (2, "900k")) if models is not None else ():
        yield from made(folder, "bunny", f"bunny{size}", lambda t=times: subdivided(read(models, "bunny"), t), most)
    for resolution in RESOLUTIONS:
        yield from made(folder, "scan", f"scan{resolution}", lambda n=resolution: scan(n), most)
    for number in CELLS:
        yield from made(folder, "gyroid", f"gyroid{number}", lambda n=number: gyroid(n), most)
    for count in CLOUDS if models is not None else ():
        path = folder / f"cloud{count}.npy"
        if count <= most and not path.exists():
            np.save(path, sampled(read(models, "bunny"), count).astype(np.float32))
        if count <= most:
            yield Case("cloud", path, count)


def read(models: Path | None, name: str) -> Mesh:
    """A shared model as flexpara reads it."""
    assert models is not None
    surface = load_asset(models / f"{name}.obj").surface
    return surface.vertices, surface.faces


def made(folder: Path, family: str, name: str, make: Callable[[], Mesh], most: int) -> Iterator[Case]:
    """The case, its files written where they are absent; none where it has more faces than ``most``."""
    path = folder / f"{name}.obj"
    if not path.exists():
        write(path, make())
    with np.load(path.with_suffix(".npz")) as found:
        faces = len(found["faces"])
    if faces <= most:
        yield Case(family, path, faces)

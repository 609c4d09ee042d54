"""Procedural test surfaces, about one unit in radius, z up, normals outwards (cloth: up).

v vertices · f faces.  `resolution` is about how many edges a circle of radius one has, so f grows with its square.
gyroid and bracket need the manifold3d library; the others only numpy.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import InputError, MissingDependencyError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Vertices = NDArray[np.float64]
    Faces = NDArray[np.int64]
    Sample = tuple[Vertices, Faces]

MAX_RESOLUTION = 2048


def make_sample(name: str, *, resolution: int = 96) -> Sample:
    """Make a test surface by name.

    Args:
        name: a key of SAMPLES.
        resolution: about as many edges as a unit circle on it would have, 3 to MAX_RESOLUTION.

    Returns:
        vertices (v, 3) float64 and faces (f, 3) int64: manifold, consistently oriented, without duplicate vertices.

    Raises:
        InputError: unknown name, or a resolution out of range.
        MissingDependencyError: manifold3d is absent (gyroid, bracket).
    """
    if name not in SAMPLES:
        raise InputError(f"unknown sample {name!r}, expected one of {', '.join(SAMPLES)}")
    if not 3 <= resolution <= MAX_RESOLUTION:
        raise InputError(f"resolution is {resolution}, expected 3 to {MAX_RESOLUTION}; choose another --resolution")
    return SAMPLES[name](resolution)


def sphere(resolution: int) -> Sample:
    """Unit icosphere: closed, genus 0; the icosahedron halved until a great circle has about `resolution` edges."""
    golden = (1.0 + 5.0**0.5) / 2.0
    pole = np.array([[s, t * golden, 0.0] for t in (1, -1) for s in (-1, 1)])
    vertices = np.concatenate([np.roll(pole, shift, axis=1) for shift in range(3)])
    # Two corners of the icosahedron are joined exactly when they are 2 apart; its faces are the 20 such triples.
    near = np.isclose(np.linalg.norm(vertices[:, None] - vertices[None], axis=2), 2.0)
    i, j, k = np.nonzero(near[:, :, None] & near[:, None, :] & near[None])
    faces = np.stack([i, j, k], axis=1)[(i < j) & (j < k)]
    inward = np.einsum("fc,fc->f", np.cross(vertices[faces[:, 0]], vertices[faces[:, 1]]), vertices[faces[:, 2]]) < 0.0
    faces = np.where(inward[:, None], faces[:, [0, 2, 1]], faces)
    for _ in range(max(0, round(np.log2(resolution / 5.0)))):
        vertices, faces = _halved(vertices, faces)
        vertices = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    return vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces


def torus(resolution: int) -> Sample:
    """Torus of radii 0.7 and 0.3 around the z axis: closed, genus 1."""
    small = max(3, round(resolution * 0.3 / 0.7))
    u, v = _angles(resolution, small)
    ring = 0.7 + 0.3 * np.cos(v)
    return _points(ring * np.cos(u), ring * np.sin(u), 0.3 * np.sin(v)), _grid(resolution, small, wrap=(True, True))


def trefoil(resolution: int) -> Sample:
    """Tube of radius 0.14 around a trefoil knot: closed, genus 1, knotted."""
    along, around = 3 * resolution, max(6, round(0.14 * resolution))
    t = np.linspace(0.0, 2.0 * np.pi, along, endpoint=False)
    line = _points(np.sin(t) + 2.0 * np.sin(2.0 * t), np.cos(t) - 2.0 * np.cos(2.0 * t), -np.sin(3.0 * t)) / 3.2
    first = _points(np.cos(t) + 4.0 * np.cos(2.0 * t), -np.sin(t) + 4.0 * np.sin(2.0 * t), -3.0 * np.cos(3.0 * t))
    second = _points(-np.sin(t) - 8.0 * np.sin(2.0 * t), -np.cos(t) + 8.0 * np.cos(2.0 * t), 9.0 * np.sin(3.0 * t))
    # The curvature of this knot never vanishes, so its Frenet frame is smooth and closes.
    binormal = np.cross(first, second)
    binormal /= np.linalg.norm(binormal, axis=1, keepdims=True)
    normal = np.cross(binormal, first)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    v = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)[None, :, None]
    tube = line[:, None] + 0.14 * (np.cos(v) * normal[:, None] + np.sin(v) * binormal[:, None])
    return tube.reshape(-1, 3), _grid(along, around, wrap=(True, True))[:, [0, 2, 1]]


def tube(resolution: int) -> Sample:
    """Cylinder of radius 0.5 and height 2 without caps: two boundary loops; normals point away from the axis."""
    rows = max(2, round(resolution * 2.0 / np.pi))
    u, z = np.meshgrid(
        np.linspace(0.0, 2.0 * np.pi, resolution, endpoint=False), np.linspace(-1.0, 1.0, rows + 1), indexing="ij"
    )
    return _points(0.5 * np.cos(u), 0.5 * np.sin(u), z), _grid(resolution, rows + 1, wrap=(True, False))


def cone(resolution: int) -> Sample:
    """Cone of base radius 0.5 and height 1 without base, apex at (0, 0, 1): a developable disk but for its apex."""
    rows = max(2, round(resolution * np.hypot(0.5, 1.0) / np.pi))
    u, z = np.meshgrid(
        np.linspace(0.0, 2.0 * np.pi, resolution, endpoint=False), np.linspace(0.0, 1.0, rows + 1)[:-1], indexing="ij"
    )
    side = _points(0.5 * (1.0 - z) * np.cos(u), 0.5 * (1.0 - z) * np.sin(u), z)
    top = np.arange(resolution) * rows + rows - 1
    cap = np.stack([top, np.roll(top, -1), np.full(resolution, len(side))], axis=1)
    return np.vstack([side, [[0.0, 0.0, 1.0]]]), np.vstack([_grid(resolution, rows, wrap=(True, False)), cap])


def cube(resolution: int) -> Sample:
    """Cube of side 1 around the origin, resolution/4 cells along each edge: closed, with creases."""
    cells = max(1, resolution // 4)
    u, v = (axis.ravel() for axis in np.meshgrid(np.arange(cells + 1), np.arange(cells + 1), indexing="ij"))
    top = np.stack([u, v, np.full_like(u, cells)], axis=1)
    bottom = np.stack([v, u, np.zeros_like(u)], axis=1)
    corners = np.concatenate([np.roll(side, shift, axis=1) for shift in range(3) for side in (top, bottom)])
    grid = _grid(cells + 1, cells + 1, wrap=(False, False))
    faces = np.concatenate([grid + side * len(u) for side in range(6)])
    vertices, index = np.unique(corners, axis=0, return_inverse=True)
    return vertices / cells - 0.5, index.reshape(-1)[faces].astype(np.int64)


def cloth(resolution: int) -> Sample:
    """Wavy sheet over [−1, 1]², as a height field z: open, one boundary loop, curved both ways."""
    line = np.linspace(-1.0, 1.0, resolution + 1)
    x, y = np.meshgrid(line, line, indexing="ij")
    z = 0.16 * np.sin(3.0 * x + 1.2 * y) + 0.10 * np.cos(4.2 * y - 1.7 * x) + 0.05 * np.sin(7.0 * x) * np.sin(5.0 * y)
    return _points(x, y, z), _grid(resolution + 1, resolution + 1, wrap=(False, False))


def gyroid(resolution: int) -> Sample:
    """One labyrinth of a gyroid inside the unit ball: closed, of high genus."""
    manifold = _manifold3d().Manifold
    wave = 2.0 * math.pi / 1.1

    def inside(x: float, y: float, z: float) -> float:
        # The shifts keep the surface off the points of the sampling lattice, where it would leave slivers.
        a, b, c = wave * x + 0.37, wave * y + 0.23, wave * z - 0.31
        return (math.sin(a) * math.cos(b) + math.sin(b) * math.cos(c) + math.sin(c) * math.cos(a)) / wave

    edge = 2.0 * math.pi / resolution
    solid = manifold.level_set(inside, [-1.1, -1.1, -1.1, 1.1, 1.1, 1.1], edge)
    pieces = (solid ^ manifold.sphere(1.0, resolution)).decompose()
    largest = max(pieces, key=lambda piece: piece.volume())
    return _mesh(largest.set_tolerance(0.01 * edge))  # without most slivers that cutting leaves


def bracket(resolution: int) -> Sample:
    """L-shaped bracket with a rib and five drilled holes, made by solid modelling: creases, long flats, genus 5."""
    manifold = _manifold3d().Manifold
    segments = max(12, resolution // 2)
    foot = manifold.cube((2.0, 1.2, 0.2)).translate((-1.0, -0.6, 0.0))
    wall = manifold.cube((0.2, 1.2, 1.4)).translate((-1.0, -0.6, 0.0))
    rib = _manifold3d().CrossSection([[(0.0, 0.0), (0.9, 0.0), (0.0, 0.9)]]).extrude(0.16)
    rib = rib.rotate((90.0, 0.0, 0.0)).translate((-0.85, 0.08, 0.15))
    drill = manifold.cylinder(1.0, 0.13, circular_segments=segments, center=True)
    holes = [drill.translate((x, y, 0.0)) for x, y in ((0.1, -0.35), (0.1, 0.35), (0.7, -0.35), (0.7, 0.35))]
    bore = manifold.cylinder(1.0, 0.2, circular_segments=segments, center=True)
    holes.append(bore.rotate((0.0, 90.0, 0.0)).translate((-1.0, 0.0, 1.12)))
    solid = foot + wall + rib
    for hole in holes:
        solid -= hole
    return _mesh(solid.translate((0.0, 0.0, -0.6)).refine_to_length(8.0 / resolution))


SAMPLES: dict[str, Callable[[int], Sample]] = {
    "sphere": sphere,
    "torus": torus,
    "trefoil": trefoil,
    "gyroid": gyroid,
    "bracket": bracket,
    "cloth": cloth,
    "tube": tube,
    "cone": cone,
    "cube": cube,
}


def _manifold3d() -> Any:
    try:
        import manifold3d
    except ImportError as error:
        raise MissingDependencyError(
            "manifold3d is absent, which this sample is made with; pip install 'flexpara[samples]'"
        ) from error
    return manifold3d


def _mesh(solid: Any) -> Sample:
    mesh = solid.to_mesh64()
    return np.array(mesh.vert_properties[:, :3], dtype=np.float64), np.array(mesh.tri_verts, dtype=np.int64)


def _points(x: Vertices, y: Vertices, z: Vertices) -> Vertices:
    return np.stack([x, y, z], axis=-1).reshape(-1, 3)


def _angles(columns: int, rows: int) -> tuple[Vertices, Vertices]:
    u = np.linspace(0.0, 2.0 * np.pi, columns, endpoint=False)
    v = np.linspace(0.0, 2.0 * np.pi, rows, endpoint=False)
    u, v = np.meshgrid(u, v, indexing="ij")
    return u, v


def _grid(columns: int, rows: int, *, wrap: tuple[bool, bool]) -> Faces:
    """Two triangles per cell of a (columns, rows) array of vertices, right-handed about ∂u × ∂v."""
    i, j = np.meshgrid(np.arange(columns - (not wrap[0])), np.arange(rows - (not wrap[1])), indexing="ij")
    i, j = i.ravel(), j.ravel()
    right, up = (i + 1) % columns, (j + 1) % rows
    a, b, c, d = i * rows + j, right * rows + j, right * rows + up, i * rows + up
    return np.stack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)], axis=1).reshape(-1, 3)


def _halved(vertices: Vertices, faces: Faces) -> Sample:
    """Each face in four, through its edges' midpoints."""
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    distinct, index = np.unique(edges, axis=0, return_inverse=True)
    middle = len(vertices) + index.reshape(-1, 3)
    (a, b, c), (ab, bc, ca) = faces.T, middle.T
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    finer = np.stack([np.stack(part, axis=1) for part in parts], axis=1).reshape(-1, 3)
    return np.concatenate([vertices, vertices[distinct].mean(axis=1)]), finer

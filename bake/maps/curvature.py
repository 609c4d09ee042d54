"""Mean curvature of the mesh itself, not of its picture: where it is convex, flat, hollow.

v surface vertices · e edges.  The curvature of a triangle mesh sits in its edges: an edge of length l whose faces turn
by the angle β carries ½ l β of integrated mean curvature (Cohen-Steiner and Morvan 2003; Steiner's formula), β > 0
where the surface is convex.  Sums over a neighbourhood, divided by its area, converge to the mean curvature
H = (κ₁ + κ₂) / 2, in 1 / source units: 1 / r on a ball of radius r.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_matrix

from ...runtime.geometry.topology import edge_table
from ...runtime.mesh import Frame

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ...runtime.mesh import Asset, Atlas, Surface
    from ..raster.gbuffer import GBuffer

ROUNDS = 2
"""How often curvature and area are shared among neighbours: evens out what the tessellation, not the shape, bends."""
RADIUS = 0.1
"""Of the ball that is shown at 3/4, in radii of the mesh: features the eye sees differ around here."""


def curvature_map() -> Callable[[GBuffer, Atlas, Asset], NDArray[np.float32]]:
    """Mean curvature, shaped to [0, 1]: ½ flat, above convex, below hollow: ½ + ½ x / (1 + |x|), x = H · RADIUS · r.

    r is the radius of the mesh's bounding ball.  No space; unit, PNG 8 bits dithered by default (1 channel).
    """
    ready = lru_cache(maxsize=1)(mean_curvature)

    def compute(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
        del atlas
        surface = asset.surface
        scaled = (ready(surface) * RADIUS * Frame.of(surface.vertices).scale)[:, None]
        height, width = gbuffer.shape
        result = np.full((height * width, 1), 0.5, np.float32)
        for texels in gbuffer.chunks():
            bend = gbuffer.interpolate(scaled, surface.faces, texels)
            result[texels] = 0.5 + 0.5 * bend / (1.0 + np.abs(bend))
        return result.reshape(height, width, 1)

    return compute


def mean_curvature(surface: Surface, *, rounds: int = ROUNDS) -> NDArray[np.float64]:
    """(v,) float64 mean curvature at the vertices, 1 / source units, convex positive.

    rounds: how often it is averaged with the neighbours.  Border edges and edges of more than two faces carry none.
    """
    edges, integral = edge_curvature(surface)
    count = len(surface.vertices)
    bend, area = np.zeros(count), np.zeros(count)
    np.add.at(bend, edges, 0.5 * integral[:, None])
    np.add.at(area, surface.faces, surface.face_areas()[:, None] / 3.0)
    pairs = edge_table(surface.faces).edges
    for _ in range(rounds):
        bend, area = shared(bend, pairs), shared(area, pairs)
    return bend / np.maximum(area, np.finfo(np.float64).tiny)


def edge_curvature(surface: Surface) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Manifold edges (e, 2) and the mean curvature each carries, ½ l β, (e,) in source units."""
    table = edge_table(surface.faces)
    edges = table.edges[table.manifold]
    first, second = table.edge_faces[table.manifold].T
    half = table.edge_halfedges[table.manifold, 0]
    start, end = surface.faces[first, half % 3], surface.faces[first, (half + 1) % 3]
    along = surface.vertices[end] - surface.vertices[start]
    length = np.linalg.norm(along, axis=1)
    normal = surface.face_normals()
    sine = np.einsum("ei,ei->e", np.cross(normal[first], normal[second]), along) / np.maximum(length, 1e-300)
    cosine = np.einsum("ei,ei->e", normal[first], normal[second])
    return edges, 0.5 * length * np.arctan2(sine, cosine)


def shared(amount: NDArray[np.float64], pairs: NDArray[np.int64]) -> NDArray[np.float64]:
    """(v,) amounts after each vertex gave half of its own to its neighbours in equal parts; the sum stays."""
    count = len(amount)
    degree = np.bincount(pairs.reshape(-1), minlength=count)
    give = 0.5 * amount / np.maximum(degree, 1)
    link = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count)).tocsr()
    return np.where(degree > 0, 0.5 * amount, amount) + link @ give + link.T @ give

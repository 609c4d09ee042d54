"""Uv that are valid as written: points of a lattice that float32 holds exactly, with every triangle kept upright.

The lattice is 2⁻²⁴ · {0, 1, …, 2²⁴}²: float32 holds it, 1 − v included, so files that flip v change nothing.
v uv vertices · f faces · h charts' outline half-edges.  Lengths here are in lattice units.

Rounding alone turns slivers over.  Around each of them vertices then move until every triangle is at least `height`
high: from 2 units on, rounding (0.71 at a corner, 0.71 at the edge across) can't turn it over.  Each step projects the
triangles that are too low onto that constraint (position-based dynamics, Müller et al. 2007) and averages what their
corners are told; charts that overlap are pushed apart the same way, a corner of one against an edge of the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...geometry.overlap import overlapping_pairs
from ...geometry.triangles import cross_2d

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..config import LatticeConfig

STEPS = 2**24
"""Lattice units along the side of the atlas."""


@dataclass(frozen=True, eq=False)
class Snapped:
    """Lattice points, proven: each face upright, no two faces overlapping, but for those of the charts named.

    points: (v, 2) float64, whole numbers in [0, STEPS].  invalid: (i,) int64 charts that could not be made valid.
    moved: how many vertices are not simply the rounded ones.  farthest: of them from where it came, units.
    """

    points: NDArray[np.float64]
    invalid: NDArray[np.int64]
    moved: int
    farthest: float


@dataclass(frozen=True, eq=False)
class _Triples:
    """Corners (t, 3) that have to turn left by sign (t,), `height` above their longest edge, or edge 0 where alone."""

    corner: NDArray[np.int64]
    sign: NDArray[np.float64]
    contact: NDArray[np.bool_]

    def and_also(self, other: _Triples) -> _Triples:
        return _Triples(
            np.concatenate([self.corner, other.corner]),
            np.concatenate([self.sign, other.sign]),
            np.concatenate([self.contact, other.contact]),
        )


def snap(
    uv: NDArray[np.float64],
    faces: NDArray[np.int64],
    face_chart: NDArray[np.int64],
    outline: NDArray[np.bool_],
    config: LatticeConfig,
) -> Snapped:
    """Atlas uv on the lattice.

    Args:
        uv: (v, 2) float64 in [0, 1], no two of a chart joined but where faces share the vertex.
        faces: (f, 3) int64 into uv.
        face_chart: (f,) int64.
        outline: (f, 3) bool, edge i of the face lies on the outline of its chart.
        config: numbers.

    Returns:
        The points, and which charts could not be made valid.  Mirrored charts stay mirrored.
    """
    exact = uv * float(STEPS)
    rounded = np.clip(np.rint(exact), 0.0, float(STEPS))
    sign = _chart_signs(exact, faces, face_chart)
    border = np.unique(np.concatenate([faces[outline], np.roll(faces, -1, axis=1)[outline]]))
    near = np.asarray(np.isin(faces, border).any(axis=1))
    faults = _Faults.of(rounded, faces, sign, near)
    deep = faults.deeper_than(config.deepest)
    lost = np.unique(face_chart[deep])
    points = _repaired(exact, faces, np.where(np.isin(face_chart, lost), 0.0, sign), near, config)
    around = np.asarray((points != rounded).any(axis=1)[faces].any(axis=1))
    faults = _Faults.of(points, faces, sign, near | around)
    invalid = np.union1d(lost, face_chart[faults.deeper_than(-np.inf)])
    keep = np.unique(faces[np.isin(face_chart, invalid)])
    points[keep] = rounded[keep]
    moved = (points != rounded).any(axis=1)
    farthest = float(np.linalg.norm(points - exact, axis=1)[moved].max(initial=0.0))
    return Snapped(points, invalid, int(moved.sum()), farthest)


def _repaired(
    exact: NDArray[np.float64],
    faces: NDArray[np.int64],
    sign: NDArray[np.float64],
    near: NDArray[np.bool_],
    config: LatticeConfig,
) -> NDArray[np.float64]:
    """Lattice points (v, 2) after the repair of all faces (f,) whose sign is not 0; near (f,): those at outlines."""
    points, active = exact, np.zeros(len(faces), dtype=bool)
    contacts = _Triples(np.zeros((0, 3), np.int64), np.zeros(0), np.zeros(0, dtype=bool))
    ring: _Ring | None = None
    for _ in range(config.rounds):
        rounded = np.clip(np.rint(points), 0.0, float(STEPS))
        faults = _Faults.of(rounded, faces, sign, near | active, together=False)
        if not faults.any:
            return rounded
        ring = ring or _Ring.of(faces, sign, len(exact))
        active[faults.faces] = True
        contacts = contacts.and_also(faults.contacts)
        points, active = _relaxed(points, ring, active, contacts, config)
    return np.clip(np.rint(points), 0.0, float(STEPS))


@dataclass(frozen=True, eq=False)
class _Faults:
    """What is not valid at lattice points.

    faces: (b,) int64 faces that are not upright.  depth: (b,) how far they are turned over, heights in units.
    pairs: (p, 2) int64 faces that overlap.  contacts: three triples a pair that push them apart.  overlap: (p,) how far
    they reach into each other, units.
    """

    faces: NDArray[np.int64]
    depth: NDArray[np.float64]
    pairs: NDArray[np.int64]
    contacts: _Triples
    overlap: NDArray[np.float64]

    @classmethod
    def of(
        cls,
        points: NDArray[np.float64],
        faces: NDArray[np.int64],
        sign: NDArray[np.float64],
        near: NDArray[np.bool_],
        *,
        together: bool = True,
    ) -> _Faults:
        """The faults of the faces whose sign is not 0; overlaps are looked for among those near (f,) alone.

        together: look for overlaps even where some face is not upright, which mostly explains them.
        """
        height = sign * _doubled(points[faces])
        low = np.flatnonzero((height <= 0.0) & (sign != 0.0))
        edge = points[np.roll(faces[low], -1, axis=1)] - points[faces[low]]
        longest = np.sqrt((edge**2).sum(axis=2).max(axis=1, initial=0.0))
        some = np.flatnonzero(near & (sign != 0.0) & (together or len(low) == 0))
        pairs = some[overlapping_pairs(points[faces[some]])]
        contacts, overlap = _contacts(points, faces, sign, pairs)
        return cls(low, -height[low] / np.maximum(longest, 1.0), pairs, contacts, overlap)

    @property
    def any(self) -> bool:
        """Whether there are any."""
        return len(self.faces) + len(self.pairs) > 0

    def deeper_than(self, depth: float) -> NDArray[np.int64]:
        """The faces of those faults that are deeper; one may be named twice."""
        return np.concatenate([self.faces[self.depth > depth], self.pairs[self.overlap > depth].reshape(-1)])


def _doubled(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """(t,) twice the signed areas of corners (t, 3, 2); exact for lattice points, whose products float64 holds."""
    return cross_2d(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _chart_signs(
    points: NDArray[np.float64], faces: NDArray[np.int64], face_chart: NDArray[np.int64]
) -> NDArray[np.float64]:
    """(f,) 1 for the faces of a chart that lies face up, −1 for those of a mirrored one."""
    return np.where(np.bincount(face_chart, _doubled(points[faces])) < 0.0, -1.0, 1.0)[face_chart]


@dataclass(frozen=True, eq=False)
class _Ring:
    """Faces (f, 3) with their signs (f,), and those around each vertex: face[first[v] : first[v + 1]]."""

    faces: NDArray[np.int64]
    sign: NDArray[np.float64]
    face: NDArray[np.int64]
    first: NDArray[np.int64]

    @classmethod
    def of(cls, faces: NDArray[np.int64], sign: NDArray[np.float64], count: int) -> _Ring:
        corner = faces.reshape(-1)
        first = np.append(0, np.cumsum(np.bincount(corner, minlength=count)))
        return cls(faces, sign, np.argsort(corner, kind="stable") // 3, first)

    def count(self, vertices: NDArray[np.int64]) -> NDArray[np.int64]:
        """How many faces lie around each of the vertices."""
        return self.first[vertices + 1] - self.first[vertices]

    def around(self, vertices: NDArray[np.int64]) -> NDArray[np.int64]:
        """Faces around any of the vertices; one may be named twice."""
        begin, count = self.first[vertices], self.count(vertices)
        offset = np.arange(int(count.sum())) - np.repeat(np.cumsum(count) - count, count)
        return self.face[np.repeat(begin, count) + offset]


def _relaxed(
    points: NDArray[np.float64],
    ring: _Ring,
    active: NDArray[np.bool_],
    contacts: _Triples,
    config: LatticeConfig,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Points and the faces (f,) that were kept high on the way: those active, and all around a vertex that moved."""
    points, active = points.copy(), active.copy()
    rows = np.flatnonzero(active)
    for _ in range(config.sweeps):
        triples = _Triples(ring.faces[rows], ring.sign[rows], np.zeros(len(rows), dtype=bool)).and_also(contacts)
        vertex, step = _projected(points, triples, config)
        if len(vertex) == 0:
            break
        points[vertex] += config.relaxation * step
        fresh = ring.around(vertex)
        if not active[fresh].all():
            active[fresh] = True
            rows = np.flatnonzero(active)
    return points, active


def _projected(
    points: NDArray[np.float64], triples: _Triples, config: LatticeConfig
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Vertices (m,) and steps (m, 2) that raise what is too low: each triple's projection, averaged at the vertices."""
    corner = points[triples.corner]
    edge = np.roll(corner, -1, axis=1) - corner
    square = (edge**2).sum(axis=2)
    base = np.sqrt(np.where(triples.contact, square[:, 0], square.max(axis=1)))
    lack = config.height * base - triples.sign * _doubled(corner)
    low = np.flatnonzero((lack > 0.0) | (base == 0.0))
    lack = np.maximum(lack + config.aim * config.height * base, 0.0)[low]
    across = np.roll(edge[low], -1, axis=1)  # the edge that faces each corner
    slope = triples.sign[low, None, None] * np.stack([-across[..., 1], across[..., 0]], axis=2)
    share = lack / np.maximum(square[low].sum(axis=1), np.finfo(np.float64).tiny)
    step = np.where((base[low] > 0.0)[:, None, None], share[:, None, None] * slope, _APART * config.height)
    turn = np.where(triples.sign[low, None] < 0.0, [1.0, -1.0], 1.0)
    step = np.where((base[low] > 0.0)[:, None, None], step, step * turn[:, None])
    vertex, index = np.unique(triples.corner[low], return_inverse=True)
    index = index.reshape(-1)
    count = np.bincount(index, minlength=len(vertex))
    total = np.stack([np.bincount(index, step[..., i].reshape(-1), len(vertex)) for i in (0, 1)], axis=1)
    return vertex, total / count[:, None]


_APART = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
"""Where the corners of a triangle go that lie in one point, in heights."""


def _contacts(
    points: NDArray[np.float64], faces: NDArray[np.int64], sign: NDArray[np.float64], pairs: NDArray[np.int64]
) -> tuple[_Triples, NDArray[np.float64]]:
    """Triples that push the two faces of each pair (p, 2) apart, along the edge that separates them best; and how far.

    An edge a → b of one face and a corner c of the other make the triple (b, a, c): c has to lie beyond the edge.
    """
    corner, orientation = [], []
    for one, other in ((0, 1), (1, 0)):
        for i in range(3):
            a, b = faces[pairs[:, one], i], faces[pairs[:, one], (i + 1) % 3]
            corner.append(np.stack([np.stack([b, a, c], axis=1) for c in faces[pairs[:, other]].T], axis=1))
            orientation.append(sign[pairs[:, one]])
    triple, turn = np.stack(corner, axis=1), np.stack(orientation, axis=1)  # (p, 6, 3, 3) and (p, 6)
    shared = (triple[..., 2] == triple[..., 0]) | (triple[..., 2] == triple[..., 1])
    flat = points[triple]
    length = np.linalg.norm(flat[..., 1, :] - flat[..., 0, :], axis=-1)
    beyond = turn[..., None] * cross_2d(flat[..., 1, :] - flat[..., 0, :], flat[..., 2, :] - flat[..., 0, :])
    beyond = np.where(shared, np.inf, beyond / np.maximum(length, 1.0))
    apart = beyond.min(axis=2)
    best = apart.argmax(axis=1)
    row = np.arange(len(pairs))
    chosen, kept = triple[row, best].reshape(-1, 3), ~shared[row, best].reshape(-1)
    triples = _Triples(chosen[kept], np.repeat(turn[row, best], 3)[kept], np.ones(int(kept.sum()), dtype=bool))
    return triples, -apart[row, best]

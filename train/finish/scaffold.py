"""The plane around a chart as triangles, so that SLIM, which flips none of them, never lets the chart lie over itself.

A constrained Delaunay triangulation of the border's points and of a ring around them, less the chart itself.  After
each few steps it is made anew, at rest as it lies (Jiang, Schaefer & Panozzo 2017).   v vertices · b directed border
edges, the chart to their left.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial import Delaunay, QhullError

from ...runtime.kernel.choice import kernel
from .contact import Relaxed, boundary_edges, converge, excess_energy, is_valid, rim_overlaps
from .plainslim import PlainSlim

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Surface
    from .config import ContactConfig, ScaffoldConfig

    Edge = tuple[int, int]


class Scaffold(NamedTuple):
    """Triangles (s, 3) around a chart of v vertices; those from v on are the points of a ring (r, 2)."""

    faces: NDArray[np.int64]
    ring: NDArray[np.float64]


def relaxed_within(
    surface: Surface, uv: NDArray[np.float64], config: ContactConfig, goal: float = np.inf
) -> NDArray[np.float64]:
    """Uv (v, 2) after SLIM from a valid one: freely first; where that ends in overlap, within scaffolds.

    The start where ``goal`` (excess energy) is out of sight or there is no scaffold to be had.
    """
    free = converge(surface, Relaxed(uv, {}), goal, config)
    if free is None or not np.isfinite(free).all():
        return uv
    if not rim_overlaps(surface.faces, boundary_edges(surface.faces), free):
        return free
    held = held_apart(surface, uv, config.scaffold, goal)
    return uv if held is None or not is_valid(surface, held) else held


def held_apart(
    surface: Surface, uv: NDArray[np.float64], config: ScaffoldConfig, goal: float = np.inf
) -> NDArray[np.float64] | None:
    """Uv (v, 2) after SLIM from a valid one, valid at every step.

    None where there is no scaffold to be had, or as soon as ``goal`` (excess energy) is out of sight.
    """
    edges, area = boundary_edges(surface.faces), float(surface.face_areas().sum())
    uv = opened_a_little(surface, uv, edges, config.gap)
    energy, quiet = excess_energy(surface, uv), 0
    for _ in range(config.rounds):
        scaffold = scaffold_around(uv, edges, config)
        if scaffold is None:
            return None
        weight = config.share * max(energy, config.least * area) / len(scaffold.faces)
        uv = slim_within(surface, uv, scaffold, weight, config.iterations)
        if not np.isfinite(uv).all():
            return None
        before, energy = energy, excess_energy(surface, uv)
        drop = before - energy
        quiet = quiet + 1 if drop < config.still * before else 0
        if energy - config.patience * drop > goal:
            return None
        if quiet > 1:
            break
    return uv


def slim_within(
    surface: Surface, uv: NDArray[np.float64], scaffold: Scaffold, weight: float, iterations: int
) -> NDArray[np.float64]:
    """Uv (v, 2) after so many iterations of SLIM; each triangle of the scaffold counts like ``weight`` of area."""
    both, compiled = np.concatenate([uv, scaffold.ring]), kernel()
    if compiled is None:
        return PlainSlim(surface, both, scaffold.faces, weight).run(iterations)[: len(uv)]
    points = np.concatenate([surface.vertices, np.zeros((len(scaffold.ring), 3))])
    return compiled.Slim(points, surface.faces, both, scaffold.faces, weight).run(iterations)[: len(uv)]


def opened_a_little(
    surface: Surface, uv: NDArray[np.float64], edges: NDArray[np.int64], gap: float
) -> NDArray[np.float64]:
    """Uv (v, 2) with the border vertices that lie at one place moved into their own faces a little."""
    rim = np.unique(edges)
    where, count = np.unique(uv[rim], axis=0, return_inverse=True, return_counts=True)[1:]
    double = rim[count[where.reshape(-1)] > 1]
    if not len(double):
        return uv
    middle, faces = uv[surface.faces].mean(axis=1), surface.faces.reshape(-1)
    total = np.bincount(faces, minlength=len(uv))
    inner = np.stack([np.bincount(faces, np.repeat(at, 3), minlength=len(uv)) for at in middle.T], axis=1)
    moved = uv.copy()
    moved[double] += gap * (inner[double] / total[double, None] - uv[double])
    return moved


def scaffold_around(uv: NDArray[np.float64], edges: NDArray[np.int64], config: ScaffoldConfig) -> Scaffold | None:
    """Triangles of the plane around a chart uv (v, 2) whose border (b, 2) does not cross itself.

    None where there are none to be had: where it does, or two of its vertices lie at one place.
    """
    rim = np.unique(edges)
    points = uv[rim]
    middle, reach = points.mean(axis=0), config.away * float(np.linalg.norm(points - points.mean(axis=0), axis=1).max())
    angle = 2.0 * np.pi * np.arange(config.points) / config.points
    ring = middle + reach * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    both = np.concatenate([points, ring])
    try:
        first = Delaunay(both)
    except QhullError:
        return None
    if len(first.coplanar):
        return None
    place = np.zeros(len(uv), dtype=np.int64)
    place[rim] = np.arange(len(rim))
    net = Net(both, first.simplices.astype(np.int64), config.turns)
    wanted = [(a, b) for a, b in place[edges].tolist()]
    if not all(net.contains(*edge) or net.insert(*edge) for edge in wanted):
        return None
    outer = net.right_of(wanted) if all(net.contains(*edge) for edge in wanted) else None
    if outer is None:
        return None
    number = np.concatenate([rim, len(uv) + np.arange(config.points)])
    return Scaffold(number[outer], ring)


class Net:
    """A triangulation of points (n, 2) on its way to hold some edges: third corner of the face left of each edge."""

    def __init__(self, points: NDArray[np.float64], faces: NDArray[np.int64], patience: int) -> None:
        a, b, c = points[faces].transpose(1, 0, 2)
        turned = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) < (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
        faces = np.where(turned[:, None], faces[:, ::-1], faces)
        self.x, self.y = points[:, 0].tolist(), points[:, 1].tolist()
        self.patience = patience
        self.third: dict[Edge, int] = {}
        self.next = [-1] * len(points)
        for i, j, k in faces.tolist():
            self.put(i, j, k)

    def put(self, i: int, j: int, k: int) -> None:
        """Take a face in."""
        self.third[i, j], self.third[j, k], self.third[k, i] = k, i, j
        self.next[i], self.next[j], self.next[k] = j, k, i

    def contains(self, a: int, b: int) -> bool:
        """Whether an edge is there, with a face on either side."""
        return (a, b) in self.third and (b, a) in self.third

    def turn(self, a: int, b: int, c: int) -> float:
        """Twice the area of a triangle, positive where it turns left."""
        x, y = self.x, self.y
        return (x[b] - x[a]) * (y[c] - y[a]) - (y[b] - y[a]) * (x[c] - x[a])

    def crosses(self, a: int, b: int, p: int, q: int) -> bool:
        """Whether the open segments a–b and p–q cross."""
        if len({a, b, p, q}) < 4:
            return False
        one, two = self.turn(a, b, p), self.turn(a, b, q)
        return one * two < 0.0 and self.turn(p, q, a) * self.turn(p, q, b) < 0.0

    def crossed(self, a: int, b: int) -> list[Edge] | None:
        """The edges that the segment from a to b crosses, in order; None where it meets a vertex."""
        start = j = self.next[a]
        for _ in range(len(self.x)):
            k = self.third.get((a, j))
            if k is None:
                return None
            if self.turn(a, b, j) < 0.0 < self.turn(a, b, k) and self.turn(j, k, b) < 0.0:
                break
            j = k
            if j == start:
                return None
        else:
            return None
        found = [(j, k)]
        for _ in range(len(self.x)):
            p, q = found[-1]
            r = self.third.get((q, p))
            if r is None:
                return None
            if r == b:
                return found
            side = self.turn(a, b, r)
            if side == 0.0:
                return None
            found.append((r, q) if side < 0.0 else (p, r))
        return None

    def insert(self, a: int, b: int) -> bool:
        """Turn the edges that cross a–b until none does (Sloan 1993); False where that does not end."""
        waiting = self.crossed(a, b)
        if waiting is None:
            return False
        for _ in range(self.patience * len(self.x)):
            if not waiting:
                return self.contains(a, b)
            p, q = waiting.pop(0)
            r, s = self.third[p, q], self.third[q, p]
            if not (self.turn(p, s, r) > 0.0 and self.turn(s, q, r) > 0.0):
                waiting.append((p, q))
                continue
            del self.third[p, q], self.third[q, p]
            self.put(p, s, r)
            self.put(s, q, r)
            if self.crosses(a, b, r, s):
                waiting.append((r, s))
        return False

    def right_of(self, border: list[Edge]) -> NDArray[np.int64] | None:
        """The faces (s, 3) to the right of a border's directed edges, and all that is beyond them; None for none."""
        walls = set(border)
        waiting = [(b, a) for a, b in border]
        seen: set[Edge] = set()
        found = []
        while waiting:
            a, b = waiting.pop()
            if (a, b) in seen:
                continue
            if (a, b) in walls:
                return None  # the chart's own side was reached: its border is not closed here
            c = self.third.get((a, b))
            if c is None:
                continue
            seen |= {(a, b), (b, c), (c, a)}
            found.append((a, b, c))
            waiting += [(j, i) for i, j in ((b, c), (c, a)) if (j, i) not in walls]
        return np.array(found, dtype=np.int64) if found else None

"""Fits a gated network of affine experts (gated.py) to samples, in closed form.

n samples · d inputs · m outputs · k nodes of one level · e experts.   float64.

Level by level, all nodes of a level at once.  A node is a part of the input space with the samples in it.  It becomes
an expert where one affine map answers for all of them within a tolerance and they have one label; else the best of a
few gates halves it.  Affine maps are ridge regressions whose ridge draws towards the mean slope of the surface at the
samples: that settles what samples in a plane, on a line or at one point leave open.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial import KDTree

from .experts import Lesson, fit_affine, misses, untorn
from .gated import GatedExperts, Grid
from .gates import Chosen, Spread, best_gates, second_side
from .sums import node_sums, squares

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .config import GrowConfig


class Nodes(NamedTuple):
    """The nodes of a level: rows (n,) of the lesson, node by node; first (k,): where those of each node begin.

    slot (k,): where the code of each node is written: the cells of the grid come first, then both sides of each gate.
    """

    rows: NDArray[np.int64]
    first: NDArray[np.int64]
    slot: NDArray[np.int64]

    @property
    def sizes(self) -> NDArray[np.int64]:
        """(k,) samples of each node."""
        return np.diff(self.first, append=len(self.rows))

    @property
    def owner(self) -> NDArray[np.int64]:
        """(n,) the node of each row."""
        return np.repeat(np.arange(len(self.first)), self.sizes)


@dataclass
class Decided:
    """What is settled so far.

    grid: the coarsest cells.  occupied: (o,) those with samples.  codes: slot → gate g, or −1 − expert.  depth: levels
    of gates.  gates: (·, d + 1) a level.  rows, owners: samples, and the expert of each.
    """

    grid: Grid
    occupied: NDArray[np.int64]
    codes: NDArray[np.int64]
    depth: int = 0
    gates: list[NDArray[np.float64]] = field(default_factory=list)
    rows: list[NDArray[np.int64]] = field(default_factory=list)
    owners: list[NDArray[np.int64]] = field(default_factory=list)
    gate_count: int = 0
    expert_count: int = 0


def grow(lesson: Lesson, config: GrowConfig, tolerance: float, rng: np.random.Generator) -> GatedExperts:
    """A gated network that answers y and label at x.

    A pilot on few samples and the coarsest grid says how fine the grid is to be: a plane needs no cells.

    Args:
        lesson: at least one sample.
        config: sizes and limits.
        tolerance: largest error of an expert at its samples, in the units of y.
        rng: which of the known gates are tried.
    """
    few = lesson.among(np.arange(0, len(lesson.x), config.pilot))
    pilot = grow_on(lay_grid(few.x, config.coarsest, config.longest), few, config, tolerance, rng)
    halved = len(pilot.label) - len(np.unique(pilot.start))
    cells = min(config.coarsest + config.cells_each * halved, config.cells)
    return grow_on(_filled_grid(lesson.x, cells, config), lesson, config, tolerance, rng)


def grow_on(grid: Grid, lesson: Lesson, config: GrowConfig, tolerance: float, rng: np.random.Generator) -> GatedExperts:
    """As grow, on that grid."""
    cells = grid.number(lesson.x.astype(np.float32))
    order = np.argsort(cells, kind="stable")
    slot, first = np.unique(cells[order], return_index=True)
    nodes, decided = Nodes(order, first, slot), Decided(grid, slot, np.zeros(grid.count, dtype=np.int64))
    apart = _apart(lesson, config.apart)
    own = apart.among(nodes.rows)
    while len(nodes.first):
        done = _is_done(own, nodes, config, tolerance, decided) | (decided.depth >= config.deepest)
        nodes, own = _halve(own, nodes, done, config, decided, rng)
        decided.depth += len(nodes.first) > 0
    return _assembled(lesson, decided, config, tolerance)


def lay_grid(x: NDArray[np.float64], most: int, longest: int) -> Grid:
    """Nearly cubic cells over the samples: as small as ``most`` cells, and ``longest`` along an axis, allow."""
    low, high = (np.array([side(column) for column in x.T]) for side in (np.min, np.max))
    extent = np.maximum(high - low, 1e-9 * max(float((high - low).max()), 1e-9))
    sides = float(extent.max()) / np.arange(longest, 0, -1)
    shapes = np.ceil(extent / sides[:, None]).clip(min=1.0)
    shape = shapes[int((shapes.prod(axis=1) <= most).argmax())]
    return Grid(low.astype(np.float32), (extent / shape).astype(np.float32), shape.astype(np.int64))


def _filled_grid(x: NDArray[np.float64], cells: int, config: GrowConfig) -> Grid:
    """A grid of at most so many cells, coarse enough that those with samples have enough on the mean.

    A cell that misses the samples of one of its charts does not know of it.
    """
    while True:
        grid = lay_grid(x, cells, config.longest)
        if cells <= config.coarsest or len(x) >= config.per_cell * len(np.unique(grid.number(x.astype(np.float32)))):
            return grid
        cells = max(cells * 2 // 3, config.coarsest)


def _apart(lesson: Lesson, multiple: float) -> Lesson:
    """The outputs of each label moved far away from those of all others, so that one error speaks for both."""
    extent = max(*(float(np.ptp(column)) for column in lesson.y.T), 1e-9)
    labels = int(lesson.label.max()) + 1
    away = np.random.default_rng(0).uniform(-1.0, 1.0, size=(labels, lesson.y.shape[1])) * multiple * extent
    return lesson._replace(y=lesson.y + away[lesson.label])


def _is_done(own: Lesson, nodes: Nodes, config: GrowConfig, tolerance: float, decided: Decided) -> NDArray[np.bool_]:
    """(k,) True for nodes that are to be experts: of one label, and good or small enough; or beyond the budget.

    own: the samples of the level, node by node.
    """
    off = np.sqrt(squares(misses(own, nodes.first, fit_affine(own, nodes.first, config.ridge))))
    worst = np.maximum.reduceat(off, nodes.first)
    low, high = (reduce.reduceat(own.label, nodes.first) for reduce in (np.minimum, np.maximum))
    done = (low == high) & ((worst <= tolerance) | (nodes.sizes <= config.fewest))
    room = config.most - decided.expert_count - len(done)
    if np.count_nonzero(~done) > room:
        urgent = np.where(done, -1.0, np.add.reduceat(off, nodes.first))
        done[np.argsort(-urgent, kind="stable")[max(room, 0) :]] = True
    return done


def _halve(
    own: Lesson,
    nodes: Nodes,
    done: NDArray[np.bool_],
    config: GrowConfig,
    decided: Decided,
    rng: np.random.Generator,
) -> tuple[Nodes, Lesson]:
    """Write down what is settled on this level, and halve the other nodes into those of the next.

    own: the samples of the level, node by node, as those of the next come back with it: near each other in memory.
    """
    plane = np.full((len(done), own.x.shape[1] + 1), np.nan)
    if not done.all():
        count = nodes.sizes[~done]
        kept, first = own.among(np.flatnonzero(~done[nodes.owner])), np.cumsum(count) - count
        chosen = best_gates(_spread(kept, first), config.known, config.gate_ridge, rng)
        useful = _is_useful(chosen, count, _labels(kept.label, first), config)
        plane[np.flatnonzero(~done)[useful]] = chosen.plane[useful]
    gated = np.isfinite(plane[:, 0])
    _settle(nodes, gated, decided)
    gate = decided.gate_count + np.arange(np.count_nonzero(gated))
    decided.codes[nodes.slot[gated]] = gate
    decided.gates.append(plane[gated])
    decided.gate_count += len(gate)
    slots = len(decided.codes) + np.arange(2 * len(gate))
    decided.codes = np.concatenate([decided.codes, np.zeros(2 * len(gate), dtype=np.int64)])
    place, owner = np.flatnonzero(gated[nodes.owner]), np.repeat(np.arange(len(gate)), nodes.sizes[gated])
    side = 2 * owner + second_side(np.take(plane[gated], owner, axis=0), np.take(own.x, place, axis=0))
    order = np.argsort(side, kind="stable")
    place = place[order]
    following = Nodes(nodes.rows[place], np.searchsorted(side[order], np.arange(2 * len(gate))), slots)
    return following, own.among(place)


def _is_useful(
    chosen: Chosen, count: NDArray[np.int64], labels: NDArray[np.int64], config: GrowConfig
) -> NDArray[np.bool_]:
    """(k,) True where halving a node of ``count`` samples of so many ``labels`` helps.

    Two labels that lie all over each other would be parted down to single samples if a smaller error were enough: two
    affine maps have to explain more than one for each degree of freedom, samples less parameters.  The plane of a seam
    is no such guess, and one gate can't be asked to do much about many labels.
    """
    possible = np.isfinite(chosen.left)
    left = np.where(possible, chosen.left, 0.0)
    one = left <= config.gain * chosen.before
    free, left_free = count - config.parameters, count - 2 * config.parameters
    explains = left * free <= config.gain * chosen.before * left_free
    two = np.where((left_free > 0) & ~chosen.known, explains, one)
    return possible & np.select([labels == 1, labels == 2], [one, two], True)


def _labels(label: NDArray[np.int64], first: NDArray[np.int64]) -> NDArray[np.int64]:
    """(k,) how many different labels the samples of each node have."""
    owner = np.repeat(np.arange(len(first)), np.diff(first, append=len(label)))
    pairs = np.unique(owner * (int(label.max()) + 1) + label) // (int(label.max()) + 1)
    return np.bincount(pairs, minlength=len(first))


def _spread(own: Lesson, first: NDArray[np.int64]) -> Spread:
    """The samples of nodes about their means."""
    count = np.diff(first, append=len(own.x))
    mean_x, mean_y = (node_sums(part, first) / count[:, None] for part in (own.x, own.y))
    x, y = own.x - np.repeat(mean_x, count, axis=0), own.y - np.repeat(mean_y, count, axis=0)
    return Spread(x, y, own.plane, first, mean_x, own.x)


def _settle(nodes: Nodes, gated: NDArray[np.bool_], decided: Decided) -> None:
    """Make experts of the nodes that got no gate."""
    expert = decided.expert_count + np.cumsum(~gated) - 1
    decided.codes[nodes.slot[~gated]] = -1 - expert[~gated]
    rows = ~gated[nodes.owner]
    decided.rows.append(nodes.rows[rows])
    decided.owners.append(expert[nodes.owner[rows]])
    decided.expert_count += int(np.count_nonzero(~gated))


class _Experts(NamedTuple):
    """Affine maps of experts: slope (e, m, d) and bias (e, m); centre (e, d) of their samples, and radius (e,)."""

    slope: NDArray[np.float64]
    bias: NDArray[np.float64]
    centre: NDArray[np.float64]
    radius: NDArray[np.float64]


def _assembled(lesson: Lesson, decided: Decided, config: GrowConfig, tolerance: float) -> GatedExperts:
    """The network: experts fitted to the samples of their own label; cells without samples begin like the nearest."""
    rows, owner, grid = np.concatenate(decided.rows), np.concatenate(decided.owners), decided.grid
    label, share = _majority(lesson.label[rows], owner, decided.expert_count)
    own = lesson.label[rows] == label[owner]
    order = np.argsort(owner[own], kind="stable")
    experts = _experts(lesson.among(rows[own][order]), owner[own][order], decided.expert_count, config, tolerance)
    codes = np.where(decided.codes < 0, decided.gate_count - 1 - decided.codes, decided.codes).astype(np.int32)
    return GatedExperts(
        grid=grid,
        start=codes[: grid.count][nearest_cells(grid, decided.occupied)],
        gates=np.concatenate(decided.gates).astype(np.float32),
        sides=codes[grid.count :].reshape(-1, 2),
        depth=decided.depth,
        weights=np.concatenate([experts.slope, experts.bias[:, :, None]], axis=2).astype(np.float32),
        label=label,
        centre=experts.centre.astype(np.float32),
        radius=np.maximum(experts.radius, config.near * float(grid.cell.max())).astype(np.float32),
        share=share.astype(np.float32),
    )


def _experts(own: Lesson, owner: NDArray[np.int64], count: int, config: GrowConfig, tolerance: float) -> _Experts:
    """So many experts, fitted to samples that come expert by expert: owner (n,)."""
    first = np.searchsorted(owner, np.arange(count))
    fitted = untorn(own, first, fit_affine(own, first, config.ridge), config.torn * tolerance, config.steepest)
    bias = fitted.mean_y - np.einsum("kmd,kd->km", fitted.slope, fitted.mean_x)
    away = np.linalg.norm(own.x - fitted.mean_x[owner], axis=1)
    return _Experts(fitted.slope, bias, fitted.mean_x, config.slack * np.maximum.reduceat(away, first))


def _majority(
    label: NDArray[np.int64], owner: NDArray[np.int64], experts: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The most frequent label (e,) of each expert's samples, and its share of them (e,)."""
    labels = int(label.max()) + 1
    pair, count = np.unique(owner * labels + label, return_counts=True)
    order = np.lexsort((pair, -count, pair // labels))
    best = order[np.searchsorted(pair[order] // labels, np.arange(experts))]
    return pair[best] % labels, count[best] / np.bincount(owner, minlength=experts)


def nearest_cells(grid: Grid, occupied: NDArray[np.int64]) -> NDArray[np.int64]:
    """(cells,) for each cell of the grid the nearest of the ``occupied``, itself where it is one of them."""
    place = np.stack(np.unravel_index(np.arange(grid.count), tuple(grid.shape)), axis=1)
    return occupied[KDTree(place[occupied]).query(place)[1]]
